// The data path of the daemon, from a link's bytes to shared memory. node/README.md follows one sample through it.
//
//     link's thread  acquire()   driver -> Frame -> ring of the link
//     the runner     deliver()   ring -> Sensor: Reading -> Decoupler -> Estimate -> tactiled_sample
//                    publish()   tactiled_sample -> grasp, segment, counts of the node record
//
// The runner is the real-time thread that called serve() first: a link's thread that has frames, or the pipeline's thread,
// which serves commands and time limits. Parts beside the data path: commands.hpp, tares.hpp, node_record.hpp,
// replacement.cpp.
#pragma once
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "node/commands.hpp"
#include "node/grasping.hpp"
#include "node/handover.hpp"
#include "node/link.hpp"
#include "node/node_record.hpp"
#include "node/progress.hpp"
#include "node/runner.hpp"
#include "node/sensor.hpp"
#include "node/shm/waker.hpp"
#include "node/shm/writer.hpp"

namespace tactiled {

// Reads at most one frame of the link into its ring, and commits the ring at the end of a burst. Called by the link's
// thread. Returns `disconnected` also if the link should be opened again because the age of its frames is not proved.
// rt: blocks on the link, for at most `timeout_ms`
[[nodiscard]] Status acquire(Link& link, SegmentWriter& segment, int timeout_ms) noexcept;

// The sensors and the grasp that a reload of the configuration exchanges. They are created and destroyed outside of the
// loop.
struct Replacement {
    struct Part {
        std::uint32_t index;  // index of the sensor
        bool measures_alike;  // the running sensor stays and only takes over the settings of `sensor`
        std::unique_ptr<Sensor> sensor;
        tactiled_sensor entry;  // entry of the directory
    };
    std::vector<Part> sensors;
    std::unique_ptr<Grasping> grasping;  // nullptr: the running one stays
    std::uint32_t calibration_id = 0;
};

class Pipeline {
public:
    // `status` holds bits that never change while the daemon runs: SIMULATED. setup
    Pipeline(std::vector<std::unique_ptr<Link>>& links, std::vector<Sensor>& sensors, SegmentWriter& segment,
             std::uint32_t status, const std::optional<Grasping::Setup>& grasp = {},
             const std::optional<tool::Setup>& tool = {});
    // Sets where each node record is announced to sleeping readers, and where each cycle is counted. Before the loop
    // only.
    void announce_to(Waker* readers, Progress::Liveness* cycles) noexcept {
        readers_ = readers;
        cycles_ = cycles;
    }
    // Adds bits that set-up determined after the pipeline was made: RT_DEGRADED. Before the loop only.
    void add_status(std::uint32_t bits) noexcept { record_.add_status(bits); }

    // Sets the time without its cause after which a latched fault is cleared; 0 = never. Before the loop only.
    void clear_faults_after(std::uint64_t absent_ns) noexcept { record_.clear_faults_after(absent_ns); }

    // Publishes one BAD sample of each sensor, so that a reader finds its reason instead of an empty ring. setup
    void start(std::uint64_t now_ns) noexcept;
    // Ends the set-up, during which serve() only announces work, and does the announced work. Call it once.
    // rt: as serve()
    void open() noexcept { run(); }
    // Runs cycles until no thread has more work. If another thread is the runner, returns false, and the runner will do the
    // caller's work, too. After kMaxCycles the pipeline's thread does the remaining work. From any real-time thread. rt:
    // bounded by kMaxCycles cycles, each with the system calls of Waker::published()
    bool serve() noexcept {
        if (!runner_.enter()) return false;
        run();
        return true;
    }
    // Makes the pipeline's thread call serve(). From any thread. rt: one system call
    void wake() noexcept { wake_.wake(); }
    [[nodiscard]] WakeWord& wake_word() noexcept { return wake_; }
    // Returns the time at which serve() must be called again, for time limits and the heartbeat, if nothing arrives
    // until then.
    // rt: wait-free; from any thread
    [[nodiscard]] std::uint64_t deadline_ns() const noexcept { return deadline_ns_.load(std::memory_order_relaxed); }
    // Returns true if no sensor delivered in the last cycle. rt: wait-free; from any thread
    [[nodiscard]] bool is_idle() const noexcept { return is_idle_.load(std::memory_order_relaxed); }
    // Adds the number of periods that the pipeline's thread missed. rt: wait-free; from any thread
    void add_missed(std::uint64_t periods) noexcept { missed_.fetch_add(periods, std::memory_order_relaxed); }

    // Does one cycle of the loop: a reload, commands, the frames of all links, time limits, tares, heartbeat, node
    // record. Returns true if a node record was published. Called by the runner, and by tests. rt: bounded by the
    // capacity of the rings; no system call
    bool cycle(std::uint64_t now_ns) noexcept;
    // Publishes one last BAD sample of each sensor. After the loop. setup
    void stop(std::uint64_t now_ns) noexcept;

    // Exchanges the parts of `replacement` with the running ones, between two cycles. Returns false, without an
    // exchange, if the loop did not respond within `patience_ms`. setup: while the loop runs, from another thread
    bool replace(Replacement& replacement, int patience_ms) noexcept;
    // Shows or hides the warning that the last reload was refused. rt: wait-free; from any thread
    void reload_refused(bool refused) noexcept { record_.set_reload_refused(refused); }

private:
    WakeWord wake_;  // wakes the pipeline's thread

public:
    Commands commands;

private:
    static constexpr int kMaxCycles = 4;

    void run() noexcept;
    [[nodiscard]] std::uint64_t next_deadline_ns(std::uint64_t now_ns) const noexcept;
    void deliver(Link& link, std::uint64_t now_ns) noexcept;
    void deliver(Link& link, const Frame& frame, const Taxels& taxels, std::uint64_t now_ns) noexcept;
    void publish(std::uint32_t sensor) noexcept;
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
    Handover<Replacement> replacement_;

    Runner runner_;
    Waker* readers_ = nullptr;
    Progress::Liveness* cycles_ = nullptr;
    std::atomic<std::uint64_t> deadline_ns_{0}, missed_{0};
    std::atomic<bool> is_idle_{false};
};

}  // namespace tactiled
