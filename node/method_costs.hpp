// Times of the methods of a calibration on this machine, kept between starts of the daemon: measured once a CPU, build and
// calibration.
#pragma once
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/auto_method.hpp"

namespace tactiled {

// The folder in which they are kept: $STATE_DIRECTORY (of systemd), else $XDG_CACHE_HOME/tactiled, else ~/.cache/tactiled,
// else "" = nowhere.
std::string method_costs_folder();

class MethodCostFile {
public:
    // The times for one sensor; with folder "" nothing is read or kept.
    MethodCostFile(const std::string& folder, const std::string& node, const std::string& sensor,
                   const Calibration& calibration);
    // None where nothing is kept for this CPU, build and calibration. A damaged file is reported in the log and not used.
    // setup
    [[nodiscard]] std::vector<MethodCost> load() const;
    // Where that is refused, it is said in the log, and the next start measures again. setup
    void save(const std::vector<MethodCost>& costs) const;

private:
    std::string folder_, path_, key_;
};

}  // namespace tactiled
