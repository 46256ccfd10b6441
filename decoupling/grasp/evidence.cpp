#include "decoupling/grasp/evidence.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled::grasp {
namespace {

constexpr double kDead = 0.25;        // part of the load that follows from the other jaws
constexpr double kSeen = 6;           // in sd of a sensor: a smaller load is not evaluated
constexpr double kNoises = 3;         // the tolerance of a share grows by this many sd of a sensor
constexpr double kFaces = -0.2;       // largest cosine between the normals of two jaws that hold an object between them
constexpr double kPressLeaks = 0.01;  // sd of the shear that a press causes in the reading; kLeak is its largest value
constexpr double kUnseen_N2 = 1e12;   // variance of a component that the sensor does not measure
constexpr double kExplains = 0.85;    // minimum cosine between a jaw's normal and the force that its error would explain

// The load on a jaw along its axis, minus the rest before the lift where that was observed; NaN where the sensor does
// not measure it.
double load_N(const JawForces& jaw) noexcept {
    double load = 0;
    for (int k = 0; k < 2; ++k) {
        if (std::abs(jaw.axis_S[k]) <= 1e-6) continue;  // a rotation was rounded; the component may not be measured
        const double rest_N = std::isfinite(jaw.rest_S_N[k]) ? jaw.rest_S_N[k] : 0;
        load += jaw.axis_S[k] * (jaw.force_S_N[k] - rest_N);
    }
    return load;
}

double sd_N(const JawForces& jaw) noexcept {
    double variance_N2 = 0;
    for (int k = 0; k < 2; ++k)
        if (std::abs(jaw.axis_S[k]) > 1e-6) variance_N2 += std::pow(jaw.axis_S[k] * jaw.sd_N[k], 2);
    return std::sqrt(variance_N2);
}

double median(std::array<double, kMaxJaws> values, std::size_t n) noexcept {
    std::sort(values.begin(), values.begin() + std::ptrdiff_t(n));
    return (values[(n - 1) / 2] + values[n / 2]) / 2;
}

}  // namespace

Shares shares_of(std::span<const JawForces> jaws, std::span<const double, kMaxJaws> reference, double tolerance) noexcept {
    Shares shares;
    std::array<double, kMaxJaws> load{}, per_kg{}, sorted{};
    double sum_N = 0, size_N = 0, carries = 0;
    std::size_t n = 0;
    bool rested = true;
    for (std::size_t j = 0; j < jaws.size(); ++j) {
        load[j] = jaws[j].carries_m_s2 > 0 ? load_N(jaws[j]) : kNaN;
        if (!std::isfinite(load[j])) continue;
        per_kg[j] = load[j] / jaws[j].carries_m_s2;
        sorted[n++] = per_kg[j];
        sum_N += load[j];
        size_N += std::abs(load[j]);
        carries += jaws[j].carries_m_s2;
        rested &= !std::isnan(jaws[j].rest_S_N.sum());
    }
    if (n < 2 || !(size_N > 0)) return shares;
    shares.known = true;
    const double scale_N = size_N / double(n), middle = median(sorted, n);
    const double allowed = rested ? tolerance : 2 * tolerance;  // these loads contain the press of the closing, too
    bool contradicts = false;
    std::array<double, kMaxJaws> from_middle{};
    for (std::size_t j = 0; j < jaws.size(); ++j) {
        if (!std::isfinite(load[j])) continue;
        const double expected_N = jaws[j].carries_m_s2 / carries * sum_N, noise_N = sd_N(jaws[j]);
        shares.off[j] = (load[j] - expected_N) / scale_N;
        const double off = std::abs(shares.off[j] - reference[j]), limit = std::hypot(allowed, kNoises * noise_N / scale_N);
        shares.max_off = std::max(shares.max_off, off);
        contradicts |= !(off <= limit);
        from_middle[j] = std::abs(per_kg[j] - middle) * jaws[j].carries_m_s2 / scale_N;
        const double others_N = jaws[j].carries_m_s2 / (carries - jaws[j].carries_m_s2) * (sum_N - load[j]);
        if (std::abs(others_N) > kSeen * noise_N && std::abs(load[j]) < kDead * std::abs(others_N)) shares.dead |= 1u << j;
    }
    if (!contradicts) {
        shares.dead = 0;
        return shares;
    }
    const double farthest = *std::max_element(from_middle.begin(), from_middle.end());
    for (std::size_t j = 0; j < jaws.size(); ++j)
        if (std::isfinite(load[j]) && from_middle[j] >= 0.75 * farthest) shares.jaws |= 1u << j;
    if (shares.dead != 0) shares.jaws = shares.dead;
    return shares;
}

bool jaws_face_each_other(std::span<const JawForces> jaws) noexcept {
    for (const JawForces& jaw : jaws) {
        const Eigen::Vector3d normal_G = jaw.S_from_G.row(2).transpose();
        if (std::none_of(jaws.begin(), jaws.end(),
                         [&](const JawForces& other) { return normal_G.dot(other.S_from_G.row(2).transpose()) < kFaces; }))
            return false;
    }
    return !jaws.empty();
}

Balance balance_of(std::span<const JawForces> jaws, const Eigen::Vector3d& gravity_G, const Eigen::Vector3d& reference_G,
                   double gain_sd, double expected_N) noexcept {
    Balance balance;
    Eigen::Vector3d sum_G = Eigen::Vector3d::Zero();
    for (const JawForces& jaw : jaws) {
        Eigen::Vector3d force_S = jaw.force_S_N;
        for (int k = 0; k < 3; ++k)
            if (!std::isfinite(force_S[k])) force_S[k] = 0;
        balance.presses_N += std::max(0.0, -force_S.z());
        sum_G += jaw.S_from_G.transpose() * force_S;
    }
    if (!(balance.presses_N > 0) || !sum_G.allFinite()) return {};
    const Eigen::Vector3d down_G = gravity_G.normalized();
    sum_G -= sum_G.dot(down_G) * down_G;
    balance.off_G = sum_G / balance.presses_N;
    sum_G -= balance.presses_N * reference_G;
    balance.across_N = std::max(0.0, sum_G.norm() - expected_N);
    if (!(balance.across_N > 0)) return balance;
    const Eigen::Vector3d unit_G = sum_G.normalized();
    double variance_N2 = 0, best = 0;
    for (const JawForces& jaw : jaws) {
        const Eigen::Vector3d unit_S = jaw.S_from_G * unit_G;
        for (int k = 0; k < 3; ++k) {
            const double by_press_N = (k == 2 ? gain_sd : kPressLeaks) * std::max(0.0, -jaw.force_S_N.z());
            const double sd = std::hypot(jaw.sd_N[k], by_press_N);
            variance_N2 += unit_S[k] * unit_S[k] * (std::isfinite(jaw.force_S_N[k] + sd) ? sd * sd : kUnseen_N2);
        }
        best = std::max(best, std::abs(unit_S.z()));
    }
    balance.sds = balance.across_N / std::sqrt(std::max(variance_N2, 1e-30));
    for (std::size_t j = 0; j < jaws.size(); ++j)
        if (std::abs((jaws[j].S_from_G * unit_G).z()) >= std::max(kExplains, 0.95 * best)) balance.jaws |= 1u << j;
    return balance;
}

}  // namespace tactiled::grasp
