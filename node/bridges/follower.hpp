// Follows all sensors of one node, across restarts of its daemon: every sample once, and one BAD sample at the daemon's end.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <utility>

#include "tactiled/reader.hpp"

namespace tactiled::bridges {

class Follower {
public:
    explicit Follower(std::string node_name) : node_name_(std::move(node_name)) {}
    ~Follower();
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;

    // Finds out whether the daemon lives; attaches where there is a new one. Call it before each round of next().
    // rt: never blocks
    void look();
    // The sample after the last one that it gave of this sensor, judged now. False: none is left. A new daemon's samples
    // begin with its first; where it is the first daemon of this object, with its newest.
    // rt: never blocks
    bool next(std::uint32_t sensor, tactiled_sample& sample);
    // Sleeps until something may be new, until `until_ns` (CLOCK_MONOTONIC) at the latest. `spacing_ns` after it last
    // returned at the earliest, so that many sensors cause no more wake-ups than one.
    void wait(std::uint64_t until_ns, std::uint64_t spacing_ns = kSpacingNs);

    [[nodiscard]] bool is_alive() const { return alive_; }
    [[nodiscard]] const std::string& why() const { return why_; }  // for a person, where it is not alive
    // Another number: another daemon, or the daemon has reloaded its configuration.
    [[nodiscard]] std::uint64_t structure() const { return structure_; }
    // Samples that were overwritten before next() came.
    [[nodiscard]] std::uint64_t missed() const { return missed_; }
    [[nodiscard]] const Segment& segment() const { return segment_; }
    [[nodiscard]] std::uint32_t n_sensors() const { return segment_.is_open() ? segment_.n_sensors() : 0; }
    [[nodiscard]] const tactiled_node& node() const { return node_; }  // the newest record; only where is_alive()
    // No device measures a value of this node, or not each one: a link is simulated or replayed.
    [[nodiscard]] bool is_simulated() const { return (node_.status & TACTILED_SIMULATED) != 0; }

    // 0.5 ms: at 1 kHz one sensor is seen at once, and 16 sensors cost 2,000 wake-ups a second instead of 16,000.
    static constexpr std::uint64_t kSpacingNs = 500'000;

private:
    void attach(std::uint64_t now_ns);
    void ask_for_wakes(std::uint64_t now_ns, std::uint64_t until_ns);
    void forget_wakes();

    std::string node_name_, why_ = "not looked yet";
    std::string unreadable_;  // why the segment of a successor cannot be opened, such as that of a newer layout
    Segment segment_;
    bool alive_ = false;
    std::uint64_t structure_ = 0, missed_ = 0, tried_ns_ = 0, woke_ns_ = 0, asked_ns_ = 0;
    std::uint32_t reloads_ = 0, seen_ = 0;
    std::array<tactiled_cursor, TACTILED_MAX_SENSORS> cursor_{};
    std::array<tactiled_sample, TACTILED_MAX_SENSORS> last_{};
    std::array<bool, TACTILED_MAX_SENSORS> owes_end_{};  // samples were given, and the daemon's end was not
    tactiled_node node_{};
    std::uint32_t* wake_ = nullptr;  // struct tactiled_wake
};

}  // namespace tactiled::bridges
