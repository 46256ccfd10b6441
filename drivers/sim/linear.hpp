// The steps between the effects: sample times, motion, and the first-order response of material and transducer.
#pragma once
#include <memory>

#include "drivers/sim/effect.hpp"
#include "drivers/sim/motion.hpp"

namespace tactiled::sim {

// Before Stage::time: the instants of the samples. setup
std::unique_ptr<Effect> make_clock(double rate_Hz);
// Before Stage::contact: the motion. setup
std::unique_ptr<Effect> make_world(const Motion& motion, const Sensor& sensor);
// Before Stage::material: drive = load. setup
std::unique_ptr<Effect> make_drive();
// Before Stage::transducer: channel = zero + gain * drive. setup
std::unique_ptr<Effect> make_gauges(const Sensor& sensor);

}  // namespace tactiled::sim
