// Temperature of a sensor: its known influence is corrected, and the rest is added to the standard deviation.
//
// If a calibration has zero and gain against temperature, the channels are corrected to the reference temperature before any
// method and any check. A temperature beyond the range of the calibration makes the estimate UNCERTAIN
// (TACTILED_TEMPERATURE). One thermometer does not show differences between the channels, so the standard deviation
// includes the influence of the declared difference. If the temperature is unknown, the standard deviation includes the
// change over the declared range, and is unknown without such a range.
//
// The coefficients have standard deviations, so that of the estimate grows with the distance from the reference temperature.
//
// The thermometer may be a dummy: an unloaded gauge of the kind of the channels. It has a temperature scale of its own,
// dummy_per_K, so that the correction is r_k - (zero_per_K_k / dummy_per_K) r_dummy. Only the difference of temperature
// between dummy and channel, and the difference of their coefficients, remain in the standard deviation.
//
// A declared range has a standard deviation, too, by default kUnstated_K: no temperature is known exactly.
//
// A calibration without such data may belong to a model whose zero is known to follow temperature (TemperatureEffect). The
// standard deviation then includes the change over the declared range, by default over kRoom_K, and of the declared
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
// Declared knowledge without a number: a thermostat, or two places of one sensor.
inline constexpr double kUnstated_K = 0.5;

// Known coefficients of a model's material: the influence of temperature on zeros and gains of its channels.
struct TemperatureEffect {
    std::string_view name;          // the model
    double zero_per_K = 0;          // in `channel_unit`, or relative to the zero
    std::string_view channel_unit;  // "" = relative to the zero of the channel, in any unit
    double gain_per_K = 0;          // magnitude, relative to the gain
    std::string_view dummy = {};    // the channel of an unloaded gauge, if the model may have one; "" = none
    double mismatch = 0;            // standard deviation of zero_per_K between the gauges of one sensor, relative
    Registry<TemperatureEffect> in_list{this};
};

// Returns the known effect of the model, nullptr if there is none. setup
const TemperatureEffect* temperature_effect(std::string_view model) noexcept;
// Returns the effect of the calibration's model if the calibration has no temperature data; nullptr if there is none. setup
const TemperatureEffect* temperature_effect(const Calibration& calibration) noexcept;

// Wraps the decoupler of `make`; returns it unchanged if neither the calibration nor its model has an effect of temperature.
// `make` creates a decoupler for channels at the reference temperature. It is called again whenever the effect is examined,
// because the running decoupler must not process these readings. setup
using MakeDecoupler = std::function<std::unique_ptr<Decoupler>()>;
std::unique_ptr<Decoupler> with_temperature(const Calibration& calibration, MakeDecoupler make);

// Returns the reading at the reference temperature. rt: wait-free
double at_reference(const Temperature& temperature, std::size_t k, double reading, double temperature_C) noexcept;

// Returns the fault of the calibration's temperature data, "" if there is none. setup
std::string fault_of_temperature(const Calibration& calibration);

}  // namespace tactiled
