// Method "auto" of a sensor as text and numbers: its methods, the present one and the reason.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// Return "" and null if the sensor's method is not "auto".
std::string auto_lines(const Segment& segment, std::uint32_t sensor, const tactiled_sample& newest);
nlohmann::json auto_json(const Segment& segment, std::uint32_t sensor, const tactiled_sample& newest);

}  // namespace tactiled::ctl
