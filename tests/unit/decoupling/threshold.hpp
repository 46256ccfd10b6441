// The detection threshold of a hair sensor: the stress whose reading is one standard deviation of the noise.
#pragma once
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

namespace tactiled {

// Returns the threshold for the sum of sign_k r_k. `noise`: sd of each hair's dR/R0; `sensitivity`: of each hair in
// 1/Pa, to the stress in question; sign: +1, or -1 for the near hair of DIFF, whose sensitivity is negative, too.
// `correlation` of the noise between any two hairs: 0 is the ideal. Infinite if the hairs do not respond.
inline double threshold_Pa(std::span<const double> noise, std::span<const double> sensitivity, std::span<const double> sign,
                           double correlation = 0) noexcept {
    double variance = 0, signal = 0;
    for (std::size_t i = 0; i < noise.size(); ++i) {
        signal += sign[i] * sensitivity[i];
        for (std::size_t j = 0; j < noise.size(); ++j)
            variance += (i == j ? 1 : correlation) * sign[i] * noise[i] * sign[j] * noise[j];
    }
    if (signal == 0) return std::numeric_limits<double>::infinity();
    return std::sqrt(std::fmax(variance, 0)) / std::abs(signal);
}

inline double threshold_Pa(double noise, double sensitivity) noexcept {
    const double one = 1;
    return threshold_Pa({&noise, 1}, {&sensitivity, 1}, {&one, 1});
}

// Returns the threshold of the sum of n equal hairs (normal), or of the difference of a pair (shear). Ideally it is
// 1/sqrt(n) of that of one hair.
inline double sum_threshold_Pa(int n, double noise, double sensitivity, double correlation = 0) noexcept {
    return threshold_Pa(noise, sensitivity) * std::sqrt(std::fmax((1 + (n - 1) * correlation) / n, 0));
}
inline double diff_threshold_Pa(double noise, double sensitivity, double correlation = 0) noexcept {
    return threshold_Pa(noise, sensitivity) * std::sqrt(std::fmax((1 - correlation) / 2, 0));
}

}  // namespace tactiled
