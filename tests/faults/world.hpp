// The daemon without its threads and sockets, in one thread, on a simulated clock, reproducible to the last bit by a
// seed. Its configuration, links, decoders, rings, sensors, pipeline, segment and register server are the product's;
// devices and cables are those of device.hpp; the cycles of the links and the pipeline are interleaved at random.
#pragma once
#include <array>
#include <functional>
#include <memory>
#include <string>

#include "device.hpp"
#include "node/pipeline.hpp"
#include "node/reload.hpp"
#include "node/setup.hpp"
#include "witness.hpp"

namespace tactiled::faults {

// The place of a planted bug: it changes data between the daemon's parts.
struct Plant {
    std::string name;
    Finding found_as;
    // A sample in shared memory right after it was published, and the one before it.
    std::function<void(tactiled_sample&, const tactiled_sample&)> sample = nullptr;
    std::function<void(tactiled_node&)> node = nullptr;
    std::function<void(Node&)> setup = nullptr;  // before the daemon runs
    std::array<std::string, 2> configuration{};  // the first text is replaced by the second
    bool discontinuity_is_hidden = false;        // the link's thread does not report that its device has disconnected
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

    // Allows the sensors of `mask` not to be GOOD until then.
    void suffer(unsigned mask, std::uint64_t until_ns);
    void unplug(unsigned link);
    void plug(unsigned link);
    void stall_pipeline(std::uint64_t ms);
    void stop_process(std::uint64_t ms);  // SIGSTOP, and SIGCONT after that
    void kill();                          // the process ends, its file remains
    void stop();                          // SIGTERM
    void restart();                       // another process takes over
    // SIGHUP after a change of the file: another low pass and tare time; another calibration; an invalid one.
    void retune();
    void recalibrate();
    void reload_broken();

    bool tares = false;  // the jaws are tared at random moments

private:
    struct LinkThread {
        bool open = false;
        std::uint64_t retry_ns = 0, pause_ms = 50, opened_ns = 0;
        std::uint32_t frames_at_open = 0;
    };
    static constexpr std::uint64_t kReportMs = 20;  // a node record comes each 10 ms
    // Changes of the configuration.
    struct Knobs {
        double filter_Hz = 25;
        int tare_ms = 40;
        bool second_calibration = false;
        [[nodiscard]] double gain_N() const { return (second_calibration ? 2 : 1) * kN_per_count; }
        bool operator==(const Knobs&) const = default;
    };
    std::string write_configuration() const;  // its path
    void reload();
    [[nodiscard]] std::array<Device*, kSensors> devices();
    void tare_at_random();
    [[nodiscard]] tactiled_node latest_node() const;
    void start();
    void take_cables_back();
    void run_link_cycle(unsigned link);
    void close_link(unsigned link);
    void run_pipeline_cycle();
    void plant_samples();

    Random random_;
    const Plant* plant_;
    std::string name_;
    Findings findings_;
    std::array<std::unique_ptr<Driver>, kLinks> unused_;  // the cables while no daemon runs
    std::array<Cable*, kLinks> cables_{};
    std::array<std::unique_ptr<Device>, kSensors> devices_;
    std::unique_ptr<Node> node_;
    std::unique_ptr<SegmentWriter> segment_;
    Segment seen_;  // the same for a reader
    std::unique_ptr<Pipeline> pipeline_;
    std::unique_ptr<Reloader> reloader_;
    std::unique_ptr<Witness> witness_;
    Knobs knobs_, in_force_;
    std::uint32_t command_ = 0, asked_ = 0;                // number and mask of the requested tare
    bool refused_ = false;                                 // result of the last reload
    std::uint64_t started_ns_ = 0, reported_from_ns_ = 0;  // its result is reported by then
    CommandRing plc_{16};
    std::array<LinkThread, kLinks> threads_{};
    std::array<std::uint64_t, kSensors> suffers_until_ns_{}, disconnected_since_ns_{};
    std::uint64_t stopped_until_ns_ = 0, stalled_until_ns_ = 0, next_cycle_ns_ = 0, turns_ = 0;
    char* map_ = nullptr;  // for planted bugs only
    std::size_t map_size_ = 0;
    std::array<std::uint32_t, kSensors> planted_{};
    std::array<tactiled_sample, kSensors> before_{};
};

}  // namespace tactiled::faults
