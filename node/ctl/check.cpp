// tactilectl check FILE: checks a configuration and the files that it names, and reports every error at once. check
// --keys lists the possible keys.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "config/keys.hpp"
#include "decoupling/latency.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/doctor/doctor.hpp"
#include "node/ctl/status_text.hpp"
#include "node/ctl/verb.hpp"
#include "node/sensor_setup.hpp"
#include "node/setup.hpp"
#include "node/tuning.hpp"

namespace tactiled::ctl {
namespace {

// The loads that the channels of the sensor cannot show. `delay_s`: the known one of each channel.
std::vector<std::string> undetected_loads(const SensorSettings& sensor, bool is_array, const std::vector<double>& delay_s) {
    std::vector<std::string> loads;
    if (is_array) loads.emplace_back("a weak taxel, or a load on nothing but a dead one");
    const double measured_ms = 1e3 * measured_over_s(delay_s);
    if (measured_ms > sensor.stale_ms)
        loads.push_back(fmt::format(
            "a change of the load within the {:.0f} ms over which the channels are measured, longer than stale_ms = {}",
            measured_ms, sensor.stale_ms));
    Problems none;
    const Calibration calibration = load_calibration(sensor.calibration, none);
    // Two unknowns are the place of the press.
    const std::size_t n = calibration.channels.size(), unknowns = calibration.components.size() + 2;
    if (!is_array && n > 0 && n <= unknowns)
        loads.push_back(fmt::format("a press beside the places of the calibration ({} channels, {} unknowns)", n, unknowns));
    return loads;
}

// Returns the growth of the standard deviation of a zero, for the component whose zero is old first; "" if none grows.
std::string age_of_zero(const Calibration& calibration) {
    const ZeroError::Rates rates = zero_rates(calibration);
    std::size_t first = 6;
    double hours = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < rates.per_s.size(); ++c)
        if (const double h = rates.limit[c] / rates.per_s[c] / 3600; h < hours) hours = h, first = c;
    if (first == 6) return "";
    return fmt::format("its sd grows by {:.2g} {} in each hour ({}, {}), and it is old {:.1f} h after a tare or free rest",
                       3600 * rates.per_s[first], first < 3 ? "N" : "Nm", kComponentNames[first],
                       calibration.zero_rate_per_h.empty() ? "assumed: the sd of the force" : "zero_rate_per_h", hours);
}

// Returns the undetected damage of a channel, and whether the limit makes the sensor UNCERTAIN, as the daemon judges it.
std::string damage_of(const Node& node, std::size_t i, const Calibration& calibration) {
    const SensorSettings& sensor = node.config.sensors[i];
    const tactiled_undetected undetected = tactiled_undetected_in(&node.plan.sensors[i]);
    const bool is_known = std::isfinite(undetected.mean);
    const std::string text = damage_text(undetected, is_known ? calibration.channels[undetected.channel] : "");
    const Tuning tuning = tuning_of(sensor, calibration, {}, node.plan.sensors[i].full_scale, nullptr);
    if ((tuning.reasons & TACTILED_NOT_REDUNDANT) == 0) return text;
    return fmt::format("{}; {} undetected_damage_limit = {}, so it is UNCERTAIN (not-redundant)", text,
                       is_known ? "above" : "it cannot be compared with", sensor.undetected_damage_limit);
}

struct Args {
    std::string path;
    bool keys = false;
};

int check(const Args& args) {
    if (args.path.empty() && !args.keys) refuse_missing("file");
    if (args.keys) {
        fmt::print("{}", keys_markdown());
        return kGood;
    }
    Problems problems;
    const Node node = load_node(args.path, problems);
    for (const auto& line : problems.lines()) fmt::print(stderr, "{}\n", line);
    if (!problems.empty()) return kUnhealthy;
    doctor::Findings found;
    doctor::look_at_safety(node, found);
    bool wrong = false;
    for (const auto& f : found) {
        const bool is_wrong = f.verdict == doctor::Verdict::wrong;
        wrong = wrong || is_wrong;
        fmt::print(is_wrong ? stderr : stdout, "{}: {}\n", is_wrong ? "error" : "warning", f.says);
        if (!f.remedy.empty()) fmt::print(is_wrong ? stderr : stdout, "    -> {}\n", f.remedy);
    }
    if (!wrong) fmt::print("{}: good: {} links, {} sensors\n", args.path, node.links.size(), node.sensors.size());
    if (node.config.grasp)
        for (const std::string& advice : grasp_advice(*node.config.grasp)) fmt::print("warning: {}\n", advice);
    for (const std::string& line : doctor::expected_weights(node)) fmt::print("{}\n", line);
    for (const auto& link : node.links)
        for (const auto& binding : link->bindings) {
            const auto& sensor = node.config.sensors[binding.sensor];
            fmt::print("sensor \"{}\": age proved by {}\n", sensor.name, link->driver->freshness());
            if (link->driver->freshness().starts_with("arrival") && !sensor.accept_unproved_age)
                fmt::print(
                    "warning: sensor \"{}\": tares and weights are refused, because its age is not proved\n"
                    "    -> accept_unproved_age = true  # or send a counter (sequence = true) or the time\n",
                    sensor.name);
            const bool is_array = node.sensors[binding.sensor].patch() != nullptr;
            std::vector<std::string> missed = undetected_loads(sensor, is_array, node.sensors[binding.sensor].delay_s());
            if (const std::string delays = doctor::undetected_delays(*link->driver); !delays.empty())
                missed.insert(missed.begin(), delays);
            if (!missed.empty()) fmt::print("sensor \"{}\": not detected: {}\n", sensor.name, fmt::join(missed, "; "));
        }
    for (std::size_t i = 0; i < node.sensors.size(); ++i) {
        const SensorSettings& sensor = node.config.sensors[i];
        const Patch* const patch = node.sensors[i].patch();
        Problems none;
        const Calibration stated = load_calibration(sensor.calibration, none);
        const Calibration calibration = patch != nullptr ? patch->with_zero_of_taxels(stated) : stated;
        if (const std::string age = age_of_zero(calibration); !age.empty())
            fmt::print("sensor \"{}\": zero: {}\n", sensor.name, age);
        if (patch == nullptr) fmt::print("sensor \"{}\": {}\n", sensor.name, damage_of(node, i, calibration));
        if (patch == nullptr && calibration.channels.size() > 1 &&
            (calibration.monitor.limit == 0 || calibration.monitor.is_older))
            fmt::print(
                "warning: sensor \"{}\": {} {}: a channel that is damaged and stays within its range can look GOOD; "
                "calibrate again\n",
                sensor.name, sensor.calibration,
                calibration.monitor.is_older ? "has the joint domain of an older version, not a monitor" : "has no monitor");
    }
    return wrong ? kUnhealthy : kGood;
}

}  // namespace

Run add_check(Command verb) {
    auto args = std::make_shared<Args>();
    const Option file = verb.add_option("file", args->path, "the configuration");
    verb.add_flag("--keys", args->keys, "print every key with its unit, range and default instead, as Markdown")
        .excludes(file);
    return [args] { return check(*args); };
}

}  // namespace tactiled::ctl
