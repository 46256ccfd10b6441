// The daemon without its threads and sockets, in one thread, on a clock of its own, replayed to the last bit by a seed:
// its configuration, links, decoders, rings, sensors, pipeline, segment and register server are the product's; devices and
// cables are device.hpp's; the turns of the links and the pipeline are interleaved at random.
#pragma once
#include <array>
#include <functional>
#include <memory>
#include <string>

#include "device.hpp"
#include "node/pipeline.hpp"
#include "node/setup.hpp"
#include "witness.hpp"

namespace tactiled::faults {

// Where a planted bug sits: it changes what the daemon's parts hand on.
struct Plant {
    std::string name;
    Finding found_as;
    // A sample in shared memory right after it was published, and the one before it.
    std::function<void(tactiled_sample&, const tactiled_sample&)> sample = nullptr;
    std::function<void(tactiled_node&)> node = nullptr;
    std::function<void(Node&)> setup = nullptr;  // before the daemon runs
    std::function<void(std::array<Device*, kSensors>&)> devices = nullptr;
    std::array<std::string, 2> configuration{};  // this text of it is replaced by that
    bool break_is_hidden = false;                // the link's thread does not tell that its device is gone
};

class World {
public:
    explicit World(std::uint64_t seed, const Plant* plant = nullptr);
    ~World();
    World(const World&) = delete;
    World& operator=(const World&) = delete;

    void run_ms(std::uint64_t ms);

    Device& device(unsigned sensor) { return *devices_[sensor]; }
    Cable& cable(unsigned link) { return *cables_[link]; }
    [[nodiscard]] bool is_running() const { return pipeline_ != nullptr; }
    static unsigned link_of(unsigned sensor) { return sensor < 2 ? sensor : 2; }
    Witness& witness() { return *witness_; }
    Findings& findings() { return findings_; }
    Random& random() { return random_; }

    // Not GOOD is no alarm for this sensor until then. "All": UINT_MAX.
    void suffer(unsigned link_or_all, std::uint64_t until_ns);
    void unplug(unsigned link);
    void plug(unsigned link);
    void stall_pipeline(std::uint64_t ms);
    void kill();     // the process is gone, its file stays
    void stop();     // SIGTERM
    void restart();  // another process takes over

private:
    struct LinkThread {
        bool open = false;
        std::uint64_t retry_ns = 0, pause_ms = 50, opened_ns = 0;
        std::uint32_t frames_at_open = 0;
    };
    void start();
    void take_cables_back();
    void turn_link(unsigned link);
    void close_link(unsigned link);
    void turn_pipeline();
    void plant_samples();

    Random random_;
    const Plant* plant_;
    std::string name_, folder_;
    Findings findings_;
    std::array<std::unique_ptr<Driver>, kLinks> unused_;  // the cables, while no daemon runs
    std::array<Cable*, kLinks> cables_{};
    std::array<std::unique_ptr<Device>, kSensors> devices_;
    std::unique_ptr<Node> node_;
    std::unique_ptr<SegmentWriter> segment_;
    std::unique_ptr<Pipeline> pipeline_;
    std::unique_ptr<Witness> witness_;
    Ring<Command> plc_{16};
    std::array<LinkThread, kLinks> threads_{};
    std::array<std::uint64_t, kSensors> suffers_until_ns_{}, gone_since_ns_{};
    std::uint64_t stalled_until_ns_ = 0, next_turn_ns_ = 0, turns_ = 0;
    char* map_ = nullptr;  // for plants alone
    std::size_t map_size_ = 0;
    std::array<std::uint32_t, kSensors> planted_{};
    std::array<tactiled_sample, kSensors> before_{};
};

}  // namespace tactiled::faults
