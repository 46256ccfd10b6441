// SIGHUP: reads the configuration and the calibrations again and applies the changes to the running node, all or
// nothing. config/KEYS.md states for each key whether it may change without a restart; the refusal of another change
// names it. A file that lacks keys which it had may have been cut: it is accepted the second time.
#pragma once
#include <string>
#include <vector>

#include "node/setup.hpp"

namespace tactiled {

class Reloader {
public:
    // `running` is the node at the daemon's start, and must outlive it; `zeros` is informed of new calibrations. setup
    Reloader(const Node& running, std::string costs_folder, ZeroStore* zeros = nullptr);

    // Logs the changes, or the reason for the refusal. Takes as long as a start; the loop runs meanwhile.
    // setup: never throws; in the thread that waits for signals
    void reload(Pipeline& pipeline) noexcept;

private:
    struct Accepted {  // configuration of the running node
        Options root;
        std::vector<SensorSettings> sensors;
        std::vector<std::string> calibrations;
        std::optional<Grasping::Setup> grasp;
        std::optional<tool::Setup> tool;
        std::string objects;  // path of the taught objects
        std::uint32_t calibration_id;
    };
    [[nodiscard]] static Accepted accepted(const Node& node);
    [[nodiscard]] std::string try_reload(Pipeline& pipeline, Problems& problems);
    void refuse_what_needs_a_restart(Node& fresh) const;
    void refuse_a_loss_once(Node& fresh);
    [[nodiscard]] bool measures_alike(const Node& fresh, std::size_t i) const;
    [[nodiscard]] Replacement difference(Node& fresh) const;

    const Node& running_;
    std::string costs_folder_;
    ZeroStore* zeros_;
    Accepted now_;
    std::vector<std::string> announced_;  // keys that the last reload would have lost
};

}  // namespace tactiled
