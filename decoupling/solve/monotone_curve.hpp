// A rising curve through points: piecewise cubic, as monotone as its points (Fritsch and Carlson 1980), linear
// beyond.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace tactiled {

class MonotoneCurve {
public:
    // Returns the fault, "" if there is none: both coordinates must rise from point to point. setup
    static std::string fault_of(const std::vector<double>& x, const std::vector<double>& y) {
        if (x.size() < 2 || x.size() != y.size()) return "it needs two points or more";
        for (std::size_t i = 1; i < x.size(); ++i)
            if (!(x[i] > x[i - 1]) || !(y[i] > y[i - 1])) return "its columns do not rise from row to row";
        return "";
    }
    MonotoneCurve() : MonotoneCurve({0, 1}, {0, 1}) {}
    // setup
    MonotoneCurve(std::vector<double> x, std::vector<double> y) : x_(std::move(x)), y_(std::move(y)), slope_(x_.size()) {
        const std::size_t n = x_.size();
        std::vector<double> d(n - 1);
        for (std::size_t i = 0; i + 1 < n; ++i) d[i] = (y_[i + 1] - y_[i]) / (x_[i + 1] - x_[i]);
        // Weighted harmonic mean inside (never above three times the smaller), and at the ends the parabola through
        // the outermost three points, with the same limit.
        for (std::size_t i = 1; i + 1 < n; ++i) {
            const double a = x_[i] - x_[i - 1], b = x_[i + 1] - x_[i];
            slope_[i] = (3 * (a + b)) / ((2 * b + a) / d[i - 1] + (b + 2 * a) / d[i]);
        }
        const auto end = [](double h0, double h1, double d0, double d1) {
            return std::clamp(((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1), 0.1 * d0, 3 * d0);
        };
        if (n == 2) {
            slope_[0] = slope_[1] = d[0];
        } else {
            slope_[0] = end(x_[1] - x_[0], x_[2] - x_[1], d[0], d[1]);
            slope_[n - 1] = end(x_[n - 1] - x_[n - 2], x_[n - 2] - x_[n - 3], d[n - 2], d[n - 3]);
        }
    }
    // rt: bounded by the number of points
    [[nodiscard]] double at(double x) const noexcept {
        if (!(x > x_.front())) return y_.front() + slope_.front() * (x - x_.front());
        if (x >= x_.back()) return y_.back() + slope_.back() * (x - x_.back());
        const auto i = std::size_t(std::upper_bound(x_.begin(), x_.end(), x) - x_.begin()) - 1;
        const double h = x_[i + 1] - x_[i], t = (x - x_[i]) / h, s = 1 - t;
        return y_[i] * (1 + 2 * t) * s * s + y_[i + 1] * (3 - 2 * t) * t * t +
               h * t * s * (slope_[i] * s - slope_[i + 1] * t);
    }
    [[nodiscard]] double last() const noexcept { return x_.back(); }

private:
    std::vector<double> x_, y_, slope_;
};

}  // namespace tactiled
