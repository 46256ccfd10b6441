// Makes links, sensors and the plan of the segment from a configuration file. The daemon and `tactilectl check` use the same
// code, so that the daemon starts with every configuration that check accepts.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "config/config.hpp"
#include "node/pipeline.hpp"
#include "node/shm/writer.hpp"
#include "node/zero_store.hpp"

namespace tactiled {

struct Node {
    Config config;
    std::vector<std::string> calibrations;  // the text of each sensor's calibration, with those of its taxels
    std::vector<std::string> taxel_files;   // paths of the latter
    std::vector<ZeroOwner> zeros;           // the owner of each sensor's zero
    std::vector<std::unique_ptr<Link>> links;
    std::vector<Sensor> sensors;  // in the order of the file, of the segment and of the register map
    std::optional<Grasping::Setup> grasp;
    std::optional<tool::Setup> tool;
    SegmentPlan plan;
    bool simulated = false;  // a link has simulated data
};

// Reads the configuration, every driver's and model's keys and every calibration. All errors go to `problems`; with
// any error, the result must not be run. `costs_folder`: see method_costs.hpp. setup: never throws for bad input
Node load_node(const std::string& config_path, Problems& problems, const std::string& costs_folder = "");

}  // namespace tactiled
