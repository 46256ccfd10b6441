#include "node/agreement.hpp"

#include <cmath>

namespace tactiled {
namespace {

// What a sample may have and be right nevertheless.
constexpr std::uint32_t kRight = TACTILED_SENSORS_DIFFER | TACTILED_TARING | TACTILED_WRONG_RATE | TACTILED_DRIFTED |
                                 TACTILED_UNCALIBRATED | TACTILED_UNKNOWN_UNCERTAINTY;

// What shows that it was this one that lied.
constexpr std::uint32_t kCulprit = TACTILED_FROZEN | TACTILED_IDLE_BUS | TACTILED_MISSING_CHANNEL | TACTILED_SATURATED |
                                   TACTILED_DISAGREEMENT | TACTILED_NOT_FINITE | TACTILED_WRONG_DEVICE;

bool is_comparable(const tactiled_sample& s) noexcept {
    return (s.quality == TACTILED_GOOD || s.quality == TACTILED_UNCERTAIN) && (s.reasons & ~kRight) == 0;
}

}  // namespace

void Agreement::judge_by(const Limits& limits) noexcept {
    if (limits == limits_) return;
    *this = Agreement(limits);
}

bool Agreement::differs(const tactiled_sample& mine, const tactiled_sample& others) noexcept {
    if ((others.reasons & kCulprit) != 0) {
        differs_ = false;
        otherwise_since_ns_ = 0;
    }
    if (!is_comparable(mine) || !is_comparable(others)) return differs_;
    double squares = 0;  // of the components that both see
    for (std::size_t i = 0; i < 3; ++i) {
        const double apart_N = mine.force_S_N[i] - others.force_S_N[i];
        if (std::isfinite(apart_N)) squares += apart_N * apart_N;
    }
    const bool apart = squares > limits_.most_N * limits_.most_N;
    if (apart == differs_) {
        otherwise_since_ns_ = 0;
    } else if (otherwise_since_ns_ == 0) {
        otherwise_since_ns_ = mine.t_ns;
    } else if (mine.t_ns - otherwise_since_ns_ >= limits_.patience_ns) {
        differs_ = apart;
        otherwise_since_ns_ = 0;
    }
    return differs_;
}

}  // namespace tactiled
