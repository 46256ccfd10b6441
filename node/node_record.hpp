// The node record: status, latched faults, warnings, heartbeat, counts, acknowledged commands and the grasp of the
// node.
#pragma once
#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "node/link.hpp"
#include "node/sensor.hpp"
#include "node/shm/writer.hpp"
#include "node/tares.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class NodeRecord {
public:
    static constexpr std::uint64_t kIdleNs = 100'000'000;  // longest time between two records while no sensor delivers

    // `status` holds bits that never change while the daemon runs: SIMULATED. setup
    NodeRecord(const std::vector<std::unique_ptr<Link>>& links, const std::vector<Sensor>& sensors, SegmentWriter& segment,
               std::uint32_t status)
        : links_(links), sensors_(sensors), segment_(segment), fixed_status_(status) {}
    // Adds bits to `status`. Before the loop only.
    void add_status(std::uint32_t bits) noexcept { fixed_status_ |= bits; }
    // Sets the time without its cause after which a latched fault is cleared; 0 = never. Before the loop only.
    void clear_faults_after(std::uint64_t absent_ns) noexcept { clear_after_ns_ = absent_ns; }
    // Starts heartbeat and statistics at `now_ns`. setup
    void start(std::uint64_t now_ns) noexcept { heartbeat_ns_ = worst_since_ns_ = now_ns; }

    // Takes a published sample of sensor `index`: counts it and latches the faults of its reasons. rt: wait-free
    void add(std::uint32_t index, const tactiled_sample& sample) noexcept {
        node_.count[index] = sample.sequence + 1;
        has_news_ = true;
        if (sample.reasons != 0) latch_faults_of(sample.reasons);
    }
    // Latches the fault of a stream that had delivered and has a discontinuity. rt: wait-free
    void latch_lost_sensor(bool link_is_connected) noexcept {
        latch(TACTILED_FAULT_SENSOR_LOST | (link_is_connected ? 0u : std::uint32_t(TACTILED_FAULT_BUS)));
    }
    // rt: wait-free
    void clear_faults() noexcept { node_.fault = 0; }

    // rt: wait-free
    void acknowledge(std::size_t commander, const tactiled_command& command) noexcept {
        node_.command[commander] = command;
        has_news_ = true;
    }
    // Returns the number of the last acknowledged command of `commander`.
    [[nodiscard]] std::uint32_t acknowledged(std::size_t commander) const noexcept {
        return node_.command[commander].acknowledged;
    }

    // Advances the heartbeat when it is due and a sensor delivers. rt: bounded by the number of sensors
    void beat(std::uint64_t now_ns) noexcept;
    // Takes the duration of a cycle and the number of periods that were missed before it. rt: wait-free
    void account(std::uint64_t cycle_ns, std::uint64_t missed) noexcept;
    // Shows or hides the warning that the last reload was refused. rt: wait-free; from any thread
    void set_reload_refused(bool refused) noexcept { reload_refused_.store(refused, std::memory_order_relaxed); }

    // Returns true if something has changed since the last record, or the next one is due. rt: bounded by the number of
    // sensors
    [[nodiscard]] bool is_due(std::uint64_t now_ns) const noexcept;
    // Returns the time of the next record or heartbeat if nothing changes until then. rt: bounded by the number of sensors
    [[nodiscard]] std::uint64_t deadline_ns() const noexcept;
    // rt: bounded by the number of sensors and links
    void publish(std::uint64_t now_ns, const Tares& tares, const tactiled_grasp& grasp, const tactiled_tool& tool,
                 bool hints_expired) noexcept;

    // Returns true if a sensor delivers. rt: bounded by the number of sensors
    [[nodiscard]] bool is_delivering() const noexcept;

private:
    [[nodiscard]] std::uint64_t interval_ns() const noexcept;  // longest time between two records
    void latch(std::uint32_t faults) noexcept {
        node_.fault |= faults;
        seen_ |= faults;
    }
    void latch_faults_of(std::uint32_t reasons) noexcept;
    [[nodiscard]] std::uint32_t lasting_faults(const Tares& tares) const noexcept;
    void follow_faults(std::uint64_t now_ns, const Tares& tares) noexcept;
    [[nodiscard]] std::uint32_t warnings(std::uint64_t now_ns, const Tares& tares, std::uint32_t reasons,
                                         std::uint32_t states) const noexcept;

    const std::vector<std::unique_ptr<Link>>& links_;
    const std::vector<Sensor>& sensors_;
    SegmentWriter& segment_;
    std::uint32_t fixed_status_;
    std::atomic<bool> reload_refused_{false};

    tactiled_node node_{};
    bool has_news_ = false;  // since the last record
    static constexpr std::size_t kFaults = 16;
    std::uint64_t clear_after_ns_ = 0;
    std::uint32_t seen_ = 0;                             // faults whose cause was present since the last record
    std::array<std::uint64_t, kFaults> last_seen_ns_{};  // time of the cause of each fault
    std::uint64_t heartbeat_ns_ = 0, lost_until_ns_ = 0;
    std::uint32_t lost_seen_ = 0, refused_seen_ = 0;  // number of lost and of refused frames at the last record
    std::uint64_t worst_since_ns_ = 0;
    std::uint32_t worst_ns_ = 0;
};

}  // namespace tactiled
