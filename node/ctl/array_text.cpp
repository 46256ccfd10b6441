#include "node/ctl/array_text.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>

#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

constexpr char kAxes[] = "xyz";

// JSON by hand: an array of 4,096 taxels is written several times a second.
template <typename T>
void put_number(T value, std::string& out) {
    if (std::isfinite(value))
        fmt::format_to(std::back_inserter(out), "{}", value);
    else
        out += "null";
}

void put(const char* key, double value, std::string& out) {
    fmt::format_to(std::back_inserter(out), "\"{}\":", key);
    put_number(float(value), out);
    out += ',';
}

// at(i): number i of `n`.
template <typename At>
void put_list(std::string_view key, std::size_t n, At at, std::string& out) {
    fmt::format_to(std::back_inserter(out), "\"{}\":[", key);
    for (std::size_t i = 0; i < n; ++i) {
        if (i != 0) out += ',';
        put_number(at(i), out);
    }
    out += "],";
}

void put_text(const char* key, const std::string& value, std::string& out) {
    const auto replace = nlohmann::json::error_handler_t::replace;  // a name that is no UTF-8
    fmt::format_to(std::back_inserter(out), "\"{}\":{},", key, nlohmann::json(value).dump(-1, ' ', false, replace));
}

// Index of component 0, 1 or 2 among the measured ones.
std::size_t place_of(std::uint32_t component, const Array& array) {
    return std::size_t(std::popcount(array.components() & ((1u << component) - 1)));
}

std::string taxel_text(const tactiled_array_plan& plan, std::uint32_t i) {
    return plan.columns == 0 ? fmt::format("{}", i)
                             : fmt::format("{} (row {}, column {})", i, i / plan.columns, i % plan.columns);
}

// "1.20 +- 0.05", scaled.
std::string with_sd(double value, double sd, double scale, int digits) {
    if (!std::isfinite(value)) return "-";
    return fmt::format("{:.{}f} +- {}", value * scale, digits,
                       std::isfinite(sd) ? fmt::format("{:.{}f}", sd * scale, digits) : "?");
}

// Press, or the state of a taxel that has none, in a column of 9.
std::string cell(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::uint32_t i) {
    const float press = press_N(segment, sensor, array, i);
    if (std::isfinite(press)) return fmt::format("{:>9.4f}", press);
    const std::uint32_t state = array.states()[i];
    return fmt::format("{:>9}", state == 0 ? "-" : kTaxelStates[std::size_t(std::countr_zero(state)) % kTaxelStates.size()]);
}

}  // namespace

float press_N(std::uint32_t components, const float* force_S_N, const float* normal_S) {
    float press = 0;
    for (std::uint32_t c = 0; c < 3; ++c)
        if ((components >> c & 1u) != 0) press -= *force_S_N++ * normal_S[c];
    return press;
}

float press_N(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::uint32_t i) {
    const float* const normal = tactiled_taxel_places(segment.c(), sensor) + std::size_t(i) * 6 + 3;
    return press_N(array.components(), array.force_S_N(i), normal);
}

void append_array_json(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::string& out) {
    const tactiled_array& head = array.head();
    const tactiled_sample& s = head.sample;
    put_text("sensor", segment.sensor(sensor).name, out);
    put_text("quality", quality_text(s.quality, s.reasons), out);
    fmt::format_to(std::back_inserter(out), "\"sequence\":{},\"t_ns\":{},\"epoch\":{},\"n_out\":{},\"n_contact\":{},",
                   s.sequence, s.t_ns, segment.header().epoch, head.n_out, head.n_contact);
    out += std::isfinite(head.peak_N) ? fmt::format("\"peak_taxel\":{},", head.peak_taxel) : "\"peak_taxel\":null,";
    put("peak_N", head.peak_N, out);
    put("peak_sd_N", head.peak_sd_N, out);
    put_list(
        "cop_S_m", 3, [&](std::size_t i) { return head.cop_S_m[i]; }, out);
    put_list(
        "cop_sd_m", 3, [&](std::size_t i) { return head.cop_sd_m[i]; }, out);
    put("area_m2", head.area_m2, out);
    put("area_sd_m2", head.area_sd_m2, out);
    put("axis_rad", head.axis_rad, out);
    put("axis_sd_rad", head.axis_sd_rad, out);
    for (std::uint32_t c = 0; c < 3; ++c) {
        if ((array.components() >> c & 1u) == 0) continue;
        const float* const from = array.forces() + place_of(c, array);
        put_list(
            fmt::format("f{}_N", kAxes[c]), array.n_taxels(), [&](std::size_t i) { return from[i * array.n_components()]; },
            out);
    }
    put_list(
        "state", array.n_taxels(), [&](std::size_t i) { return unsigned(array.states()[i]); }, out);
}

void append_places_json(const SegmentView& segment, std::uint32_t sensor, std::string& out) {
    const tactiled_array_plan& plan = segment.c()->array[sensor];
    const float* const places = tactiled_taxel_places(segment.c(), sensor);
    put_text("sensor", segment.sensor(sensor).name, out);
    fmt::format_to(std::back_inserter(out), "\"epoch\":{},\"taxels\":{},\"rows\":{},\"columns\":{},", segment.header().epoch,
                   plan.n_taxels, plan.rows, plan.columns);
    for (std::size_t c = 0; c < 6; ++c)
        put_list(
            c < 3 ? fmt::format("{}_m", kAxes[c]) : fmt::format("normal_{}", kAxes[c - 3]), plan.n_taxels,
            [&](std::size_t i) { return places[i * 6 + c]; }, out);
}

std::string array_table(const SegmentView& segment, std::uint32_t sensor, const Array& array) {
    const tactiled_array& head = array.head();
    const tactiled_array_plan& plan = segment.c()->array[sensor];
    std::string out =
        fmt::format("{}  {} taxels{}  sequence {}  {}\n", segment.sensor(sensor).name, plan.n_taxels,
                    plan.columns == 0 ? "" : fmt::format(", {} x {}", plan.rows, plan.columns), head.sample.sequence,
                    coloured(head.sample.quality, quality_text(head.sample.quality, head.sample.reasons)));
    out += "centre of pressure/mm";
    for (std::size_t c = 0; c < 3; ++c)
        out += fmt::format("  {} {}", kAxes[c], with_sd(head.cop_S_m[c], head.cop_sd_m[c], 1e3, 2));
    out += fmt::format("\narea/mm2 {} of {} taxels  peak/N {}{}\n", with_sd(head.area_m2, head.area_sd_m2, 1e6, 1),
                       head.n_contact, with_sd(head.peak_N, head.peak_sd_N, 1, 4),
                       std::isfinite(head.peak_N) ? " at taxel " + taxel_text(plan, head.peak_taxel) : "");
    out += fmt::format("taxels without a force: {}\n", head.n_out);
    if (plan.columns != 0) {
        out += "press/N of each row\n";
        for (std::uint32_t i = 0; i < plan.n_taxels; ++i)
            out += cell(segment, sensor, array, i) + ((i + 1) % plan.columns == 0 ? "\n" : "");
        return out;
    }
    out += fmt::format("{:>6} {:>9} {:>9} {:>9} {:>9}\n", "taxel", "x/mm", "y/mm", "z/mm", "press/N");
    const float* const places = tactiled_taxel_places(segment.c(), sensor);
    for (std::uint32_t i = 0; i < plan.n_taxels; ++i)
        out += fmt::format("{:>6} {:>9.3f} {:>9.3f} {:>9.3f} {}\n", i, 1e3f * places[i * 6], 1e3f * places[i * 6 + 1],
                           1e3f * places[i * 6 + 2], cell(segment, sensor, array, i));
    return out;
}

void append_array_csv(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::string& out) {
    const auto number = [](float value) { return std::isfinite(value) ? fmt::format("{}", value) : std::string(); };
    const float* const places = tactiled_taxel_places(segment.c(), sensor);
    const auto& s = array.head().sample;
    const std::string t_s = fmt::format("{:.6f}", double(s.t_ns) / 1e9), quality = quality_text(s.quality, s.reasons);
    for (std::uint32_t i = 0; i < array.n_taxels(); ++i) {
        out += fmt::format("{},{},{},{},{}", t_s, i, places[i * 6], places[i * 6 + 1], places[i * 6 + 2]);
        for (std::uint32_t c = 0; c < 3; ++c) {
            const bool is_measured = (array.components() >> c & 1u) != 0;
            out += "," + (is_measured ? number(array.force_S_N(i)[place_of(c, array)]) : "");
        }
        out += fmt::format(",{},\"{}\"\n", words_of(array.states()[i], kTaxelStates), quality);
    }
}

}  // namespace tactiled::ctl
