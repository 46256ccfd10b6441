// Configuration and calibration texts. Oracles: a calibration that is accepted is written and read back the same, in every
// number and name.
#include <cstdlib>
#include <tuple>

#include "config/calibration.hpp"
#include "config/options.hpp"

using namespace tactiled;

namespace {

auto all_of(const Fit& f) {
    return std::tie(f.method, f.zero, f.matrix, f.parameters, f.tables, f.sd, f.sd_slope, f.sd_load, f.condition,
                    f.validation);
}

bool same(const Calibration& a, const Calibration& b) {
    const auto about = [](const Calibration& c) {
        return std::tie(c.model, c.contact_model, c.serial, c.date, c.nominal, c.channels, c.channel_unit, c.channel_least,
                        c.channel_most, c.components, c.full_scale, c.rows);
    };
    if (about(a) != about(b) || all_of(a) != all_of(b) || a.others.size() != b.others.size()) return false;
    for (std::size_t i = 0; i < a.others.size(); ++i)
        if (all_of(a.others[i]) != all_of(b.others[i])) return false;
    return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    Problems problems;
    Options options = Options::parse_text(text, "fuzz.toml", problems);
    (void)options.text("name", "");
    (void)options.number("x", {0, 1}, 0.5);
    for (auto& table : options.tables("sensor")) (void)table.texts("channels");
    options.finish();
    (void)problems.lines();
    Problems of_calibration;
    const Calibration calibration = parse_calibration(std::string(text), "fuzz.toml", of_calibration);
    if (!of_calibration.empty()) return 0;
    Problems again;
    const std::string written = calibration_text(calibration);
    const Calibration back = parse_calibration(written, "again.toml", again);
    if (!again.empty() || !same(calibration, back) || calibration_text(back) != written) std::abort();
    return 0;
}
