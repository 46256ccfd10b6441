// Temperature of a sensor: what the calibration knows about it is taken off, and the rest is in the standard deviation.
//
// A calibration with zero and gain against temperature takes the channels back to the reference temperature before any
// method and any check sees them. A temperature beyond the range of the calibration makes the estimate UNCERTAIN
// (TACTILED_OUTSIDE_DOMAIN). One thermometer does not show that the channels differ in temperature: the standard deviation
// contains what the declared difference changes. Without a temperature it contains the change over the declared range, and
// is unknown without such a range.
//
// A calibration that does not know temperature may belong to a model whose zero is known to follow it (TemperatureEffect).
// Its standard deviation contains the change over the declared range, by default over kRoom_K, and of the declared
// difference between channels. Above a tenth of full scale the estimate is UNCERTAIN.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "config/registry.hpp"
#include "decoupling/decoupler.hpp"

namespace tactiled {

inline constexpr double kRoom_K = 10;  // a room by day and by night

// Zeros and gains of a model's channels follow temperature by coefficients that are known for its material.
struct TemperatureEffect {
    std::string_view name;          // the model
    double zero_per_K = 0;          // in `channel_unit`, or relative to the zero
    std::string_view channel_unit;  // "" = relative to the zero of the channel, in any unit
    double gain_per_K = 0;          // magnitude, relative to the gain
    Registry<TemperatureEffect> in_list{this};
};

// Returns the effect of the model whose calibration does not know temperature, nullptr if there is none. setup
const TemperatureEffect* temperature_effect(const Calibration& calibration) noexcept;

// Returns what `make` makes if neither the calibration nor its model knows an effect of temperature. `make` makes the
// decoupler that sees the channels at the reference temperature, and another one whenever the effect on it is examined: the
// one that runs must not see these readings. setup
using MakeDecoupler = std::function<std::unique_ptr<Decoupler>()>;
std::unique_ptr<Decoupler> with_temperature(const Calibration& calibration, MakeDecoupler make);

// The reading as it is at the reference temperature. rt: wait-free
double at_reference(const Temperature& temperature, std::size_t k, double reading, double temperature_C) noexcept;

// The fault of the calibration's temperature, "" if there is none. setup
std::string fault_of_temperature(const Calibration& calibration);

}  // namespace tactiled
