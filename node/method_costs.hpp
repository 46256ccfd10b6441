// Computing times of the methods of a calibration, stored between starts of the daemon. They are measured once per CPU,
// build and calibration.
#pragma once
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/auto_method.hpp"

namespace tactiled {

// Returns the folder for the files: $STATE_DIRECTORY (of systemd), else $XDG_CACHE_HOME/tactiled, else
// ~/.cache/tactiled, else "" = nowhere.
std::string method_costs_folder();

class MethodCostFile {
public:
    // The times for one sensor; with folder "" there is no file.
    MethodCostFile(const std::string& folder, const std::string& node, const std::string& sensor,
                   const Calibration& calibration);
    // Returns nothing if there is no file for this CPU, build and calibration. A damaged file is reported in the log
    // and not used. setup
    [[nodiscard]] std::vector<MethodCost> load() const;
    // Stores the times. A failure is reported in the log, and the next start measures again. setup
    void save(const std::vector<MethodCost>& costs) const;

private:
    std::string folder_, path_, key_;
};

}  // namespace tactiled
