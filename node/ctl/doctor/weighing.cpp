// The accuracy of weights that a configuration with [grasp] will have.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/calibration.hpp"
#include "decoupling/grasp/expectation.hpp"
#include "decoupling/solve/domain.hpp"
#include "node/ctl/doctor/doctor.hpp"
#include "node/setup.hpp"

namespace tactiled::ctl::doctor {
namespace {

// The stated accuracy of the method in use; NaN for a component without one.
grasp::JawAccuracy accuracy_of(const Calibration& calibration) {
    grasp::JawAccuracy accuracy;
    accuracy.sd_N.fill(std::nan(""));
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        if (c >= accuracy.sd_N.size()) continue;
        if (i < calibration.sd.size()) accuracy.sd_N[c] = calibration.sd[i];
        if (i < calibration.sd_slope.size()) accuracy.sd_slope[c] = calibration.sd_slope[i];
    }
    return accuracy;
}

std::string sd_text(double sd_kg, double mass_kg) {
    return std::isfinite(sd_kg) ? fmt::format("{:.2g} kg ({:.2g} %)", sd_kg, 100 * sd_kg / mass_kg) : "no stable weight";
}

}  // namespace

std::vector<std::string> expected_weights(const Node& node) {
    if (!node.grasp) return {};
    std::vector<grasp::JawAccuracy> accuracy;
    for (const auto& jaw : node.grasp->estimator.jaws) {
        Problems none;
        const SensorSettings& sensor = node.config.sensors[jaw.sensor];
        const Calibration calibration = load_calibration(sensor.calibration, none);
        accuracy.push_back(accuracy_of(calibration.with_method(node.plan.sensors[jaw.sensor].method)));
        if (std::isnan(accuracy.back().sd_N[0]) || std::isnan(accuracy.back().sd_N[1]))
            return {fmt::format(
                "weight: its standard deviation is not known: the calibration of \"{}\" states none of fx and fy",
                sensor.name)};
        if (std::isnan(accuracy.back().sd_N[2])) accuracy.back().sd_N[2] = 0;
    }
    std::vector<std::string> lines;
    for (const auto& one : grasp::expected_weights(node.grasp->estimator, accuracy))
        lines.push_back(fmt::format("weight: {:g} kg, held with {:.2g} N a jaw: expected sd {}; after `weigh known {:g}` {}",
                                    one.mass_kg, one.press_N, sd_text(one.sd_kg, one.mass_kg), one.known_kg,
                                    sd_text(one.sd_known_kg, one.mass_kg)));
    return lines;
}

}  // namespace tactiled::ctl::doctor
