// The data path of the daemon, from a link's bytes to shared memory. node/README.md walks one sample through it.
//
//     link's thread      acquire()   driver -> Frame -> ring of the link
//     pipeline's thread  deliver()   ring -> Sensor: Reading -> Decoupler -> Estimate -> tactiled_sample
//                        publish()   tactiled_sample -> grasp, segment, counts of the node record
//
// The parts beside the data path have files of their own: commands.hpp, tares.hpp, node_record.hpp, replacement.hpp.
#pragma once
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "node/commands.hpp"
#include "node/grasping.hpp"
#include "node/link.hpp"
#include "node/node_record.hpp"
#include "node/replacement.hpp"
#include "node/sensor.hpp"
#include "node/shm/writer.hpp"

namespace tactiled {

// Reads at most one frame of the link into its ring. False when the device has disconnected. Called by the link's thread.
// rt: blocks on the link, for at most `timeout_ms`
[[nodiscard]] bool acquire(Link& link, SegmentWriter& segment, int timeout_ms) noexcept;

class Pipeline {
public:
    // `status` holds bits that never change while the daemon runs: SIMULATED. setup
    Pipeline(std::vector<std::unique_ptr<Link>>& links, std::vector<Sensor>& sensors, SegmentWriter& segment,
             std::uint32_t status, const std::optional<Grasping::Setup>& grasp = {});
    // Adds bits that set-up learnt after the pipeline was made: RT_DEGRADED. Before the loop only.
    void add_status(std::uint32_t bits) noexcept { record_.add_status(bits); }

    // Publishes one BAD sample of each sensor, so that a reader finds a reason, not an empty ring. setup
    void start(std::uint64_t now_ns) noexcept;
    // One iteration of the loop: a reload, commands, the frames of all links, time limits, tares, heartbeat, node record.
    // True when a node record was published. rt: bounded by the capacity of the rings; no system call
    bool cycle(std::uint64_t now_ns) noexcept;
    // The time that the last cycle took, and the number of periods that were slept through before it. rt: wait-free
    void account(std::uint64_t cycle_ns, std::uint64_t missed) noexcept { record_.account(cycle_ns, missed); }
    // Publishes one last BAD sample of each sensor. After the loop. setup
    void stop(std::uint64_t now_ns) noexcept;

    // Exchanges the parts of `replacement` with the running ones, between two cycles. Returns false, and nothing was
    // exchanged, when the loop did not respond within `patience_ms`. setup: while the loop runs, from another thread
    bool replace(Replacement& replacement, int patience_ms) noexcept;
    // Shows or hides the warning that the last reload was refused. rt: wait-free; from any thread
    void reload_refused(bool refused) noexcept { record_.set_reload_refused(refused); }

    Commands commands;

private:
    void deliver(Link& link, std::uint64_t now_ns) noexcept;
    void deliver(Link& link, const Frame& frame, std::uint64_t now_ns) noexcept;
    void publish(std::uint32_t sensor, const tactiled_sample& sample) noexcept;
    void publish_node(std::uint64_t now_ns) noexcept;
    void mark_discontinuities(std::uint64_t now_ns) noexcept;
    void take_replacement(std::uint64_t now_ns) noexcept;
    void take(Replacement& replacement, std::uint64_t now_ns) noexcept;

    std::vector<std::unique_ptr<Link>>& links_;
    std::vector<Sensor>& sensors_;
    SegmentWriter& segment_;
    std::vector<const Link*> link_of_sensor_;
    std::unique_ptr<Grasping> grasping_;
    NodeRecord record_;
    std::atomic<Replacement*> replacement_{nullptr};  // offered and not yet taken
    std::atomic<bool> taken_{false};
};

}  // namespace tactiled
