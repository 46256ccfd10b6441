#include "decoupling/table/gauge_solver.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "decoupling/solve/dense.hpp"

namespace tactiled {

// The gauges of even and of odd index are summed separately, two additions at a time.
inline double GaugeSolver::sum_of(const Gauges& a) noexcept {
    const double even = (a[0] + a[2]) + (a[4] + a[6]), odd = (a[1] + a[3]) + (a[5] + a[7]);
    return even + odd;
}

GaugeSolver::GaugeSolver(const std::vector<std::vector<double>>& gains, const std::vector<double>& noise,
                         const std::vector<double>& zero, std::uint32_t inner, int inner_needed)
    : n_gauges_(gains.size()), n_loads_(gains.front().size()), zero_(zero) {
    noise2_ += 1.0;
    for (std::size_t k = 0; k < n_gauges_; ++k) {
        noise2_[k] = noise[k] * noise[k];
        same_noise_ = same_noise_ && noise[k] == noise[0];
        for (std::size_t j = 0; j < n_loads_; ++j) gains_[j][k] = gains[k][j];
    }
    subsets_.resize(std::size_t{1} << n_gauges_);
    subsets_.back() = prepare(std::uint32_t(subsets_.size() - 1), &confused_);
    for (std::uint32_t usable = 0; usable + 1 < subsets_.size(); ++usable) {
        if (!subsets_.back().solvable || std::popcount(usable & inner) < inner_needed) continue;
        Subset subset = prepare(usable, nullptr);
        // A subset that determines a load a hundred times worse than all gauges together is not solved, either.
        for (std::size_t j = 0; j < n_loads_; ++j)
            subset.solvable = subset.solvable && subset.sd[j] < kWorstCondition * subsets_.back().sd[j];
        subsets_[usable] = subset;
    }
    for (Subset& subset : subsets_)
        for (std::size_t j = 0; j < n_loads_; ++j)
            subset.sd_factor[j] = subset.solvable ? subset.sd[j] / subsets_.back().sd[j] : 0;
}

GaugeSolver::Subset GaugeSolver::prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const {
    Subset subset;
    std::vector<std::size_t> rows;
    const auto noise_of = [this](std::size_t k) { return std::sqrt(noise2_[k]); };
    for (std::size_t k = 0; k < n_gauges_; ++k)
        if ((usable >> k & 1u) != 0) rows.push_back(k);
    const auto m = Eigen::Index(rows.size()), n = Eigen::Index(n_loads_);
    if (m < n && confused == nullptr) return subset;
    // Weighted: each row in units of its gauge's noise; then each column scaled to length 1.
    Eigen::MatrixXd g = Eigen::MatrixXd::Zero(std::max(m, n), n);
    for (Eigen::Index i = 0; i < m; ++i)
        for (Eigen::Index j = 0; j < n; ++j) g(i, j) = gains_[j][rows[std::size_t(i)]] / noise_of(rows[std::size_t(i)]);
    const Eigen::RowVectorXd length = g.colwise().norm();
    for (Eigen::Index j = 0; j < n; ++j)
        if (length[j] > 0) g.col(j) /= length[j];
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(g, Eigen::ComputeFullV);
    const auto& s = svd.singularValues();
    subset.condition = s[n - 1] > 0 ? s[0] / s[n - 1] : std::numeric_limits<double>::infinity();
    // Written so that a NaN is not solvable.
    subset.solvable = s[n - 1] * kWorstCondition > s[0] && length.minCoeff() > 0 && length.allFinite();
    if (!subset.solvable) {
        if (confused != nullptr)
            for (Eigen::Index j = 0; j < n; ++j) {
                bool part = false;
                for (Eigen::Index i = 0; i < n; ++i)
                    part = part || (!(s[i] * kWorstCondition > s[0]) && !(std::abs(svd.matrixV()(j, i)) < 0.1));
                if (part) confused->push_back(std::size_t(j));
            }
        return subset;
    }
    const Eigen::MatrixXd inverse = dense::solve_by_qr(g, Eigen::MatrixXd::Identity(g.rows(), g.rows()));
    for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index i = 0; i < m; ++i) {
            const std::size_t k = rows[std::size_t(i)];
            subset.inverse[j][k] = inverse(j, i) / length[j] / noise_of(k);
            subset.gains[j][k] = gains_[j][k];
        }
        // inverse * inverse' is the covariance of the scaled loads at 1 sd of noise; this is the square root of its
        // diagonal.
        subset.sd[j] = inverse.row(j).norm() / length[j];
    }
    for (const std::size_t k : rows) {
        subset.free[k] = 1;
        for (std::size_t j = 0; j < n_loads_; ++j) subset.free[k] -= gains_[j][k] * subset.inverse[j][k];
    }
    subset.gain_error2_per_read2 = kGainError * kGainError / double(m);
    subset.can_disagree = m > n;
    if (m > n) subset.per_freedom = 1 / double(m - n);
    return subset;
}

inline void GaugeSolver::find(const Subset& subset, const Gauges& r, Solved& solved) const noexcept {
    solved.sd_factor = subset.sd_factor;
    for (std::size_t j = 0; j < n_loads_; ++j) solved.load[j] = sum_of(subset.inverse[j] * r);
    if (!subset.can_disagree) {
        solved.residual = std::numeric_limits<double>::quiet_NaN();
        return;
    }
    Gauges rest = r;
    for (std::size_t j = 0; j < n_loads_; ++j) rest -= subset.gains[j] * solved.load[j];
    rest *= rest;
    const double gain_error2 = subset.gain_error2_per_read2 * sum_of(r * r);
    const double unexplained =
        same_noise_ ? sum_of(rest) / (noise2_[0] + gain_error2) : sum_of(rest / (noise2_ + gain_error2));
    solved.residual = std::sqrt(unexplained * subset.per_freedom);
    // Readings of 1e154 and more overflow: the result is doubtful.
    if (!(gain_error2 + unexplained <= std::numeric_limits<double>::max()))
        solved.residual = std::numeric_limits<double>::infinity();
}

// All paths fill and return one variable, because a copy would wait for the preceding stores.
GaugeSolver::Solved GaugeSolver::solve(const double* readings, std::uint32_t usable) const noexcept {
    Solved solved;
    if (!subsets_[usable].solvable) return solved;
    Gauges r;
    std::memcpy(&r, readings, sizeof r);
    find(subsets_[usable], r, solved);
    solved.used = usable;
    if (solved.residual > kDoubtful) [[unlikely]] {
        // The gauges disagree: one is dead, or the wrong one is unknown.
        Solved others = without_dead(r, usable, solved);
        others.residual = solved.residual;  // shows why a gauge was left out
        solved.doubtful = true;
        if (others.dead) solved = others;
    }
    return solved;
}

// Solves without the one gauge that delivers 0 without noise, if the readings of the others are consistent and require
// another value there. `dead` is not set if there is no such gauge or more than one. If a gauge has the residual `rest` and
// contributes the share h to its own prediction, it differs from the prediction of the others by rest / (1 - h), and
// omitting the gauge reduces the squared residual by rest^2 / (1 - h). Only the two gauges with the largest reduction are
// examined: if a third gauge left the others consistent, these two would, too, and the dead gauge would be unknown.
GaugeSolver::Solved GaugeSolver::without_dead(const Gauges& r, std::uint32_t usable, const Solved& all) const noexcept {
    struct {
        std::size_t gauge = kMaxGauges;  // kMaxGauges: none
        double taken_off = 0;
    } max[2];
    for (std::size_t k = 0; k < n_gauges_; ++k) {
        const double read = r[k] + zero_[k], noise2 = noise2_[k];
        if ((usable >> k & 1u) == 0 || !(read * read <= 9 * noise2) || !subsets_[usable & ~(1u << k)].solvable) continue;
        double predicted = 0;
        for (std::size_t j = 0; j < n_loads_; ++j) predicted += gains_[j][k] * all.load[j];
        const double rest = r[k] - predicted, free = subsets_[usable].free[k];
        if (!(rest * rest > kDoubtful * kDoubtful * noise2 * free * free)) continue;
        const double taken_off = rest * rest / (noise2 * free);
        if (taken_off > max[0].taken_off) {
            max[1] = max[0];
            max[0] = {k, taken_off};
        } else if (taken_off > max[1].taken_off) {
            max[1] = {k, taken_off};
        }
    }
    Solved found;
    for (const auto& candidate : max) {
        if (candidate.gauge == kMaxGauges) continue;
        Gauges live = r;
        live[candidate.gauge] = 0;
        Solved solved;
        solved.used = usable & ~(1u << candidate.gauge);
        solved.dead = true;
        find(subsets_[solved.used], live, solved);
        if (solved.residual > kDoubtful) continue;
        if (found.dead) return {};  // two candidates: the dead one is unknown
        found = solved;
    }
    return found;
}

}  // namespace tactiled
