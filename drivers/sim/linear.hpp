// The steps between the effects: when, what the world does, what the material and the transducer make of it to first order.
#pragma once
#include <memory>

#include "drivers/sim/effect.hpp"
#include "drivers/sim/motion.hpp"

namespace tactiled::sim {

// Before Stage::time: the instants of the samples. setup
std::unique_ptr<Effect> make_clock(double rate_Hz);
// Before Stage::contact: the world. setup
std::unique_ptr<Effect> make_world(const Motion& motion, const Sensor& sensor);
// Before Stage::material: drive = load. setup
std::unique_ptr<Effect> make_drive();
// Before Stage::transducer: channel = zero + gain * drive. setup
std::unique_ptr<Effect> make_gauges(const Sensor& sensor);

}  // namespace tactiled::sim
