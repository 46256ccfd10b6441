// Parts of every bridge's program: options, choice of sensors, messages to systemd, counters.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "node/bridges/follower.hpp"

namespace tactiled::ctl {
class Command;
}

namespace tactiled::bridges {

struct Common {
    std::string node = "gripper";
    std::vector<std::string> sensors;  // empty: all
    double rate_Hz = 0;                // messages of a sensor at most; 0: every sample
};
// Adds --version, --node, --runtime-dir, --sensor and --rate-Hz.
void add_common_options(ctl::Command app, Common& common);

// Makes a name a level of a topic, which has letters, digits and underscores and begins with no digit.
std::string topic_word(const std::string& name);
std::vector<std::string> reason_words(std::uint32_t reasons);
// Converts a time of CLOCK_MONOTONIC to seconds since 1970, by the difference of the clocks now.
double wall_s(std::uint64_t monotonic_ns);

// Lets the samples of one sensor pass: at most `rate_Hz`, and each change of quality at once.
class Pace {
public:
    explicit Pace(double rate_Hz) : period_ns_(rate_Hz > 0 ? std::uint64_t(1e9 / rate_Hz) : 0) {}
    bool passes(const tactiled_sample& sample) { return passes(sample.t_published_ns, sample.quality); }
    // `t_ns` is the time at which the value was published.
    bool passes(std::uint64_t t_ns, std::uint32_t quality);

private:
    std::uint64_t period_ns_, due_ns_ = 0;
    std::uint32_t quality_ = ~0u;
};

// Counts the messages that a bridge handed over, and those that it had to drop.
struct Counts {
    std::uint64_t sent = 0, dropped = 0;
};

// Tells systemd and the log, once a second at most, what a person may have to know.
class Report {
public:
    explicit Report(std::string program) : program_(std::move(program)) {}
    // Says that the set-up is complete.
    void ready(const std::string& text) const;
    // Logs each change of `state`, which is a text for a person such as "connected", each change of the daemon's life, and
    // losses.
    void tick(const Follower& follower, const Counts& counts, const std::string& state);
    void ended(const Follower& follower, const Counts& counts) const;

private:
    std::string program_, said_, why_;
    bool alive_ = true;
    std::uint64_t told_ns_ = 0, logged_ns_ = 0, dropped_ = 0, missed_ = 0;
};

}  // namespace tactiled::bridges
