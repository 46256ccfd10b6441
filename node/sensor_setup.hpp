// The parts of a sensor that its settings and its calibration determine, without a link: for the daemon and for
// `tactilectl decouple`.
#pragma once
#include "config/calibration.hpp"
#include "config/config.hpp"
#include "node/sensor.hpp"

namespace tactiled {

// Returns the ageing of a calibration's zero. A rate that calibrate has not seen is the standard deviation of the force in
// each hour. A zero is old when it is the main error of the force, and one that counts.
ZeroError::Rates zero_rates(const Calibration& calibration);

// Assigns the channels of a frame to those of the calibration. Faults go to the options of `settings`. setup
void put_channels(SensorSettings& settings, const Calibration& calibration, Sensor::Setup& setup);
// Sets all else but the tuning; `setup` has its decoupler. Faults go to the options of `settings`. setup
void put_measuring(SensorSettings& settings, const Calibration& calibration, Sensor::Setup& setup);

}  // namespace tactiled
