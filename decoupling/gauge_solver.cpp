#include "decoupling/gauge_solver.hpp"

#include <Eigen/Dense>
#include <bit>
#include <cmath>
#include <limits>

namespace tactiled {
namespace {

// As in method "linear" (table.cpp): 6 sigma of noise is once in 5e8 samples; sound gauges differ by 1 %.
constexpr double kDoubtful = 6, kGainError = 0.01;
// Subsets worse conditioned than this, columns scaled to length 1, are not solved; nor those that determine a load 100
// times worse than all gauges together.
constexpr double kWorst = 100;

}  // namespace

GaugeSolver::GaugeSolver(const std::vector<std::vector<double>>& gains, const std::vector<double>& noise,
                         std::uint32_t inner, int inner_needed)
    : n_gauges_(gains.size()), n_loads_(gains.front().size()) {
    for (std::size_t k = 0; k < n_gauges_; ++k) {
        noise_[k] = noise[k];
        for (std::size_t j = 0; j < n_loads_; ++j) gains_[k][j] = gains[k][j];
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
            g(i, j) = gains_[rows[std::size_t(i)]][std::size_t(j)] / noise_[rows[std::size_t(i)]];
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
            subset.inverse[std::size_t(j)][k] = inverse(j, i) / length[j] / noise_[k];
        }
        // inverse * inverse' is the covariance of the scaled loads at 1 sd of noise; this is the root of its diagonal.
        subset.sd[std::size_t(j)] = inverse.row(j).norm() / length[j];
    }
    return subset;
}

std::array<double, kMostLoads> GaugeSolver::loads(const double* r, std::uint32_t usable) const noexcept {
    std::array<double, kMostLoads> load{};
    const Subset& subset = subsets_[usable];
    for (std::size_t j = 0; j < n_loads_; ++j)
        for (std::size_t k = 0; k < n_gauges_; ++k) load[j] += subset.inverse[j][k] * r[k];
    return load;
}

double GaugeSolver::predicted(std::size_t k, const std::array<double, kMostLoads>& load) const noexcept {
    double sum = 0;
    for (std::size_t j = 0; j < n_loads_; ++j) sum += gains_[k][j] * load[j];
    return sum;
}

double GaugeSolver::residual(const std::array<double, kMostLoads>& load, const double* r,
                             std::uint32_t usable) const noexcept {
    const int gauges = std::popcount(usable), freedom = gauges - int(n_loads_);
    if (freedom <= 0) return std::numeric_limits<double>::quiet_NaN();
    double reading = 0, sum = 0;
    for (std::size_t k = 0; k < n_gauges_; ++k)
        if ((usable >> k & 1u) != 0) reading += r[k] * r[k];
    const double gain_error = kGainError * kGainError * reading / gauges;
    for (std::size_t k = 0; k < n_gauges_; ++k) {
        if ((usable >> k & 1u) == 0) continue;
        const double rest = r[k] - predicted(k, load);
        sum += rest * rest / (noise_[k] * noise_[k] + gain_error);
    }
    // Readings of 1e154 and more overflow: doubtful, not undecided.
    return std::isfinite(gain_error) && std::isfinite(sum) ? std::sqrt(sum / freedom)
                                                           : std::numeric_limits<double>::infinity();
}

GaugeSolver::Solved GaugeSolver::solve(std::span<const double> r, std::span<const double> zero,
                                       std::uint32_t usable) const noexcept {
    Solved solved;
    if (!subsets_[usable].solvable) return solved;
    std::array<double, kMostGauges> live{};  // 0 where not usable: 0 * NaN is not 0
    for (std::size_t k = 0; k < n_gauges_; ++k)
        if ((usable >> k & 1u) != 0) live[k] = r[k];
    solved.load = loads(live.data(), usable);
    solved.used = usable;
    solved.residual = residual(solved.load, live.data(), usable);
    if (!(solved.residual > kDoubtful)) return solved;
    // One gauge that delivers 0, as no live one would: the rest is consistent and demands another value there.
    std::uint32_t found = usable;
    for (std::size_t k = 0; k < n_gauges_; ++k) {
        const std::uint32_t rest = usable & ~(1u << k);
        if (rest == usable || !(std::abs(live[k] + zero[k]) <= 3 * noise_[k]) || !subsets_[rest].solvable) continue;
        const auto load = loads(live.data(), rest);
        if (residual(load, live.data(), rest) > kDoubtful ||
            !(std::abs(predicted(k, load) - live[k]) > kDoubtful * noise_[k]))
            continue;
        if (found != usable) {  // two candidates: not known which
            found = usable;
            break;
        }
        found = rest;
    }
    solved.dead = found != usable;
    solved.doubtful = !solved.dead;
    if (solved.dead) {
        solved.used = found;
        solved.load = loads(live.data(), found);
    }
    return solved;
}

}  // namespace tactiled
