#include "node/bridges/rdt_page.hpp"

#include <fmt/format.h>

#include <cmath>

#include "node/bridges/edge.hpp"

namespace tactiled::bridges::rdt {
namespace {

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        if (c == '&')
            out += "&amp;";
        else if (c == '<')
            out += "&lt;";
        else if (c == '>')
            out += "&gt;";
        else
            out += std::uint8_t(c) < 0x20 ? ' ' : c;
    }
    return out;
}

// The counts of the newest value, fx fy fz mx my mz; "" where there is none.
std::string counts_of(const Device& device) {
    const auto values = values_of(device.newest, device.zero);
    std::string text;
    for (std::size_t i = 0; values && i < 6; ++i) {
        const double scale = i < 3 ? device.scale.counts_per_N : device.scale.counts_per_Nm;
        text += fmt::format("{}{:.0f}", i == 0 ? "" : ";", (*values)[i] * scale);
    }
    return text;
}

// The largest values that the calibration knows; 0 where it knows none.
std::string ranges_of(const Device& device) {
    std::string text;
    for (std::size_t i = 0; i < 6; ++i) {
        const float range = device.full_scale[i];
        const bool known = (device.zero >> i & 1u) == 0 && std::isfinite(range);
        text += fmt::format("{}{:g}", i == 0 ? "" : ";", known ? range : 0.0f);
    }
    return text;
}

}  // namespace

std::string netft_xml(const Device& device) {
    const double rate_Hz = device.rate_Hz > 0 ? device.rate_Hz : double(device.newest.rate_Hz);
    const std::pair<const char*, std::string> elements[] = {
        {"prodname", device.simulated ? "tactiled, simulated" : "tactiled"},
        {"runstat", fmt::format("0x{:08X}", rdt_status(device.newest.quality, device.newest.reasons))},
        {"runft", counts_of(device)},
        {"setcfgsel", "0"},
        {"setuserfilter", "0"},
        {"setbias", "0;0;0;0;0;0"},
        {"cfgnam", device.node + " " + device.sensor},
        {"cfgcalsel", std::to_string(device.calibration)},
        {"calsn", device.serial},
        {"cfgfu", "2"},
        {"scfgfu", "N"},
        {"cfgtu", "3"},
        {"scfgtu", "N-m"},
        {"cfgcpf", fmt::format("{:.0f}", device.scale.counts_per_N)},
        {"cfgcpt", fmt::format("{:.0f}", device.scale.counts_per_Nm)},
        {"cfgmr", ranges_of(device)},
        {"netip", device.address},
        {"comrdte", "Enabled"},
        {"comrdtrate", fmt::format("{:.0f}", std::isfinite(rate_Hz) ? rate_Hz : 0)},
        {"comrdtbsiz", "1"},
    };
    std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<netft>\n";
    for (const auto& [name, value] : elements) text += fmt::format("<{0}>{1}</{0}>\n", name, escaped(value));
    return text + "</netft>\n";
}

}  // namespace tactiled::bridges::rdt
