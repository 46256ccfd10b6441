// SIGHUP: reads the configuration and the calibrations again and applies all changes to the running node, or none.
// config/KEYS.md states which keys may change without a restart; the refusal of another change names its key. A file that
// has lost keys may be truncated; it is accepted at the second reload.
#pragma once
#include <string>
#include <vector>

#include "node/setup.hpp"

namespace tactiled {

class Reloader {
public:
    // `running` is the node at the daemon's start and must outlive this object. `zeros` receives the owners of the zeros of
    // new calibrations. setup
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
    std::vector<std::string> announced_;  // lost keys that the last reload has reported
};

}  // namespace tactiled
