// How long a sensor's readings lag behind the force: its converter's window, its filters, the bus.
#pragma once
#include <cstddef>

#include "config/calibration.hpp"
#include "decoupling/fit/labelled.hpp"

namespace tactiled {

struct Delay {
    double delay_s = 0;    // 0 where it is not told from 0
    double sd_s = 0;       // from leaving out each tenth of the rows
    std::size_t rows = 0;  // under a force that changes
};

// From rows in the order of time, with labels, in which the force changes at different rates. With E what the calibration
// makes of a row at t and F the label, over the components, each in its full scale:
//     E(t) = (1 + gain) F(t - delay) + width sign F'(t - delay) + zero        least squares; gain, width, zero of each
//     component
// `width` is the hysteresis: without it a loop would count as a lag. The delay is looked for in steps of a row within 1 s,
// then by Gauss and Newton. F between rows: straight lines.
// setup: throws Undetermined, with the reason, where the rows do not tell; where the labels lag behind the readings
Delay measure_delay(const Calibration& calibration, const Labelled& rows);

}  // namespace tactiled
