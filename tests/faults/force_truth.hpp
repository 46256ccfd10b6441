// What force_S_N must be beside the raw force, of one sensor: less the zero of its last tare, and low-passed where that is
// on.
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <string>

#include "device.hpp"
#include "tactiled/layout.h"

namespace tactiled::faults {

class ForceTruth {
public:
    // `limit_N`: the sensor's tare_limit_N.
    explicit ForceTruth(unsigned sensor, double limit_N) : sensor_(sensor), limit_N_(limit_N) {}

    // The pipeline has taken the command.
    void tare_begins(std::uint64_t now_ns) noexcept;
    // Nothing is known of what was published meanwhile: another daemon, or records that this reader could not get.
    void missed(bool another_daemon) noexcept;
    // A record with a value, which is that of what was measured under its number; "" or what is wrong with its force.
    [[nodiscard]] std::string judge(const tactiled_sample& s, bool is_measured);
    // A record without one.
    void gap() noexcept { window_.clear(); }

    std::uint64_t tares = 0;  // that came to their end

private:
    [[nodiscard]] std::string new_zero(const tactiled_sample& s);
    [[nodiscard]] std::string low_passed(const tactiled_sample& s);

    unsigned sensor_;
    double limit_N_;
    bool missed_ = false;                               // records, since the last command: a new zero may be any
    std::uint32_t count_ = 0, epoch_ = 0, before_ = 0;  // of the record before: count, epoch, quality
    std::array<double, kChannels> zero_N_{};
    // Of the tare that is measured: raw forces and, without their noise, how far they moved.
    std::uint64_t begin_ns_ = 0;  // 0 = none, or not known
    unsigned samples_ = 0;
    bool measured_ = true;  // all of them
    std::array<double, kChannels> sum_N_{};
    std::array<int, kChannels> min_{}, max_{};
    struct Past {
        std::uint64_t t_ns;
        std::array<double, kChannels> force_N;
    };
    std::deque<Past> window_;
};

}  // namespace tactiled::faults
