// Texts of tactiled-mqtt, without I/O. mqtt.schema.json describes them; a value that is not known is null.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "node/bridges/bridge.hpp"

namespace tactiled::bridges::mqtt {

struct Topics {
    std::string prefix = "tactiled", node;
    [[nodiscard]] std::string state() const { return prefix + "/" + node + "/state"; }
    [[nodiscard]] std::string grasp() const { return prefix + "/" + node + "/grasp"; }
    [[nodiscard]] std::string of(const std::string& sensor, const char* what) const {
        return prefix + "/" + node + "/" + sensor + "/" + what;
    }
};

// The samples of one sensor since its last message: the newest, how many there were, and how many of them were BAD.
struct Batch {
    tactiled_sample newest{};
    std::uint32_t samples = 0, bad = 0;
};

std::string wrench_text(const Batch& batch);
std::string quality_text(const tactiled_sample& sample);
std::string grasp_text(const tactiled_grasp& grasp);
std::string state_text(const Follower& follower, const Counts& counts);
std::string last_will_text();
// Messages by which Home Assistant finds the components of a sensor: topic and text.
std::vector<std::pair<std::string, std::string>> discovery(const std::string& root, const Topics& topics,
                                                           const tactiled_sensor& sensor);

// Says which samples differ from the last one that it said so of.
class Deadband {
public:
    Deadband(double force_N, double torque_Nm, double refresh_s)
        : force_N_(force_N), torque_Nm_(torque_Nm), refresh_ns_(std::uint64_t(refresh_s * 1e9)) {}
    // `now_ns`: CLOCK_MONOTONIC. True for another quality, a component that moved by the deadband, and after refresh_s.
    bool passes(const tactiled_sample& sample, std::uint64_t now_ns);

private:
    double force_N_, torque_Nm_;
    std::uint64_t refresh_ns_, last_ns_ = 0;
    std::uint32_t quality_ = ~0u;
    std::array<double, 6> last_{};
};

}  // namespace tactiled::bridges::mqtt
