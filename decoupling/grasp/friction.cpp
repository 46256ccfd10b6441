#include "decoupling/grasp/friction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tactiled::grasp {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kOneSlip =
    0.05;                      // relative sd of a coefficient from one slip: 3 % for each force, and the speed of loading
constexpr int kMaxSlips = 10;  // weight of the mean, in slips, as surfaces change

}  // namespace

void Friction::begin() noexcept {
    coefficient_ = configured_ > 0 ? configured_ : kNaN;
    squares_ = 0;
    slips_ = 0;
}

void Friction::held(double ratio) noexcept {
    if (coefficient_ < ratio) coefficient_ = ratio;  // false for NaN, so that a lower bound does not become the coefficient
}

void Friction::slipped(double ratio) noexcept {
    slips_ = std::min(slips_ + 1, kMaxSlips);
    if (slips_ == 1) {
        coefficient_ = ratio;
        squares_ = 0;
        return;
    }
    const double off = ratio - coefficient_;
    coefficient_ += off / slips_;
    squares_ += (off * off - squares_) / slips_;
}

double Friction::sd() const noexcept {
    if (slips_ == 0) return kNaN;
    const double one = kOneSlip * coefficient_;
    return std::sqrt((one * one + squares_) / slips_);
}

double Friction::use(double shear_N, double press_N) const noexcept {
    if (!(coefficient_ > 0)) return kNaN;
    return shear_N / std::max(coefficient_ * press_N, 1e-12);
}

}  // namespace tactiled::grasp
