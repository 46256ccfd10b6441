#include "decoupling/tool/tool_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/solve/dense.hpp"

namespace tactiled::tool {
namespace {

constexpr double kSpread = 0.2;       // minimum singular value of the directions of gravity, relative to their rms
constexpr double kMinMass_sds = 3;    // a mass below this many sd counts as none
constexpr double kMaxResidual = 0.1;  // part of the weight: a larger residual shows another hand, or contact

using Matrix = Eigen::MatrixXd;
using Numbers = Eigen::VectorXd;
using Vector3 = Eigen::Vector3d;

struct Solution {
    Numbers x, sd;
    double residual = 0;  // rms
    bool determined = false;
};

Solution solve(const Matrix& a, const Numbers& b) {
    Solution s;
    const Eigen::JacobiSVD<Matrix> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const auto& values = svd.singularValues();
    s.determined = a.rows() > a.cols() && values[values.size() - 1] > 1e-9 * values[0];
    if (!s.determined) return s;
    s.x = svd.solve(b);
    const Numbers left = a * s.x - b;
    const double variance = left.squaredNorm() / double(a.rows() - a.cols());
    s.residual = std::sqrt(variance);
    s.sd = (dense::inverse(a.transpose() * a).diagonal() * variance).cwiseSqrt();
    return s;
}

Eigen::Matrix3d skew(const Vector3& v) {
    Eigen::Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
}

// The directions of gravity must differ, because otherwise weight and zero cannot be separated.
bool spread(std::span<const Pose> poses) {
    Matrix g(Eigen::Index(poses.size()), 3);
    for (std::size_t i = 0; i < poses.size(); ++i)
        g.row(Eigen::Index(i)) = Vector3(poses[i].gravity_G_m_s2.data()).normalized();
    g.rowwise() -= g.colwise().mean().eval();
    const Numbers values = Eigen::JacobiSVD<Matrix>(g).singularValues() / std::sqrt(double(poses.size()));
    return values[1] > kSpread;  // at least two directions, so that the torque determines the centre
}

}  // namespace

Fit fit_tool(std::span<const Pose> poses, const std::array<Vector, 3>& rows, const Vector& position_G_m) {
    Fit fit;
    const auto fails = [&](std::string why) {
        fit.fault = std::move(why);
        return fit;
    };
    if (poses.size() < kMinPoses) return fails(fmt::format("{} poses; at least {} are needed", poses.size(), kMinPoses));
    if (!spread(poses)) return fails("gravity has nearly the same direction in all poses: turn the hand about two axes");
    Eigen::Matrix3d S_from_G;
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) S_from_G(r, c) = rows[std::size_t(r)][std::size_t(c)];

    // Force: m and the zero of each measured component.
    std::array<bool, 6> seen{};
    for (std::size_t k = 0; k < 6; ++k)
        seen[k] = std::all_of(poses.begin(), poses.end(), [&](const Pose& p) { return std::isfinite(p.raw_S[k]); });
    const auto n_seen = Eigen::Index(seen[0]) + seen[1] + seen[2];
    if (n_seen == 0) return fails("the sensor sees no force");
    const auto n = Eigen::Index(poses.size());
    Matrix a = Matrix::Zero(n * n_seen, 1 + n_seen);
    Numbers b(n * n_seen);
    for (Eigen::Index i = 0, row = 0; i < n; ++i) {
        const Pose& pose = poses[std::size_t(i)];
        const Vector3 g_S = S_from_G * Vector3(pose.gravity_G_m_s2.data());
        for (Eigen::Index k = 0, column = 0; k < 3; ++k) {
            if (!seen[std::size_t(k)]) continue;
            a(row, 0) = g_S[k];
            a(row, 1 + column++) = 1;
            b[row++] = pose.raw_S[std::size_t(k)];
        }
    }
    const Solution force = solve(a, b);
    if (!force.determined) return fails("the poses do not determine the mass: turn the hand about other axes");
    fit.mass_kg = force.x[0];
    fit.mass_sd_kg = force.sd[0];
    fit.residual_N = force.residual;
    for (Eigen::Index k = 0, column = 0; k < 3; ++k)
        if (seen[std::size_t(k)]) {
            fit.zero_sd_N = std::max(fit.zero_sd_N, force.sd[1 + column]);
            fit.zero_S_N[std::size_t(k)] = force.x[1 + column++];
        }
    const Numbers left = a * force.x - b;
    for (Eigen::Index i = 0; i < n; ++i) fit.worst_N = std::max(fit.worst_N, left.segment(i * n_seen, n_seen).norm());
    const double weight_N = std::abs(fit.mass_kg) * 9.81;
    if (fit.mass_kg < -kMinMass_sds * fit.mass_sd_kg)
        return fails(
            fmt::format("the mass would be {:.3f} kg: the direction of gravity or the sensor's axes have the wrong "
                        "sign",
                        fit.mass_kg));
    if (fit.mass_kg < kMinMass_sds * fit.mass_sd_kg)
        return fails(fmt::format("the sensor carries {:.4f} +- {:.4f} kg: no mass that it could measure", fit.mass_kg,
                                 fit.mass_sd_kg));
    if (fit.residual_N > kMaxResidual * weight_N)
        return fails(
            fmt::format("a force of {:.3f} N is left in the poses, of a weight of {:.3f} N: the axes of the sensor "
                        "are wrong, gravity is not that of the hand, or something touched it",
                        fit.residual_N, weight_N));

    if (!(seen[3] && seen[4] && seen[5])) return fit;
    Matrix at = Matrix::Zero(3 * n, 6);
    Numbers bt(3 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const Pose& pose = poses[std::size_t(i)];
        at.block<3, 3>(3 * i, 0) = -skew(S_from_G * Vector3(pose.gravity_G_m_s2.data()));
        at.block<3, 3>(3 * i, 3).setIdentity();
        for (Eigen::Index k = 0; k < 3; ++k) bt[3 * i + k] = pose.raw_S[std::size_t(3 + k)];
    }
    const Solution torque = solve(at, bt);
    if (!torque.determined) return fails("the poses do not determine the centre of mass: turn the hand about other axes");
    fit.has_centre = true;
    const Vector3 centre_G = S_from_G.transpose() * (torque.x.head<3>() / fit.mass_kg) + Vector3(position_G_m.data());
    std::copy_n(centre_G.data(), 3, fit.centre_G_m.begin());
    std::copy_n(torque.x.data() + 3, 3, fit.zero_S_Nm.begin());
    fit.centre_sd_m = std::hypot(torque.sd.head<3>().maxCoeff() / fit.mass_kg,
                                 torque.x.head<3>().norm() / fit.mass_kg * fit.mass_sd_kg / fit.mass_kg);
    fit.zero_sd_Nm = torque.sd.tail<3>().maxCoeff();
    return fit;
}

}  // namespace tactiled::tool
