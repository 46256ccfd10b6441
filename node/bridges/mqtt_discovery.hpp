// The messages by which Home Assistant finds the entities of a node, without I/O. A value is available there only while it
// is GOOD and comes: `availability` with mode "all", and expire_after.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "node/bridges/mqtt_message.hpp"

namespace tactiled::bridges::mqtt {

using Announcements = std::vector<std::pair<std::string, std::string>>;  // topic and text

// The measured components of a sensor, and its quality. `root`: the topic below which it looks.
Announcements discovery(const std::string& root, const Topics& topics, const tactiled_sensor& sensor);
// Grasp, slips and weight if the node has a grasp, the wrench on the gripper if it has a tool, and the faults.
Announcements discovery(const std::string& root, const Topics& topics, bool has_grasp, bool has_tool);

}  // namespace tactiled::bridges::mqtt
