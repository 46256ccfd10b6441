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
// second and of 40 differences or more. A device that is read faster than in its calibration skips readings; a slower one is
// not judged, because hum may cancel in differences over another time.
class QuietCheck {
public:
    // Takes the numbers of a frame. `usable`: bit k is set if channel k has one. Returns true from the first window on in
    // which each channel has less than the least noise: no later touch can prove that the device is the calibrated one. A
    // device that repeats all its numbers has no noise either, until they change: a gateway may have repeated them.
    // rt: bounded by the channels
    [[nodiscard]] bool judge(std::span<const double> raw, std::uint32_t usable, std::uint64_t t_ns,
                             const Tuning& tuning) noexcept {
        if (tuning.noise_interval_ns == 0) return is_quiet_ = false;
        if (is_quiet_ || t_ns < then_ns_ + tuning.noise_interval_ns / 2) return is_quiet_ || is_stuck(then_ns_);
        const bool is_late = t_ns > then_ns_ + 2 * tuning.noise_interval_ns;
        then_ns_ = t_ns;
        bool is_quiet = true, is_equal = true;
        for (std::size_t k = 0; k < raw.size(); ++k) {
            const double limit = tuning.least_noise_of[k], step = raw[k] - then_[k];
            then_[k] = raw[k];
            if (limit == 0) continue;
            const bool is_usable = (usable >> k & 1u) != 0;
            is_equal &= is_usable && step == 0;
            if (!is_late) squares_[k] += is_usable ? step * step : kLoud;
            is_quiet &= squares_[k] < limit * (double(n_) + 1);
        }
        repeats_ = is_equal ? repeats_ + 1 : 0;
        if (is_equal || is_late) return is_stuck(t_ns);
        changed_ns_ = t_ns;
        if (++n_ < kEnough || t_ns < begin_ns_ + kWindow_ns) return false;
        is_quiet_ = is_quiet;
        begin_ns_ = t_ns;
        squares_ = {};
        n_ = 0;
        return is_quiet_;
    }

private:
    // White noise has a sixteenth of its mean square in so many differences once in 10^11 windows.
    static constexpr unsigned kEnough = 40;
    static constexpr std::uint64_t kWindow_ns = 500'000'000;
    static constexpr double kLoud = std::numeric_limits<double>::infinity();

    [[nodiscard]] bool is_stuck(std::uint64_t t_ns) const noexcept {
        return repeats_ >= kEnough && t_ns >= changed_ns_ + kWindow_ns;
    }

    bool is_quiet_ = false;
    unsigned n_ = 0, repeats_ = 0;  // differences in the window; frames that equal the one before
    std::uint64_t then_ns_ = 0, begin_ns_ = 0, changed_ns_ = 0;
    std::array<double, kMaxChannels> then_{}, squares_{};
};

}  // namespace tactiled
