#include "node/lab/calibrate_array.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "config/text_file.hpp"
#include "decoupling/fit/array_fit.hpp"

namespace tactiled::ctl {
namespace {

using State = TaxelReport::State;

std::vector<std::size_t> taxels_that_are(const ArrayReport& report, State state) {
    std::vector<std::size_t> list;
    for (std::size_t i = 0; i < report.taxels.size(); ++i)
        if (report.taxels[i].state == state) list.push_back(i);
    return list;
}

struct NamedState {
    State state;
    const char* text;
};
constexpr NamedState kNamed[] = {{State::dead, "no response; predicted from the neighbours"},
                                 {State::weak, "less sensitive than the others"},
                                 {State::strong, "more sensitive than the others"},
                                 {State::unloaded, "too little load; see gain_sd in the map"}};

void print_report(const ArrayReport& report, const std::string& out) {
    const Calibration& c = report.calibration;
    fmt::print("{}: model {}, {} taxels of {} values\n", out, c.model, report.taxels.size(), c.channels.size());
    fmt::print("rows: {} of {} presses, {} without a load, {} left out; {} different loads\n", report.loaded_rows,
               report.presses, report.rest_rows, report.left_out, report.steps);
    fmt::print("matrix of all taxels: {}\n", report.matrix_is_fitted ? "from the presses" : "as stated, times a factor");
    fmt::print("gains before: sd {:.1f} %; after: gain_sd {:.1f} % (median)\n", 100 * report.gain_spread,
               100 * report.gain_sd);
    fmt::print("noise of a taxel: {:.3g} N; common sd without a load: {} {:.3g}\n", c.tables.at("taxel_sd")[0].back(),
               c.components[0], c.sd[0]);
    fmt::print(
        "beyond the noise: {:.2f} % of the force{}\n", 100 * report.force_error,
        std::isfinite(report.place_error_m) ? fmt::format(", {:.3f} mm of the place", 1e3 * report.place_error_m) : "");
    fmt::print("presses left out: force error {:.3g} N rms, {:.1f} % within 1 sd, {:.2f} % beyond 5\n",
               report.held_out_rms_N, 100 * report.within_1_sd, 100 * report.beyond_5_sd);
    for (const NamedState& named : kNamed)
        if (const auto list = taxels_that_are(report, named.state); !list.empty())
            fmt::print("{} ({}; {}): {}\n", text_of(named.state), list.size(), named.text, fmt::join(list, " "));
    for (const auto& warning : report.warnings) fmt::print(stderr, "warning: {}\n", warning);
}

void print_json(const ArrayReport& report, const std::string& out) {
    const auto number = [](double x) { return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(); };
    nlohmann::json json{{"schema", 1},
                        {"calibration", out},
                        {"model", report.calibration.model},
                        {"taxels", report.taxels.size()},
                        {"presses", report.presses},
                        {"rows_used", report.loaded_rows},
                        {"rows_without_load", report.rest_rows},
                        {"rows_left_out", report.left_out},
                        {"matrix_is_fitted", report.matrix_is_fitted},
                        {"gain_spread", number(report.gain_spread)},
                        {"gain_sd", number(report.gain_sd)},
                        {"force_error", number(report.force_error)},
                        {"place_error_m", number(report.place_error_m)},
                        {"held_out_rms_N", number(report.held_out_rms_N)},
                        {"within_1_sd", number(report.within_1_sd)},
                        {"beyond_5_sd", number(report.beyond_5_sd)},
                        {"warnings", report.warnings}};
    for (const NamedState& named : kNamed) json[text_of(named.state)] = taxels_that_are(report, named.state);
    fmt::print("{}\n", json.dump(2));
}

}  // namespace

void calibrate_array(const FitEntry& entry, const FitRequest& request, const ArraySettings& settings, const std::string& in,
                     const std::string& out, bool json) {
    ArrayRequest array{
        .in = in, .start = {}, .saturates_below = request.saturates_below, .saturates_above = request.saturates_above};
    if (!settings.geometry.empty()) {
        Problems problems;
        array.start = load_calibration(settings.geometry, problems);
        problems.throw_if_any();
        if (array.start.model != request.model)
            throw SetupError(fmt::format("--geometry {}: is of model \"{}\", not of \"{}\"", in_quotes(settings.geometry),
                                         array.start.model, request.model));
        (void)make_decoupler(array.start);
    }
    for (const auto& [name, value] : request.parameters) array.start.parameters[name] = value;
    array.start.contact_model = request.contact_model;
    array.start.serial = request.serial;
    array.start.date = request.date;
    if (array.start.channel_unit.empty() || request.channel_unit != entry.channels.unit)
        array.start.channel_unit = request.channel_unit;
    const ArrayReport report = entry.array(array);
    save_calibration(report.calibration, out);
    if (!settings.map.empty()) replace_file(settings.map, taxel_csv(report));
    if (json)
        print_json(report, out);
    else
        print_report(report, out);
}

}  // namespace tactiled::ctl
