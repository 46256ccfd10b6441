// One point of contact on the plate: where it is and its force, from the gauges and the influence map. Five unknowns; at
// a given point the force is linear (variable projection: Golub and Pereyra 1973, in Kaufman's form of 1975).
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "decoupling/influence_map.hpp"

namespace tactiled {

using Gauges = Eigen::Matrix<double, 8, 1>;

struct PointContact {
    Eigen::Vector2d point_m = Eigen::Vector2d::Zero();
    Eigen::Vector3d force_N = Eigen::Vector3d::Zero();
    double squares = 0;      // of what it leaves unexplained, reading units squared
    bool at_rim = false;     // held there: the readings would have it further out
    bool converged = false;  // the last step was below 1 um
    // One standard deviation for readings of one: force (N), moments mx my (Nm). Filled by deviations().
    std::array<double, 5> sd{};
};

class PointSolver {
public:
    explicit PointSolver(InfluenceMap map);  // setup

    // From `start` downhill, at most `steps` evaluations of the map. Rows of `y` outside of `usable` are ignored.
    // rt: bounded by steps
    [[nodiscard]] PointContact refine(const Gauges& y, std::uint32_t usable, const Eigen::Vector2d& start,
                                      int steps) const noexcept;
    // From the best points of a grid over the plate. `other_squares`: of the best minimum elsewhere, infinite where there is
    // none. rt: bounded by the grid, some 50 us
    [[nodiscard]] PointContact search(const Gauges& y, std::uint32_t usable, double& other_squares) const noexcept;
    // Fills `contact.sd`; infinite where the gauges do not tell. rt: wait-free
    void deviations(std::uint32_t usable, PointContact& contact) const noexcept;

    [[nodiscard]] const InfluenceMap& map() const noexcept { return map_; }

private:
    struct Start {
        Eigen::Vector2d point_m;
        Influence value, q;  // q: an orthonormal basis of value's columns
    };
    InfluenceMap map_;
    std::vector<Start> starts_;
};

}  // namespace tactiled
