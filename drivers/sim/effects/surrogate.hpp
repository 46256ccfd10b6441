// Polynomials in place of expensive functions. They are fitted at set-up over the range of the scene, and their
// largest error is determined on a grid finer than that of the fit.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace tactiled::sim {

// the fit extends beyond the scene's range: surrogates before this one have errors, too
inline constexpr double kBeyond = 1.05;

// Solves the normal equations A c = b, symmetric and positive definite, by Cholesky's method; columns that depend on
// the others get 0.
template <std::size_t kN>
std::array<double, kN> solve_normal(std::array<std::array<double, kN>, kN> a, std::array<double, kN> b) {
    std::array<bool, kN> kept{};
    for (std::size_t i = 0; i < kN; ++i) {
        const double whole = a[i][i];
        for (std::size_t k = 0; k < i; ++k)
            if (kept[k]) a[i][i] -= a[i][k] * a[i][k];
        kept[i] = a[i][i] > 1e-12 * whole && whole > 0;
        if (!kept[i]) continue;
        a[i][i] = std::sqrt(a[i][i]);
        for (std::size_t j = i + 1; j < kN; ++j) {
            for (std::size_t k = 0; k < i; ++k)
                if (kept[k]) a[j][i] -= a[j][k] * a[i][k];
            a[j][i] /= a[i][i];
        }
    }
    for (std::size_t i = 0; i < kN; ++i) {
        for (std::size_t k = 0; k < i; ++k)
            if (kept[k]) b[i] -= a[i][k] * b[k];
        b[i] = kept[i] ? b[i] / a[i][i] : 0;
    }
    for (std::size_t i = kN; i-- > 0;) {
        for (std::size_t k = i + 1; k < kN; ++k)
            if (kept[k]) b[i] -= a[k][i] * b[k];
        b[i] = kept[i] ? b[i] / a[i][i] : 0;
    }
    return b;
}

// f(x) - f(0) as x (c1 + c2 x + ..), |x| <= max.
template <std::size_t kDegree>
class Polynomial {
public:
    Polynomial() = default;
    // Fits over min .. max. setup
    template <class F>
    Polynomial(F f, double min, double max) {
        const double scale = std::max(std::max(std::abs(min), std::abs(max)), 1e-300);
        std::array<std::array<double, kDegree>, kDegree> a{};
        std::array<double, kDegree> b{};
        constexpr int kPoints = 8 * int(kDegree);
        for (int i = 0; i < kPoints; ++i) {  // Chebyshev's points prevent overshoot at the ends
            const double x = (min + max) / 2 + (max - min) / 2 * std::cos(3.141592653589793 * (i + 0.5) / kPoints);
            std::array<double, kDegree> power{};
            for (std::size_t k = 0; k < kDegree; ++k) power[k] = k == 0 ? x / scale : power[k - 1] * (x / scale);
            const double y = f(x);
            for (std::size_t k = 0; k < kDegree; ++k) {
                b[k] += power[k] * y;
                for (std::size_t j = 0; j < kDegree; ++j) a[k][j] += power[k] * power[j];
            }
        }
        c_ = solve_normal(a, b);
        for (std::size_t k = 0; k < kDegree; ++k) c_[k] /= std::pow(scale, double(k + 1));
        constexpr int kGrid = 200;
        double before = 0, steepest = 0;
        for (int i = 0; i <= kGrid; ++i) {
            const double x = min + (max - min) * i / kGrid, off = (*this)(x)-f(x);
            error_ = std::max(error_, std::abs(off));
            if (i > 0) steepest = std::max(steepest, std::abs(off - before));
            before = off;
        }
        error_ += steepest / 2;
    }
    // rt: wait-free
    [[nodiscard]] double operator()(double x) const noexcept {
        double sum = 0;
        for (std::size_t k = kDegree; k-- > 0;) sum = (sum + c_[k]) * x;
        return sum;
    }
    // The largest error on the grid, plus half of the largest step between two of its points.
    [[nodiscard]] double error() const { return error_; }

private:
    std::array<double, kDegree> c_{};
    double error_ = 0;
};

// f(x, y), |x| <= X, |y| <= Y, as a cubic: ten coefficients.
class Cubic {
public:
    Cubic() = default;
    // setup
    template <class F>
    Cubic(F f, double X, double Y) {
        const double wide = std::max(std::max(X, Y), 1e-300);
        X = std::max(X, 1e-3 * wide);  // an axis without load needs a width, too
        Y = std::max(Y, 1e-3 * wide);
        std::array<std::array<double, 10>, 10> a{};
        std::array<double, 10> b{};
        constexpr int kPoints = 12;
        for (int i = 0; i < kPoints; ++i)
            for (int j = 0; j < kPoints; ++j) {
                const double u = std::cos(3.141592653589793 * (i + 0.5) / kPoints);
                const double v = std::cos(3.141592653589793 * (j + 0.5) / kPoints);
                const std::array<double, 10> term{1, v, v * v, v * v * v, u, u * v, u * v * v, u * u, u * u * v, u * u * u};
                const double z = f(u * X, v * Y);
                for (std::size_t k = 0; k < 10; ++k) {
                    b[k] += term[k] * z;
                    for (std::size_t m = 0; m < 10; ++m) a[k][m] += term[k] * term[m];
                }
            }
        c_ = solve_normal(a, b);
        constexpr std::array<int, 10> kOfX{0, 0, 0, 0, 1, 1, 1, 2, 2, 3}, kOfY{0, 1, 2, 3, 0, 1, 2, 0, 1, 0};
        for (std::size_t k = 0; k < 10; ++k) c_[k] /= std::pow(X, kOfX[k]) * std::pow(Y, kOfY[k]);
        constexpr int kGrid = 24;
        std::array<double, kGrid + 1> row_before{};
        double steepest = 0;
        for (int i = 0; i <= kGrid; ++i) {
            double before = 0;
            for (int j = 0; j <= kGrid; ++j) {
                const double x = X * (2.0 * i / kGrid - 1), y = Y * (2.0 * j / kGrid - 1), off = (*this)(x, y) - f(x, y);
                error_ = std::max(error_, std::abs(off));
                if (j > 0) steepest = std::max(steepest, std::abs(off - before));
                if (i > 0) steepest = std::max(steepest, std::abs(off - row_before[std::size_t(j)]));
                before = row_before[std::size_t(j)] = off;
            }
        }
        error_ += steepest;
    }
    // rt: wait-free
    [[nodiscard]] double operator()(double x, double y) const noexcept {
        return c_[0] + y * (c_[1] + y * (c_[2] + y * c_[3])) +
               x * (c_[4] + y * (c_[5] + y * c_[6]) + x * (c_[7] + y * c_[8] + x * c_[9]));
    }
    // The largest error on the grid, plus the largest step between two neighbours: half a step along each axis.
    [[nodiscard]] double error() const { return error_; }

private:
    std::array<double, 10> c_{};
    double error_ = 0;
};

}  // namespace tactiled::sim
