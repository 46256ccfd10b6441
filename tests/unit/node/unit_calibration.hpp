// A calibration whose forces are the readings c1, c2, c3 of its channels, as text.
#pragma once
#include <string>

namespace tactiled::test {

// `full_scale_N`: of fx, fy and fz.
inline std::string unit_calibration(const std::string& full_scale_N = "10.0, 10.0, 10.0") {
    return R"(format = 1
model = "generic"
method = "matrix"
contact_model = "unknown"
serial = "unit"
date = "2026-01-01"
channels = ["c1", "c2", "c3"]
channel_unit = "N"
zero = [0.0, 0.0, 0.0]
components = ["fx", "fy", "fz"]
matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
sd = [0.01, 0.01, 0.01]
full_scale = [)" +
           full_scale_N + "]\n";
}

}  // namespace tactiled::test
