#include "decoupling/table/point_contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tactiled {
namespace {

constexpr double kLinear_m = 1e-6;  // a step below this length is the last one; the force is linear over its length
constexpr double kLargest_m = 1.5e-4;
constexpr double kAlong_sd = 3;  // distance along the worst direction at which the contact is evaluated again
constexpr double kRank = 1e-9;   // a column whose orthogonal part is shorter than this share of it is dependent

// Gram-Schmidt; two passes are enough (Giraud, Langou and Rozloznik 2005): q orthonormal, r upper triangular, a = q
// r. A dependent column becomes zero in q.
template <int N>
struct Orthogonal {
    Eigen::Matrix<double, 8, N> q;
    Eigen::Matrix<double, N, N> r;
    explicit Orthogonal(const Eigen::Matrix<double, 8, N>& a) noexcept : r(Eigen::Matrix<double, N, N>::Zero()) {
        for (int j = 0; j < N; ++j) {
            Gauges v = a.col(j);
            const double length = v.norm();
            for (int pass = 0; pass < 2; ++pass)
                for (int i = 0; i < j; ++i) {
                    const double part = q.col(i).dot(v);
                    r(i, j) += part;
                    v -= part * q.col(i);
                }
            const double rest = v.norm();
            if (rest > kRank * length) {
                r(j, j) = rest;
                q.col(j) = v / rest;
            } else {
                q.col(j).setZero();
            }
        }
    }
    // Returns x of a x = b in the least-squares sense; 0 for a dependent column.
    [[nodiscard]] Eigen::Matrix<double, N, 1> solve(const Gauges& b) const noexcept {
        Eigen::Matrix<double, N, 1> x;
        for (int j = N - 1; j >= 0; --j) {
            double sum = q.col(j).dot(b);
            for (int i = j + 1; i < N; ++i) sum -= r(j, i) * x[i];
            x[j] = r(j, j) > 0 ? sum / r(j, j) : 0;
        }
        return x;
    }
};

template <typename Matrix>
void keep(Matrix& rows, std::uint32_t usable) noexcept {
    for (int k = 0; k < 8; ++k)
        if ((usable >> k & 1u) == 0) rows.row(k).setZero();
}

}  // namespace

PointSolver::PointSolver(InfluenceMap map) : map_(std::move(map)) {}

Influence PointSolver::basis(const Eigen::Vector2d& point_m) const noexcept {
    InfluenceMap::At at;
    map_.at(point_m.x(), point_m.y(), at);
    return Orthogonal<3>(at.value).q;
}

PointContact PointSolver::refine(const Gauges& y, std::uint32_t usable, const PointContact& start,
                                 int steps) const noexcept {
    PointContact best;
    best.squares = std::numeric_limits<double>::infinity();
    const double radius = map_.radius_m();
    Eigen::Vector2d p = start.point_m, step = Eigen::Vector2d::Zero();
    Eigen::Matrix<double, 8, 2> slope;      // derivative of the projected residual by the point, at `best`
    Gauges rest;                            // at `best`
    Orthogonal<3> base{Influence::Zero()};  // at `best`
    double& damping = best.damping;
    damping = std::min(start.damping, 1.0);
    bool fresh = false;
    for (int i = 0; i < steps; ++i) {
        InfluenceMap::At at;
        map_.at(p.x(), p.y(), at);
        keep(at.value, usable);
        const Orthogonal<3> a(at.value);
        const Eigen::Vector3d force = a.solve(y);
        const Gauges rho = y - a.q * (a.q.transpose() * y);
        const double squares = rho.squaredNorm();
        if (squares < best.squares) {
            best.point_m = p;
            best.force_N = force;
            best.squares = squares;
            rest = rho;
            slope.col(0) = at.dx * force;
            slope.col(1) = at.dy * force;
            keep(slope, usable);
            damping = std::max(damping / 10, 1e-9);
            fresh = true;
            base = a;
        } else {
            if (!fresh) return best;  // not finite
            damping *= 30;
        }
        // Levenberg-Marquardt step: least squares of slope * step = rest, damped by the columns' lengths.
        const Eigen::Matrix<double, 8, 2> projected = slope - base.q * (base.q.transpose() * slope);
        const double sx = projected.col(0).norm(), sy = projected.col(1).norm(), scale = std::max({sx, sy, 1e-300});
        // Two columns are solved explicitly, with the damping as one more row each.
        const double d = std::sqrt(damping) * scale, xx = std::hypot(sx, d);
        const double xy = projected.col(0).dot(projected.col(1)) / xx, bx = projected.col(0).dot(rest) / xx;
        const Gauges across = projected.col(1) - projected.col(0) * (xy / xx);
        const double yy2 = across.squaredNorm() + d * d + (xy / xx * d) * (xy / xx * d);
        const double by = across.dot(rest);
        step.y() = yy2 > 0 ? by / yy2 : 0;
        step.x() = (bx - xy * step.y()) / xx;
        if (!step.allFinite()) return best;
        double length = step.norm();
        if (length > kLargest_m) step *= kLargest_m / length;
        p = best.point_m + step;
        best.at_rim = p.norm() >= radius;
        if (best.at_rim) p *= radius / p.norm();
        step = p - best.point_m;
        length = step.norm();
        if (length < kLinear_m) {
            best.converged = true;
            best.force_N -= base.solve(slope * step);
            best.point_m = p;
            return best;
        }
    }
    return best;
}

void PointSolver::sds(const Gauges& y, std::uint32_t usable, double variance, PointContact& contact) const noexcept {
    InfluenceMap::At at;
    map_.at(contact.point_m.x(), contact.point_m.y(), at);
    Eigen::Matrix<double, 8, 5> a;  // derivatives by Fx Fy Fz, then by x and y
    a << at.value, at.dx * contact.force_N, at.dy * contact.force_N;
    keep(a, usable);
    const Orthogonal<5> orthogonal(a);
    // Computes row i of the inverse of r by back substitution: its length is the standard deviation of unknown i.
    Eigen::Matrix<double, 5, 5> inverse = Eigen::Matrix<double, 5, 5>::Zero();
    for (int j = 0; j < 5; ++j)
        for (int i = j; i >= 0; --i) {
            double sum = i == j ? 1 : 0;
            for (int k = i + 1; k <= j; ++k) sum -= orthogonal.r(i, k) * inverse(k, j);
            inverse(i, j) = orthogonal.r(i, i) > 0 ? sum / orthogonal.r(i, i) : std::numeric_limits<double>::infinity();
        }
    contact.worst.setZero();
    const double sigma = std::sqrt(variance);
    for (int i = 0; i < 3; ++i) contact.sd[std::size_t(i)] = sigma * inverse.row(i).norm();
    contact.force_sd_N = std::hypot(contact.sd[0], contact.sd[1], contact.sd[2]);
    // mx = y Fz, my = -x Fz
    const Eigen::Vector2d p = contact.point_m;
    const Eigen::Vector3d f = contact.force_N;
    contact.sd[3] = sigma * (f.z() * inverse.row(4) + p.y() * inverse.row(2)).norm();
    contact.sd[4] = sigma * (f.z() * inverse.row(3) + p.x() * inverse.row(2)).norm();

    for (int i = 0; i < 2; ++i) contact.point_sd_m[std::size_t(i)] = sigma * inverse.row(3 + i).norm();

    // The longer axis of the point's covariance.
    const double xx = inverse.row(3).squaredNorm(), yy = inverse.row(4).squaredNorm(),
                 xy = inverse.row(3).dot(inverse.row(4));
    const double axis2 = (xx + yy) / 2 + std::hypot((xx - yy) / 2, xy), turn = std::atan2(2 * xy, xx - yy) / 2;
    const double axis_m = sigma * std::sqrt(axis2), along_m = std::min(kAlong_sd * axis_m, kLargest_m);
    if (!std::isfinite(axis_m) || !std::isfinite(turn)) return;
    contact.worst = {std::cos(turn), std::sin(turn)};
    if (!(along_m > kLinear_m)) return;
    for (const double sign : {-1.0, 1.0}) {
        const Eigen::Vector2d there = p + sign * along_m * contact.worst;
        if (there.norm() > map_.radius_m()) continue;
        map_.at(there.x(), there.y(), at);
        keep(at.value, usable);
        const Eigen::Vector3d g = Orthogonal<3>(at.value).solve(y);
        const double share = axis_m / along_m;
        const double change[5] = {g.x() - f.x(), g.y() - f.y(), g.z() - f.z(), there.y() * g.z() - p.y() * f.z(),
                                  there.x() * g.z() - p.x() * f.z()};
        for (std::size_t i = 0; i < 5; ++i) contact.sd[i] = std::max(contact.sd[i], share * std::abs(change[i]));
    }
}

}  // namespace tactiled
