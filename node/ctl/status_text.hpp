// Shared by status, top and the web page.
#pragma once
#include <nlohmann/json.hpp>

#include "node/ctl/liveness.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// Names of the counters in tactiled_link.count, by enum tactiled_link_count.
inline constexpr const char* kLinkCountNames[TACTILED_LINK_COUNTS] = {
    "bytes",     "frames",  "skipped_bytes", "bad_checksum", "bad_length", "bad_value", "lost",      "repeated",
    "ring_full", "unbound", "opened",        "open_failed",  "gone",       "overrun",   "bus_error", "restarted"};

// Returns the number right-aligned in `width` columns, "-" if it is not finite.
std::string number(double value, int width, int digits);
double age_ms(const tactiled_sample& s, std::uint64_t now_ns);
// Returns the largest part of the variance of the force, with its remedy: "largest part zero: tare it without a load"; ""
// = not known.
std::string uncertainty_text(const tactiled_placed& placed);
// Returns the largest possible age of the newest frame of sensor `i`, in ms; NaN if it is not known.
double age_bound_ms(const Segment& segment, std::uint32_t i);
// Returns the undetected damage that a sensor's calibration states, as a sentence; `channel`: name of its worst channel, ""
// = its number.
std::string damage_text(const tactiled_undetected& undetected, std::string channel = "");
nlohmann::json damage_json(const tactiled_undetected& undetected);  // null if it is unknown
// Returns "open", "closed", or "not read" if no daemon runs.
const char* link_word(const tactiled_link& link, const Liveness& liveness);
// Returns the remedies for those of the reasons that a new user meets first, one line each, after the sensor's name.
std::string remedy_lines(const std::string& name, std::uint32_t reasons);
// Returns the latched faults and the warnings of a node as text, one line each; "" if there are none.
std::string fault_lines(const tactiled_node& node);
nlohmann::json status_json(const Segment& segment, const Snapshot& snapshot);
// Returns true if the daemon runs and every sensor has a value.
bool is_healthy(const Segment& segment, const Snapshot& snapshot);

// ---- auto_text.cpp: method "auto" of a sensor, its methods, the present one and the reason ----

// Return "" and null if the sensor's method is not "auto".
std::string auto_lines(const Segment& segment, std::uint32_t sensor, const tactiled_sample& newest);
nlohmann::json auto_json(const Segment& segment, std::uint32_t sensor, const tactiled_sample& newest);

// ---- tool_text.cpp: the wrench on the gripper ----

std::string tool_why_text(std::uint32_t why);  // "gravity tare"; "" for none
// One line of at most 80 columns, two where it has no value; nothing where there is no [tool].
std::string tool_lines(const tactiled_tool& tool);
nlohmann::json tool_json(const Segment& segment, const tactiled_tool& tool);

}  // namespace tactiled::ctl
