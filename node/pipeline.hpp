// The data path of the daemon: acquire() is link -> frame -> ring, deliver() is ring -> decouple -> grasp -> publish.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/driver.hpp"
#include "node/command.hpp"
#include "node/grasping.hpp"
#include "node/ring.hpp"
#include "node/sensor.hpp"
#include "node/shm/writer.hpp"

namespace tactiled {

// One link: its driver, and the ring through which its thread hands frames to the pipeline's.
struct Link {
    static constexpr std::size_t kRingFrames = 256;  // 60 ms at 4 kHz, 0.25 s at 1 kHz

    std::string name;
    std::uint32_t index = 0;  // in the segment's directory
    std::unique_ptr<Driver> driver;
    Ring<Frame> ring{kRingFrames};
    std::atomic<bool> connected{false};       // written by the link's thread
    std::atomic<std::uint32_t> ring_full{0};  // so many frames were refused; written by the link's thread

    struct Binding {  // device of this link -> sensor of the node
        std::uint16_t device;
        std::uint16_t sensor;
    };
    std::vector<Binding> bindings;
    // The pipeline's own: what it last saw of the two, and the frames that belong to no sensor.
    bool was_connected = false;
    std::uint32_t ring_full_seen = 0;
    std::uint32_t unbound = 0;
    std::uint64_t delivered = 0;  // frames, bound or not

    // The link thread's own: frames refused because the ring was full, not yet told to the pipeline.
    struct Refused {
        std::uint16_t device = 0;
        std::uint32_t frames = 0;
    };
    std::array<Refused, TACTILED_MAX_SENSORS> refused{};
    Frame spare;  // where a frame goes that the ring refuses
};

// One turn of a link's thread: reads at most one frame into the ring. False when the device is gone.
// rt: blocks on the link, for at most `timeout_ms`
[[nodiscard]] bool acquire(Link& link, SegmentWriter& segment, int timeout_ms) noexcept;

// What a reload of the configuration changes; made and destroyed outside of the loop.
struct Replacement {
    struct Part {
        std::uint32_t index;  // of the sensor
        bool measures_alike;  // the running one is only retuned
        std::unique_ptr<Sensor> sensor;
        tactiled_sensor entry;  // of the directory
    };
    std::vector<Part> sensors;
    std::unique_ptr<Grasping> grasping;  // nullptr: stays
    std::uint32_t calibration_id = 0;
};

class Pipeline {
public:
    // `status` holds bits that never change while the daemon runs: SIMULATED. setup
    Pipeline(std::vector<std::unique_ptr<Link>>& links, std::vector<Sensor>& sensors, SegmentWriter& segment,
             std::uint32_t status, const std::optional<Grasping::Setup>& grasp = {});

    // Publishes one BAD sample a sensor, so that a reader finds a reason, not an empty ring. setup
    void start(std::uint64_t now_ns) noexcept;

    // One turn: commands, all frames that wait, breaks, heartbeat, and a node record if anything is new: then true.
    // rt: bounded by the rings' capacity; no system call
    bool deliver(std::uint64_t now_ns) noexcept;

    // After a turn: how long it took and how many periods were slept through before it. rt: wait-free
    void account(std::uint64_t cycle_ns, std::uint64_t missed) noexcept;

    // Publishes BAD everywhere: nothing else follows. setup
    void stop(std::uint64_t now_ns) noexcept;

    // Bits that set-up learnt after the pipeline was made: RT_DEGRADED. Before the loop only.
    void add_status(std::uint32_t bits) noexcept { fixed_status_ |= bits; }

    // Puts the parts of `replacement` into the place of the running ones, between two turns; it holds the old ones then.
    // False where the loop did not come round within `patience_ms`: nothing was replaced. setup: while the loop runs
    bool replace(Replacement& replacement, int patience_ms) noexcept;
    // Whether the last wish to reload the configuration was refused: shown as a warning until the next. rt: wait-free
    void reload_refused(bool refused) noexcept { reload_refused_.store(refused, std::memory_order_relaxed); }

    // One ring a commander (enum tactiled_commander), each from one other thread: a ring has one producer.
    std::array<Ring<Command>, TACTILED_COMMANDERS> commands{Ring<Command>{16}, Ring<Command>{16}};

private:
    void deliver(Link& link, const Frame& frame, std::uint64_t now_ns) noexcept;
    void take(Replacement& replacement, std::uint64_t now_ns) noexcept;
    void publish(std::uint32_t index, const tactiled_sample& sample) noexcept;
    void publish_discontinuity(std::uint32_t index, const tactiled_sample& marker) noexcept;
    void carry_out(std::size_t commander, const Command& command, std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool begin_tares(const Command& command, std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool all_have_values(std::uint32_t mask) const noexcept;
    void follow_tares(std::uint64_t now_ns) noexcept;
    void mark_discontinuities(std::uint64_t now_ns) noexcept;
    void publish_node(std::uint64_t now_ns) noexcept;
    void finish_command(std::size_t commander, tactiled_command_state state, tactiled_command_result result) noexcept;

    std::vector<std::unique_ptr<Link>>& links_;
    std::vector<Sensor>& sensors_;
    SegmentWriter& segment_;
    std::vector<Link*> link_of_sensor_;
    std::unique_ptr<Grasping> grasping_;
    std::atomic<Replacement*> replacement_{nullptr};  // offered, not yet taken
    std::atomic<bool> taken_{false}, reload_refused_{false};

    tactiled_node node_{};
    std::uint32_t fixed_status_;
    bool news_ = false;  // something was published since the last node record
    std::uint64_t last_node_ns_ = 0, heartbeat_ns_ = 0, lost_until_ns_ = 0, worst_since_ns_ = 0;
    std::uint32_t worst_ns_ = 0;
    std::uint32_t taring_ = 0;        // mask
    std::size_t tare_commander_ = 0;  // who began it
    std::uint32_t tare_number_ = 0;
    tactiled_command_result tare_result_ = TACTILED_COMMAND_OK;  // of the last one, so far
    bool has_new_zero_ = false;                                  // of the last one: a sensor of it
    std::uint32_t lost_seen_ = 0;
};

}  // namespace tactiled
