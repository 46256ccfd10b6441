// Response of each gauge to 1 N at any point of the plate: finite-element strains on a polar grid, with a bicubic
// spline in between.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "config/calibration.hpp"

namespace tactiled {

// Gauges x (Fx, Fy, +Fz): reading per N.
using Influence = Eigen::Matrix<double, 8, 3>;

class InfluenceMap {
public:
    // Returns the fault of `rows`, "" if there is none. `rows`: x_m y_m, then for R1 .. R8 the strain per N of Fx, Fy
    // and Fz, on a polar grid: the centre and rings of equal spacing with an even number of points at equal angles,
    // the first at 0 degrees, in any order. setup
    static std::string fault_of(const std::vector<std::vector<double>>& rows);

    // `gain[i]`: reading per strain of row i of the result, and `gauge[i]` its gauge (0 = R1); -1 = no such row,
    // zeros. setup
    InfluenceMap(const std::vector<std::vector<double>>& rows, const std::array<int, 8>& gauge,
                 const std::array<double, 8>& gain);

    struct At {
        Influence value, dx, dy;  // per N, per N and m
    };
    // Evaluates the map at any finite point. Beyond the outermost ring the last cell continues; the centre is
    // continuous. rt: bounded, no allocation
    void at(double x_m, double y_m, At& at) const noexcept;

    [[nodiscard]] double radius_m() const noexcept { return spacing_m_ * n_rings_; }
    [[nodiscard]] double spacing_m() const noexcept { return spacing_m_; }
    // Returns the mean over the plate: the response to a load that is uniform over it, by superposition. setup
    [[nodiscard]] Influence mean() const;

private:
    static constexpr int kValues = 24;
    [[nodiscard]] const double* coefficient(int ring, int angle) const noexcept {
        return &coefficients_[std::size_t(((ring + 1) * n_angles_ + angle) * kValues)];
    }
    double spacing_m_;
    int n_rings_, n_angles_;
    std::vector<double> coefficients_;  // B-spline coefficients: ring -1 .. n_rings + 1, angle, (Fx, Fy, Fz) x gauge
};

// Returns the map of a calibration of method "map", with rows in the order of its channels and in its unit; nothing
// with `fault` set if it has none. setup
std::optional<InfluenceMap> influence_of(const Calibration& calibration, std::string& fault);

}  // namespace tactiled
