// Temperature of a sensor whose calibration knows zero and gain against it: the channels are taken back to the reference
// temperature before any method and any check sees them.
//
// A temperature beyond the range of the calibration makes the estimate UNCERTAIN (TACTILED_OUTSIDE_DOMAIN). Without a
// temperature the channels are used as they are; the standard deviation then contains the change of the force over the
// range that the user has declared, and is unknown without such a range.
#pragma once
#include <memory>
#include <string>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// Without a temperature in the calibration, `inner` itself is returned. setup
std::unique_ptr<Decoupler> with_temperature(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

// The reading as it is at the reference temperature. rt: wait-free
double at_reference(const Temperature& temperature, std::size_t k, double reading, double temperature_C) noexcept;

// The fault of the calibration's temperature, "" if there is none. setup
std::string fault_of_temperature(const Calibration& calibration);

}  // namespace tactiled
