// Finds a device with less noise than in its calibration: a range, unit, order of bytes, register or firmware that scales
// its numbers down scales their noise as well. More noise shows nothing, because touches and vibrations add to it.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "drivers/frame.hpp"
#include "node/tuning.hpp"

namespace tactiled {

// Judges the mean square of successive differences, 2 sd^2 for white noise (J. von Neumann, 1941), in windows of half a
// second. Differences over a longer time than in the calibration are no smaller, so that a device that is read faster skips
// readings.
class QuietCheck {
public:
    // Takes the numbers of a frame. `usable`: bit k is set if channel k has one. Returns true from the first window on in
    // which each channel has less than the least noise: no later touch can prove that the device is the calibrated one. If
    // all channels repeat their numbers, returns true until they change: a gateway may have repeated them.
    // rt: bounded by the channels
    [[nodiscard]] bool judge(std::span<const double> raw, std::uint32_t usable, std::uint64_t t_ns,
                             const Tuning& tuning) noexcept {
        if (tuning.least_noise_ns == 0) return is_quiet_ = false;
        if (is_quiet_ || t_ns < then_ns_ + tuning.least_noise_ns / 2) return is_quiet_ || is_equal_;
        then_ns_ = t_ns;
        ++n_;
        bool is_quiet = true, is_equal = true;
        for (std::size_t k = 0; k < raw.size(); ++k) {
            const double step = raw[k] - then_[k], limit = tuning.least_noise_of[k];
            then_[k] = raw[k];
            if (limit == 0) continue;
            squares_[k] = (usable >> k & 1u) != 0 ? squares_[k] + step * step : kLoud;
            is_quiet &= squares_[k] < limit * double(n_);
            is_equal &= squares_[k] == 0;
        }
        if (n_ < kEnough || t_ns < begin_ns_ + kWindow_ns) return is_equal_;
        is_equal_ = is_equal;
        is_quiet_ = is_quiet && !is_equal;
        begin_ns_ = t_ns;
        squares_ = {};
        n_ = 0;
        return is_quiet_ || is_equal_;
    }

private:
    // White noise has a sixteenth of its mean square in so many differences once in 10^11 windows.
    static constexpr unsigned kEnough = 40;
    static constexpr std::uint64_t kWindow_ns = 500'000'000;
    static constexpr double kLoud = std::numeric_limits<double>::infinity();

    bool is_quiet_ = false, is_equal_ = false;
    unsigned n_ = 0;  // differences in the window
    std::uint64_t then_ns_ = 0, begin_ns_ = 0;
    std::array<double, kMaxChannels> then_{}, squares_{};
};

}  // namespace tactiled
