// The grasp as text and as JSON.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

const char* grip_state_text(std::uint32_t state);    // "holding"; "unknown" for an unknown state
const char* weight_state_text(std::uint32_t state);  // "stable"
std::string doubts_text(std::uint32_t doubts);       // "balance shares"; "" for none
const char* slip_state_text(std::uint32_t state);    // "incipient"

// Returns three lines, and a fourth one if the weight is in doubt, of at most 80 columns. Slips are listed by the
// sensors' names.
std::string grasp_lines(const Segment& segment, const tactiled_grasp& grasp);
nlohmann::json grasp_json(const Segment& segment, const tactiled_grasp& grasp);

}  // namespace tactiled::ctl
