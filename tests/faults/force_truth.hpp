// The right value of force_S_N for the raw force of one sensor: minus the zero of its last tare, and low-passed if
// that is on.
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

    // Notes that the pipeline has taken the command.
    void tare_begins(std::uint64_t now_ns) noexcept;
    // Notes that published data are unknown: another daemon, or records that this reader missed.
    void missed(bool another_daemon) noexcept;
    // Judges a record with a value, which is that of the measurement with its number; returns "" or the error of its
    // force.
    [[nodiscard]] std::string judge(const tactiled_sample& s, bool is_measured);
    // Notes a record without a value.
    void gap() noexcept { window_.clear(); }

    std::uint64_t tares = 0;  // finished tares

private:
    [[nodiscard]] std::string new_zero(const tactiled_sample& s);
    [[nodiscard]] std::string low_passed(const tactiled_sample& s);

    unsigned sensor_;
    double limit_N_;
    // records were missed since the last command: a new zero may have any value
    bool missed_ = false;
    std::uint32_t count_ = 0, epoch_ = 0, before_ = 0;  // of the previous record: count, epoch, quality
    std::array<double, kChannels> zero_N_{};
    // State of the tare that is being measured: raw forces and, without their noise, their movement.
    std::uint64_t begin_ns_ = 0;  // 0 = none, or unknown
    unsigned samples_ = 0;
    bool measured_ = true;  // true: all of them are measured
    std::array<double, kChannels> sum_N_{};
    std::array<int, kChannels> min_{}, max_{};
    struct Past {
        std::uint64_t t_ns;
        std::array<double, kChannels> force_N;
    };
    std::deque<Past> window_;
};

}  // namespace tactiled::faults
