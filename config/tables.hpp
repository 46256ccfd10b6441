// Parts of load_config() that have a file of their own. Inside of config/ only.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"

namespace tactiled {

// [grasp], checked against the sensors; nothing where the file has none. setup: never throws for bad input
std::optional<GraspSettings> read_grasp(Options& root, const std::string& node_name,
                                        const std::vector<SensorSettings>& sensors, const std::string& folder);

// [gpio]; nothing where the file has none. setup: never throws for bad input
std::optional<GpioSettings> read_gpio(Options& root);

}  // namespace tactiled
