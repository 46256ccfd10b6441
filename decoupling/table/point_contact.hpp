// Computes place and force of one point of contact on the plate from the gauges and the influence map. There are five
// unknowns; at a given point the force is linear (variable projection: Golub and Pereyra 1973, in Kaufman's form of
// 1975).
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "decoupling/table/influence_map.hpp"

namespace tactiled {

using Gauges = Eigen::Matrix<double, 8, 1>;

struct PointContact {
    Eigen::Vector2d point_m = Eigen::Vector2d::Zero();
    Eigen::Vector3d force_N = Eigen::Vector3d::Zero();
    double squares = 0;      // squared residual, reading units squared
    bool at_rim = false;     // limited to the rim, because the readings indicate a point further out
    bool converged = false;  // the last step was below 1 um
    double damping = 1e-4;   // damping of the next step
    // One standard deviation: force (N), moments mx my (Nm). Filled by deviations().
    std::array<double, 5> sd{};
    std::array<double, 2> point_sd_m{};
    double force_sd_N = 0;  // one sd of the force's vector, from the slope alone
    // the direction in which the gauges determine the point worst, from the slope alone
    Eigen::Vector2d worst = Eigen::Vector2d::Zero();
};

inline PointContact contact_at(const Eigen::Vector2d& point_m) noexcept {
    PointContact contact;
    contact.point_m = point_m;
    return contact;
}

class PointSolver {
public:
    explicit PointSolver(InfluenceMap map);  // setup

    // Iterates from the point and the damping of `start`, with at most `steps` evaluations of the map. Rows of `y`
    // outside of `usable` are ignored.
    // rt: bounded by steps
    [[nodiscard]] PointContact refine(const Gauges& y, std::uint32_t usable, const PointContact& start,
                                      int steps) const noexcept;
    // Fills `contact.sd` for readings of this variance; infinite if the gauges do not determine it. If the force is
    // curved along the direction that the gauges determine worst, its change over two standard deviations counts, not
    // only its slope.
    // rt: wait-free
    void sds(const Gauges& y, std::uint32_t usable, double variance, PointContact& contact) const noexcept;
    // Returns an orthonormal basis of the gauge readings for forces at a point. setup
    [[nodiscard]] Influence basis(const Eigen::Vector2d& point_m) const noexcept;

    [[nodiscard]] const InfluenceMap& map() const noexcept { return map_; }

private:
    InfluenceMap map_;
};

}  // namespace tactiled
