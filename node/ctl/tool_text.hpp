// The wrench on the gripper for people and programs.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

std::string tool_why_text(std::uint32_t why);  // "gravity tare"; "" for none
// One line of at most 80 columns, two where it has no value; nothing where there is no [tool].
std::string tool_lines(const tactiled_tool& tool);
nlohmann::json tool_json(const Segment& segment, const tactiled_tool& tool);

}  // namespace tactiled::ctl
