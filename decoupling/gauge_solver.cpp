#include "decoupling/gauge_solver.hpp"

#include <Eigen/Dense>
#include <bit>
#include <cmath>
#include <limits>

#include "decoupling/pairs.hpp"

namespace tactiled {
namespace {

// A residual is doubtful from here on, in standard deviations. 6 sigma of pure noise is once in 5e8 samples, 6 days at
// 1 kHz; 4 sigma would be once in 16 s.
constexpr double kDoubtful = 6;
// Gauges that differ from their common gain by 1 % are sound: within the documents' 4.84 % hysteresis and 0.99 %
// linearity nobody can calibrate them closer. All four off by 1 % in the worst signs make a residual of 2 sigma, one
// gauge alone has to be off by about 12 % of the others' reading to reach kDoubtful.
constexpr double kGainError = 0.01;
// Subsets worse conditioned than this, columns scaled to length 1, are not solved; nor those that determine a load 100
// times worse than all gauges together.
constexpr double kWorst = 100;

}  // namespace

GaugeSolver::GaugeSolver(const std::vector<std::vector<double>>& gains, const std::vector<double>& noise,
                         std::uint32_t inner, int inner_needed)
    : n_gauges_(gains.size()), n_loads_(gains.front().size()) {
    std::fill_n(noise2_, kMostGauges, 1.0);
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
        for (std::size_t j = 0; j < n_loads_; ++j)
            subset.solvable = subset.solvable && subset.sd[j] < kWorst * subsets_.back().sd[j];
        subsets_[usable] = subset;
    }
    for (Subset& subset : subsets_)
        for (std::size_t j = 0; j < n_loads_; ++j)
            subset.sd_factor[j] = subset.solvable ? subset.sd[j] / subsets_.back().sd[j] : 0;
}

GaugeSolver::Subset GaugeSolver::prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const {
    Subset subset;
    std::vector<std::size_t> rows;
    for (std::size_t k = 0; k < n_gauges_; ++k)
        if ((usable >> k & 1u) != 0) rows.push_back(k);
    const auto m = Eigen::Index(rows.size()), n = Eigen::Index(n_loads_);
    if (m < n && confused == nullptr) return subset;
    // Weighted: each row in units of its gauge's noise; then each column to length 1.
    Eigen::MatrixXd g = Eigen::MatrixXd::Zero(std::max(m, n), n);
    for (Eigen::Index i = 0; i < m; ++i)
        for (Eigen::Index j = 0; j < n; ++j)
            g(i, j) = gains_[j][rows[std::size_t(i)]] / std::sqrt(noise2_[rows[std::size_t(i)]]);
    const Eigen::RowVectorXd length = g.colwise().norm();
    for (Eigen::Index j = 0; j < n; ++j)
        if (length[j] > 0) g.col(j) /= length[j];
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(g, Eigen::ComputeFullV);
    const auto& s = svd.singularValues();
    subset.condition = s[n - 1] > 0 ? s[0] / s[n - 1] : std::numeric_limits<double>::infinity();
    // Written so that a NaN is not solvable.
    subset.solvable = s[n - 1] * kWorst > s[0] && length.minCoeff() > 0 && length.allFinite();
    if (!subset.solvable) {
        if (confused != nullptr)
            for (Eigen::Index j = 0; j < n; ++j) {
                bool part = false;
                for (Eigen::Index i = 0; i < n; ++i)
                    part = part || (!(s[i] * kWorst > s[0]) && !(std::abs(svd.matrixV()(j, i)) < 0.1));
                if (part) confused->push_back(std::size_t(j));
            }
        return subset;
    }
    const Eigen::MatrixXd inverse = g.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(g.rows(), g.rows()));
    for (Eigen::Index j = 0; j < n; ++j) {
        for (Eigen::Index i = 0; i < m; ++i) {
            const std::size_t k = rows[std::size_t(i)];
            subset.inverse[k][j] = inverse(j, i) / length[j] / std::sqrt(noise2_[k]);
        }
        // inverse * inverse' is the covariance of the scaled loads at 1 sd of noise; this is the root of its diagonal.
        subset.sd[std::size_t(j)] = inverse.row(j).norm() / length[j];
    }
    for (const std::size_t k : rows) {
        subset.used[k] = 1;
        subset.free[k] = 1;
        for (std::size_t j = 0; j < n_loads_; ++j) subset.free[k] -= gains_[j][k] * subset.inverse[k][j];
    }
    subset.per_gauge = 1 / double(m);
    subset.can_disagree = m > n;
    if (m > n) subset.per_freedom = 1 / double(m - n);
    return subset;
}

// The loads and what they leave unexplained. Products and sums go side by side, two gauges or two loads at a time.
template <std::size_t kLoads>
void GaugeSolver::find(const Subset& subset, const double* r, Solved& solved) const noexcept {
    Pair low = both(0), high = both(0), odd_low = both(0), odd_high = both(0);  // loads 0 1 and 2 3
    for (std::size_t k = 0; k < kMostGauges; k += 2) {
        low += load(subset.inverse[k]) * both(r[k]);
        high += load(subset.inverse[k] + 2) * both(r[k]);
        odd_low += load(subset.inverse[k + 1]) * both(r[k + 1]);
        odd_high += load(subset.inverse[k + 1] + 2) * both(r[k + 1]);
    }
    store(solved.load, low + odd_low);
    store(solved.load + 2, high + odd_high);
    if (kLoads > 4) {
        double last = 0;
        for (std::size_t k = 0; k < kMostGauges; ++k) last += subset.inverse[k][4] * r[k];
        solved.load[4] = last;
    }
    if (!subset.can_disagree) {
        solved.residual = std::numeric_limits<double>::quiet_NaN();
        return;
    }
    Pair read2 = both(0), rest2[kMostGauges / 2];
    for (std::size_t k = 0; k < kMostGauges; k += 2) {
        const Pair used = load(subset.used + k), read = load(r + k);
        Pair predicted = load(gains_[0] + k) * both(solved.load[0]);
        for (std::size_t j = 1; j < kLoads; ++j) predicted += load(gains_[j] + k) * both(solved.load[j]);
        const Pair rest = used * (read - predicted);
        rest2[k / 2] = rest * rest;
        read2 += used * read * read;
    }
    const double gain_error2 = kGainError * kGainError * (read2[0] + read2[1]) * subset.per_gauge;
    double unexplained;
    if (same_noise_) {
        const Pair sum = (rest2[0] + rest2[1]) + (rest2[2] + rest2[3]);
        unexplained = (sum[0] + sum[1]) / (noise2_[0] + gain_error2);
    } else {
        Pair sum = both(0);
        for (std::size_t k = 0; k < kMostGauges; k += 2) sum += rest2[k / 2] / (load(noise2_ + k) + both(gain_error2));
        unexplained = sum[0] + sum[1];
    }
    // Readings of 1e154 and more overflow: doubtful, not undecided.
    solved.residual = gain_error2 <= std::numeric_limits<double>::max() && unexplained <= std::numeric_limits<double>::max()
                          ? std::sqrt(unexplained * subset.per_freedom)
                          : std::numeric_limits<double>::infinity();
}

inline void GaugeSolver::find(const Subset& subset, const double* r, Solved& solved) const noexcept {
    return n_loads_ <= 3 ? find<3>(subset, r, solved) : find<kMostLoads>(subset, r, solved);
}

GaugeSolver::Solved GaugeSolver::solve(const double* r, std::span<const double> zero, std::uint32_t usable) const noexcept {
    Solved solved;
    const Subset& subset = subsets_[usable];
    if (!subset.solvable) return solved;
    find(subset, r, solved);
    solved.used = usable;
    if (!(solved.residual > kDoubtful)) return solved;
    const double residual = solved.residual;  // of all: it says why one was left out
    const Solved others = without_dead(r, zero, usable, solved);
    if (others.dead)
        solved = others;
    else
        solved.doubtful = true;
    solved.residual = residual;
    return solved;
}

// Without the one gauge that delivers 0 as no live gauge would: the readings of the others are consistent and demand another
// value there. `dead` is not set where there is none or more than one such.
// A gauge that all together leave `rest` of, and whose reading makes the share h of its own prediction, is rest / (1 - h)
// off what the others predict, and without it the squared residual is less by rest^2 / (1 - h). Only the two that take off
// most are solved for, however many read 0: where a third left the others consistent, these would, and which is dead would
// not be known.
[[gnu::noinline]] GaugeSolver::Solved GaugeSolver::without_dead(const double* r, std::span<const double> zero,
                                                                std::uint32_t usable, const Solved& all) const noexcept {
    struct {
        std::uint32_t others = 0;
        double taken_off = 0;
    } most[2];
    for (std::size_t k = 0; k < n_gauges_; ++k) {
        const std::uint32_t others = usable & ~(1u << k);
        const double read = r[k] + zero[k];
        if (others == usable || !(read * read <= 9 * noise2_[k]) || !subsets_[others].solvable) continue;
        double predicted = 0;
        for (std::size_t j = 0; j < n_loads_; ++j) predicted += gains_[j][k] * all.load[j];
        const double rest = r[k] - predicted, free = subsets_[usable].free[k];
        if (!(rest * rest > kDoubtful * kDoubtful * noise2_[k] * free * free)) continue;
        const double taken_off = rest * rest / (noise2_[k] * free);
        if (taken_off > most[0].taken_off) {
            most[1] = most[0];
            most[0] = {others, taken_off};
        } else if (taken_off > most[1].taken_off) {
            most[1] = {others, taken_off};
        }
    }
    Solved found;
    for (const auto& candidate : most) {
        if (candidate.others == 0) continue;
        Solved solved;
        find(subsets_[candidate.others], r, solved);
        if (solved.residual > kDoubtful) continue;
        if (found.dead) return {};  // two candidates: not known which
        found = solved;
        found.used = candidate.others;
        found.dead = true;
    }
    return found;
}

}  // namespace tactiled
