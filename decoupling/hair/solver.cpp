#include "decoupling/hair/solver.hpp"

#include <cmath>
#include <vector>

#include "decoupling/solve/consistency.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr int kGrid = 8;  // the leak's slopes are evaluated at 9 x 9 x 9 points

}  // namespace

HairLoad HairResponse::nearest(const HairLoad& load) const noexcept {
    HairLoad inside;
    for (std::size_t j = 0; j < 3; ++j) inside[j] = std::clamp(load[j], min[j] - kDomainMargin, max[j] + kDomainMargin);
    return inside;
}

double HairResponse::reading(std::size_t i, const HairLoad& load, const LeakTerms& terms) const noexcept {
    return gain[i][0] * load[0] + gain[i][1] * load[1] + gain[i][2] * load[2] + tactiled::leak(leak[i], terms);
}

HairSolver::HairSolver(const HairResponse& response, std::uint32_t hairs, std::uint32_t unknowns) : response_(response) {
    for (const auto& row : response_.leak)
        for (const double coefficient : row) leaks_ = leaks_ || coefficient != 0;
    for (std::uint32_t subset = 1; subset < subsets_.size(); ++subset)
        if ((subset & ~hairs) == 0) subsets_[subset] = prepare(subset, unknowns);
}

HairSolver::Subset HairSolver::prepare(std::uint32_t hairs, std::uint32_t unknowns) const {
    Subset subset;
    std::vector<std::size_t> rows, columns;
    for (std::size_t i = 0; i < 4; ++i)
        if ((hairs >> i & 1u) != 0) rows.push_back(i);
    for (std::size_t j = 0; j < 3; ++j)
        if ((unknowns >> j & 1u) != 0) columns.push_back(j);
    const auto n = Eigen::Index(rows.size()), m = Eigen::Index(columns.size());
    if (n < m || m == 0) return subset;
    Eigen::MatrixXd g(n, m);
    for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j < m; ++j)
            g(i, j) = response_.gain[rows[std::size_t(i)]][columns[std::size_t(j)]] / response_.noise[rows[std::size_t(i)]];
    const Eigen::RowVectorXd scale = g.colwise().norm();
    if (!(scale.minCoeff() > 0) || !scale.allFinite()) return subset;
    const Eigen::MatrixXd scaled = g.array().rowwise() / scale.array();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled);
    // Intact sensors are below 5 for any three hairs.
    if (!(svd.singularValues()[m - 1] * kWorstCondition > svd.singularValues()[0])) return subset;
    const Eigen::MatrixXd inverse = dense::solve_by_qr(scaled, Eigen::MatrixXd::Identity(n, n));
    for (Eigen::Index j = 0; j < m; ++j) {
        const std::size_t at = columns[std::size_t(j)];
        subset.noise_gain[at] = inverse.row(j).norm() / scale[j];
        for (Eigen::Index i = 0; i < n; ++i)
            subset.inverse[at][rows[std::size_t(i)]] = inverse(j, i) / scale[j] / response_.noise[rows[std::size_t(i)]];
    }
    if (leaks_) {
        // The largest magnitude, over the loads where the leak is evaluated, of each entry of inverse * slopes of the leak.
        // The largest eigenvalue of these magnitudes is the factor by which a step reduces the error (in the maximum norm
        // weighted by its eigenvector, which does not grow if a load is limited to its range).
        Eigen::MatrixXd sizes = Eigen::MatrixXd::Zero(3, 3);
        HairLoad load;
        for (int point = 0; point < (kGrid + 1) * (kGrid + 1) * (kGrid + 1); ++point) {
            int rest = point;
            for (std::size_t j = 0; j < 3; ++j, rest /= kGrid + 1)
                load[j] = std::lerp(response_.min[j] - kDomainMargin, response_.max[j] + kDomainMargin,
                                    double(rest % (kGrid + 1)) / kGrid);
            for (const std::size_t axis : columns) {
                const LeakTerms slopes = leak_slopes(load, axis);
                for (const std::size_t c : columns) {
                    double slope = 0;
                    for (const std::size_t i : rows) slope += subset.inverse[c][i] * leak(response_.leak[i], slopes);
                    auto& size = sizes(Eigen::Index(c), Eigen::Index(axis));
                    size = std::max(size, std::abs(slope));
                }
            }
        }
        if (!sizes.allFinite()) return subset;
        subset.contraction = dense::spectral_radius(sizes);
    }
    subset.solvable =
        subset.contraction < kSlowest && std::isfinite(subset.noise_gain[0] + subset.noise_gain[1] + subset.noise_gain[2]);
    return subset;
}

HairLoad HairSolver::excess(const std::array<double, 4>& r, std::uint32_t hairs, const HairLoad& load) const noexcept {
    const LeakTerms terms = leak_terms(response_.nearest(load));
    HairLoad result = load;
    for (std::size_t i = 0; i < 4; ++i)
        if ((hairs >> i & 1u) != 0) {
            const double linear = r[i] - leak(response_.leak[i], terms);
            for (std::size_t j = 0; j < 3; ++j) result[j] -= subsets_[hairs].inverse[j][i] * linear;
        }
    return result;
}

HairLoad HairSolver::solve_by_newton(const std::array<double, 4>& r, std::uint32_t hairs) const noexcept {
    const auto size = [](const HairLoad& x) { return std::max({std::abs(x[0]), std::abs(x[1]), std::abs(x[2])}); };
    HairLoad load{}, left = excess(r, hairs, load);
    for (int step = 0; step < kSteps && size(left) > 1e-14; ++step) {
        const HairLoad inside = response_.nearest(load);
        // derivative of `left`; beyond the calibrated loads the leak is constant
        Eigen::Matrix3d slope = Eigen::Matrix3d::Identity();
        for (std::size_t axis = 0; axis < 3; ++axis) {
            if (inside[axis] != load[axis]) continue;
            const LeakTerms slopes = leak_slopes(load, axis);
            for (std::size_t i = 0; i < 4; ++i)
                for (std::size_t j = 0; (hairs >> i & 1u) != 0 && j < 3; ++j)
                    slope(Eigen::Index(j), Eigen::Index(axis)) +=
                        subsets_[hairs].inverse[j][i] * leak(response_.leak[i], slopes);
        }
        const Eigen::Vector3d newton = slope.partialPivLu().solve(Eigen::Vector3d(left[0], left[1], left[2]));
        HairLoad next;
        for (std::size_t j = 0; j < 3; ++j) next[j] = load[j] - newton[Eigen::Index(j)];
        HairLoad next_left = excess(r, hairs, next);
        // across the edge of the calibrated loads: a step of the fixed-point iteration
        if (!(size(next_left) < size(left) / 2)) {
            for (std::size_t j = 0; j < 3; ++j) next[j] = load[j] - left[j];
            next_left = excess(r, hairs, next);
        }
        if (!(size(next_left) < size(left)) && size(left) < 1e-12) break;  // rounding
        load = next;
        left = next_left;
    }
    return load;
}

HairLoad HairSolver::solve(const std::array<double, 4>& r, std::uint32_t hairs) const noexcept {
    const Subset& subset = subsets_[hairs];
    if (subset.contraction >= kFixedPoint) return solve_by_newton(r, hairs);
    HairLoad load{};
    std::array<double, 4> linear{};
    for (std::size_t i = 0; i < 4; ++i)
        if ((hairs >> i & 1u) != 0) linear[i] = r[i];  // prevents 0 * NaN of an unusable hair
    for (int step = 0; step < kSteps; ++step) {
        HairLoad next{};
        for (std::size_t j = 0; j < 3; ++j)
            for (std::size_t i = 0; i < 4; ++i) next[j] += subset.inverse[j][i] * linear[i];
        const double change =
            std::max({std::abs(next[0] - load[0]), std::abs(next[1] - load[1]), std::abs(next[2] - load[2])});
        load = next;
        if (!leaks_ || !(change > 1e-14)) break;  // relative to full scale; a NaN ends the loop, too
        const LeakTerms terms = leak_terms(response_.nearest(load));
        for (std::size_t i = 0; i < 4; ++i)
            if ((hairs >> i & 1u) != 0) linear[i] = r[i] - leak(response_.leak[i], terms);
    }
    return load;
}

}  // namespace tactiled
