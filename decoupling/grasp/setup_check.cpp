#include "decoupling/grasp/setup_check.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace tactiled::grasp {
namespace {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

constexpr double kAgrees = 0.5;    // a jaw's part of the weight: more contradicts the configuration
constexpr double kSuspect = 0.25;  // the same: more contradicts it, if one error explains it
constexpr double kBetter = 0.25;   // an error explains the readings if it leaves less than this part of the squares
constexpr double kShare = 0.2;     // share, between configured and measured value
constexpr double kSum = 0.15;      // part of the weight, between the sum of the forces and the known mass
constexpr double kDead = 0.1;      // part of the load of the others
constexpr double kWellAbove = 2;   // minimum press for a reliable contact, in units of contact_on_N
constexpr double kSymmetry = 1e-9;

Vector3 eigen(const Vector& v) { return {v[0], v[1], v[2]}; }
Matrix3 eigen(const std::array<Vector, 3>& rows) {
    Matrix3 m;
    for (int r = 0; r < 3; ++r) m.row(r) = eigen(rows[std::size_t(r)]).transpose();
    return m;
}

// One error of the configuration, stated as the corrected value.
struct Hypothesis {
    bool gravity_reversed = false;
    std::optional<std::size_t> turned{};
    int degrees = 0;
    std::optional<std::array<std::size_t, 2>> exchanged{};
};

Matrix3 about_z(int degrees) {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vector3::UnitZ()).toRotationMatrix();
}

std::vector<Matrix3> frames_of(const GuidedGrasp& seen, const Hypothesis& h) {
    std::vector<Matrix3> frames;
    for (const CheckedJaw& jaw : seen.jaws) frames.push_back(eigen(jaw.S_from_G));
    if (h.turned) frames[*h.turned] = about_z(h.degrees).transpose() * frames[*h.turned];
    if (h.exchanged) std::swap(frames[(*h.exchanged)[0]], frames[(*h.exchanged)[1]]);
    return frames;
}

double share_of(const GuidedGrasp& seen, std::size_t j) {
    return seen.jaws[j].share > 0 ? seen.jaws[j].share : 1.0 / seen.jaws_of_gripper;
}

// Gravity of the tilted hand. The user turned the hand by the names of the jaws in the configuration.
Vector3 tilted_gravity(const GuidedGrasp& seen, const Vector3& down_G) {
    if (eigen(seen.tilted_gravity_G_m_s2).norm() > 0) {
        const double sign = down_G.dot(eigen(seen.gravity_G_m_s2)) < 0 ? -1 : 1;
        return sign * eigen(seen.tilted_gravity_G_m_s2);
    }
    const Vector3 down = down_G.normalized();
    Vector3 to_jaw = -eigen(seen.jaws[seen.lower_jaw].S_from_G[2]);  // the object is in front of its skin
    to_jaw = (to_jaw - to_jaw.dot(down) * down).normalized();
    return down_G.norm() * (std::cos(seen.tilt_rad) * down + std::sin(seen.tilt_rad) * to_jaw);
}

// Maximum and sum of squares of the residuals of the readings, relative to the weight on one jaw.
struct Misfit {
    double max = 0, squares = 0;
    void add(double off) {
        max = std::max(max, std::abs(off));
        squares += off * off;
    }
};

// The load along gravity is shared as configured. The load across gravity is shared by the unknown stiffnesses of normals
// and shears, so both are fitted, each not negative.
void add_pose(const GuidedGrasp& seen, const std::vector<Matrix3>& frames, const Vector3& palm_G, const Vector3& gravity_G,
              Vector CheckedJaw::*reading, Misfit& misfit) {
    const std::size_t n = seen.jaws.size();
    const double part_N = seen.mass_kg * gravity_G.norm() / seen.jaws_of_gripper;
    const Vector3 axial_G = gravity_G.dot(palm_G) * palm_G, across_G = gravity_G - axial_G;
    std::vector<Vector3> left(n), normal(n), lateral(n);
    double common_N = 0, nn = 0, nl = 0, tt = 0, tl = 0;
    for (std::size_t j = 0; j < n; ++j) {
        const CheckedJaw& jaw = seen.jaws[j];
        Vector3 axial = frames[j] * axial_G * (share_of(seen, j) * seen.mass_kg);
        axial.z() = 0;
        left[j] = eigen(jaw.*reading) - eigen(jaw.closed_N) - axial;
        common_N += left[j].z() / double(n);
        const Vector3 across = frames[j] * across_G * (seen.mass_kg / seen.jaws_of_gripper);
        normal[j] = {0, 0, across.z()};
        lateral[j] = {across.x(), across.y(), 0};
    }
    for (std::size_t j = 0; j < n; ++j) {
        if (n == seen.jaws_of_gripper) left[j].z() -= common_N;  // a squeeze that has grown on all jaws
        nn += normal[j].squaredNorm(), nl += normal[j].dot(left[j]);
        tt += lateral[j].squaredNorm(), tl += lateral[j].dot(left[j]);
    }
    const double by_normal = nn > kSymmetry ? std::clamp(nl / nn, 0.0, 4.0) : 0;
    const double by_shear = tt > kSymmetry ? std::clamp(tl / tt, 0.0, 4.0) : 0;
    for (std::size_t j = 0; j < n; ++j) {
        const Vector3 off = left[j] - by_normal * normal[j] - by_shear * lateral[j];
        misfit.add(off.head<2>().norm() / part_N);
        misfit.add(off.z() / part_N / 2);  // presses are larger, and so are their errors
    }
    // The jaws carry the whole weight.
    if (n != seen.jaws_of_gripper) return;
    Vector3 sum_G = -seen.mass_kg * gravity_G;
    for (std::size_t j = 0; j < n; ++j) {
        Vector3 moved = eigen(seen.jaws[j].*reading) - eigen(seen.jaws[j].closed_N);
        moved.z() -= common_N;
        sum_G += frames[j].transpose() * moved;
    }
    misfit.add(sum_G.norm() / part_N / double(n));
}

Misfit misfit_of(const GuidedGrasp& seen, const Hypothesis& h) {
    const std::vector<Matrix3> frames = frames_of(seen, h);
    const Vector3 down_G = (h.gravity_reversed ? -1 : 1) * eigen(seen.gravity_G_m_s2);
    // The load is shared along the axis that no skin faces: all normals are perpendicular to it.
    Vector3 palm_G = down_G.normalized();
    Misfit misfit;
    add_pose(seen, frames, palm_G, down_G, &CheckedJaw::lifted_N, misfit);
    add_pose(seen, frames, palm_G, tilted_gravity(seen, down_G), &CheckedJaw::tilted_N, misfit);
    return misfit;
}

std::vector<Hypothesis> hypotheses(const GuidedGrasp& seen) {
    std::vector<Hypothesis> all{{.gravity_reversed = true}};
    for (std::size_t j = 0; j < seen.jaws.size(); ++j) {
        for (const int degrees : {90, 180, 270}) all.push_back({.turned = j, .degrees = degrees});
        for (std::size_t other = j + 1; other < seen.jaws.size(); ++other) all.push_back({.exchanged = {{j, other}}});
    }
    return all;
}

// The load of each jaw along gravity while it was lifted, N.
std::vector<double> loads_of(const GuidedGrasp& seen) {
    std::vector<double> loads;
    for (const CheckedJaw& jaw : seen.jaws) {
        Vector3 axis = eigen(jaw.S_from_G) * eigen(seen.gravity_G_m_s2);
        axis.z() = 0;
        loads.push_back((eigen(jaw.lifted_N) - eigen(jaw.closed_N)).dot(axis.normalized()));
    }
    return loads;
}

void check_loads(const GuidedGrasp& seen, std::vector<SetupFinding>& found) {
    const std::vector<double> loads = loads_of(seen);
    const double weight_N = seen.mass_kg * eigen(seen.gravity_G_m_s2).norm();
    const bool all = seen.jaws.size() == seen.jaws_of_gripper;
    double sum_N = 0;
    for (const double load : loads) sum_N += load;
    for (std::size_t j = 0; j < loads.size() && loads.size() > 1; ++j) {
        const double others_N = (sum_N - loads[j]) / double(loads.size() - 1);
        if (std::abs(loads[j]) < kDead * others_N) found.push_back({.fault = SetupFault::dead, .jaw = j});
    }
    if (!found.empty()) return;
    if (all && std::abs(sum_N / weight_N - 1) > kSum) found.push_back({.fault = SetupFault::sum, .value = sum_N / weight_N});
    std::vector<double> shares;
    bool off = false;
    for (std::size_t j = 0; j < loads.size(); ++j) {
        shares.push_back(loads[j] / (all ? sum_N : weight_N));
        off |= std::abs(shares[j] - share_of(seen, j)) > kShare * share_of(seen, j);
    }
    if (off && loads.size() > 1) found.push_back({.fault = SetupFault::shares, .shares = shares});
}

}  // namespace

std::vector<SetupFinding> check_setup(const GuidedGrasp& seen) {
    std::vector<SetupFinding> found;
    for (std::size_t j = 0; j < seen.jaws.size(); ++j) {
        const CheckedJaw& jaw = seen.jaws[j];
        const double press_N = -jaw.closed_N[2];
        const bool beyond = jaw.full_scale_N > 0 && jaw.contact_on_N >= jaw.full_scale_N;
        if (beyond || kWellAbove * jaw.contact_on_N > press_N)
            found.push_back({.fault = SetupFault::contact, .jaw = j, .value = press_N});
    }
    const Misfit as_configured = misfit_of(seen, {});
    if (as_configured.max > kSuspect) {
        const Hypothesis* best = nullptr;
        const std::vector<Hypothesis> all = hypotheses(seen);
        Misfit best_misfit = as_configured;
        for (const Hypothesis& h : all)
            if (const Misfit misfit = misfit_of(seen, h); misfit.squares < best_misfit.squares)
                best = &h, best_misfit = misfit;
        if (best != nullptr && best_misfit.max < kAgrees && best_misfit.squares < kBetter * as_configured.squares) {
            SetupFinding finding{.fault = best->gravity_reversed ? SetupFault::gravity_sign
                                          : best->turned         ? SetupFault::turned
                                                                 : SetupFault::exchanged};
            if (best->turned) {
                finding.jaw = *best->turned;
                finding.degrees = best->degrees;
                const Vector3 x = frames_of(seen, *best)[finding.jaw].row(0).transpose();
                finding.x_S_in_G = {x.x(), x.y(), x.z()};
            }
            if (best->exchanged) finding.jaw = (*best->exchanged)[0], finding.other = (*best->exchanged)[1];
            found.push_back(finding);
            return found;  // loads are those of a wrong set-up
        }
    }
    const std::size_t before = found.size();
    check_loads(seen, found);
    if (as_configured.max > kAgrees && found.size() == before) found.push_back({.fault = SetupFault::unexplained});
    return found;
}

}  // namespace tactiled::grasp
