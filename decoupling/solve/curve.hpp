// A quadratic curve y = b F + a F^2 and its inverse on the physical branch, which contains F = 0 with b > 0.
#pragma once
#include <algorithm>
#include <cmath>

namespace tactiled {

// Returns b^2 + 4 a y with one rounding error of the result, for any cancellation (Kahan; hard case H05).
// rt: wait-free
inline double discriminant(double a, double b, double y) noexcept {
    const double square = b * b, product = -4 * a * y, difference = square - product;
    if (3 * std::abs(difference) >= square + std::abs(product)) return difference;
    return difference + (std::fma(b, b, -square) - std::fma(-4 * a, y, -product));
}

// Returns the F nearest to 0 with b F + a F^2 = y: no difference of nearly equal numbers, and a = 0 needs no branch
// (H02, H03).
// rt: wait-free
inline double smaller_root(double a, double b, double y) noexcept {
    return 2 * y / (b + std::sqrt(std::max(0.0, discriminant(a, b, y))));
}

// The curve as measured for min .. max (N), b > 0, with straight lines beyond its ends. If the vertex -b/2a is in the
// range, the branch ends there.
class Curve {
public:
    struct Force {
        double F = 0;      // N
        double slope = 0;  // dy/dF there; 0 = y is beyond the vertex, so no force in the range has this reading
    };

    Curve() = default;
    Curve(double b, double a, double min, double max) noexcept : b_(b), a_(a), min_(min), max_(max) {
        if (2 * a * min + b < 0) min_ = -b / (2 * a);  // a > 0: min < 0 because b > 0
        if (2 * a * max + b < 0) max_ = -b / (2 * a);
    }
    [[nodiscard]] double min() const noexcept { return min_; }
    [[nodiscard]] double max() const noexcept { return max_; }
    [[nodiscard]] double b() const noexcept { return b_; }

    // rt: wait-free
    [[nodiscard]] double y(double F) const noexcept {
        const double inside = std::clamp(F, min_, max_);
        return parabola(inside) + slope(inside) * (F - inside);
    }
    // Returns the force at y. Monotone and continuous in y. rt: wait-free
    [[nodiscard]] Force inverse(double y) const noexcept {
        for (const double end : {min_, max_}) {
            const double beyond = y - parabola(end), slope_there = slope(end);
            if (end == min_ ? beyond >= 0 : beyond <= 0) continue;
            // At a vertex rounding leaves a slope of about 1e-17 b.
            if (!(slope_there > 1e-12 * b_)) return {end, 0};
            return {end + beyond / slope_there, slope_there};
        }
        const double F = std::clamp(smaller_root(a_, b_, y), min_, max_);
        return {F, std::max(slope(F), 0.0)};
    }

private:
    [[nodiscard]] double parabola(double F) const noexcept { return F * (b_ + a_ * F); }
    [[nodiscard]] double slope(double F) const noexcept { return b_ + 2 * a_ * F; }

    double b_ = 1, a_ = 0, min_ = 0, max_ = 0;
};

}  // namespace tactiled
