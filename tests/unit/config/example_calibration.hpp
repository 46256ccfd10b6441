// A calibration with all kinds of numbers and texts that a file may have.
#pragma once
#include <cmath>

#include "config/calibration.hpp"

namespace tactiled::test {

inline Calibration example() {
    Calibration c;
    c.model = "generic";
    c.method = "matrix";
    c.contact_model = "uniform";
    c.serial = "S-0007";
    c.date = "2026-03-01";
    c.channels = {"c1", "c2", "c3"};
    c.channel_unit = "dR/R0";
    c.zero = {0.1, -2.5e-7, 3};
    c.channel_least = {-1, -1, -1};
    c.channel_most = {1, 2, 1e3};
    c.components = {"fx", "fz"};
    c.matrix = {{1.0 / 3, -0.0, 5e-324}, {1e300, -1e300, std::nextafter(1.0, 2.0)}};
    c.parameters = {{"noise", 1e-6}, {"tangential_inner", 0.25}};
    c.zero_drift = {0.01, 0, 1.0 / 3};
    c.sd = {0.01, 0.02};
    c.held_out_rms = {0.2, 1e-9};
    c.full_scale = {10, 20.5};
    c.condition = 12.75;
    c.validation = "leave one session out (2 sessions), \"as is\" \\ \t gr\xc3\xbc\xc3\x9f\n";
    c.rows = 1234;
    return c;
}

}  // namespace tactiled::test
