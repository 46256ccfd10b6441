// The part of the standard deviation due to hysteresis and a first press: after a larger load, a sensor reads a load
// differently than on the way up. With the load L, the magnitude of the tared force relative to the largest full scale, and
// its peak since the last rest, the standard deviation of a component becomes hypot(sd, sd_unloading (peak - L)).
// fit/uncertainty.cpp determines sd_unloading from loading and unloading in the calibration's rows; it is 0 if it does not
// reduce the other terms.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// The peak of the load since the last rest. Before the first rest the past is unknown, and the peak is 1.
class LoadPeak {
public:
    static constexpr double kRest = 0.02;                   // relative to full scale
    static constexpr std::uint64_t kRest_ns = 500'000'000;  // the sensor rests after this time below kRest

    // Returns peak - load, 0 .. 1. A load that is not finite has no effect. rt: wait-free
    double next(double load, std::uint64_t t_ns) noexcept {
        if (!std::isfinite(load)) return peak_;
        if (load >= kRest)
            is_low_ = false;
        else if (!is_low_ || t_ns < low_since_ns_)
            is_low_ = true, low_since_ns_ = t_ns;
        else if (t_ns - low_since_ns_ >= kRest_ns)
            peak_ = 0;
        peak_ = std::min(1.0, std::max(peak_, load));
        return std::max(0.0, peak_ - load);
    }
    void forget() noexcept { *this = {}; }  // rt: wait-free
    // Returns the peak of a sensor that has rested.
    static LoadPeak rested() {
        LoadPeak peak;
        peak.peak_ = 0;
        return peak;
    }

private:
    double peak_ = 1;
    bool is_low_ = false;
    std::uint64_t low_since_ns_ = 0;
};

// Returns the magnitude of the force, or of the moment where no force is measured, relative to the largest full scale.
// Components that are not finite are ignored. rt: wait-free
double load_of(const Wrench& wrench_S, const Calibration& calibration) noexcept;

// Adds the part of unloading to the estimates of `inner`; returns `inner` itself if sd_unloading is empty. setup
std::unique_ptr<Decoupler> with_unloading(const Calibration& calibration, std::unique_ptr<Decoupler> inner);

}  // namespace tactiled
