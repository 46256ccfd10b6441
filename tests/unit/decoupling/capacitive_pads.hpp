// Hand-made capacitive sensors and the readings of their electrodes: the thesis' curves; a pad with gap and shift.
#pragma once
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "config/calibration.hpp"

namespace tactiled {

inline constexpr double kHalfTurn_rad = 3.14159265358979323846;
inline const std::vector<std::string> kChannels{"C1", "C2", "C3", "C4", "Cn"};

inline Calibration capacitive_calibration(const std::string& method) {
    Calibration calibration;
    calibration.path = "pad.toml";
    calibration.model = "capacitive";
    calibration.method = method;
    calibration.channels = kChannels;
    calibration.components = {"fx", "fy", "fz"};
    calibration.sd = {0.01, 0.01, 0.05};
    return calibration;
}

// The thesis' curves: eq. XXXIII for Cn, eq. XXXIV for each side electrode, without the influence of a press, as
// printed.
inline Calibration thesis_calibration() {
    Calibration calibration = capacitive_calibration("quadratic");
    calibration.zero = {1.2285, 1.2285, 1.2285, 1.2285, 1.3039};
    calibration.parameters = {{"normal_b", 0.0405}, {"normal_a", 0.0008}, {"normal_range_N", 10.0}, {"shear_range_N", 1.2}};
    calibration.tables["side"] = {4, {0.038, 0.0071, 0, 0}};
    return calibration;
}

// The reading of the thesis' sensor, from the printed equations.
inline std::vector<double> thesis_reading(double fx, double fy, double press) {
    const auto side = [](double F) { return 0.0071 * F * F + 0.038 * F + 1.2285; };
    return {side(fx), side(-fx), side(fy), side(-fy), 0.0008 * press * press + 0.0405 * press + 1.3039};
}

// Hand-made constants: a pad over electrodes of the finite-element model, with stray capacitance.
inline Calibration overlap_calibration() {
    Calibration calibration = capacitive_calibration("overlap");
    calibration.zero = {0.0562 + 0.3, 0.0562 + 0.31, 0.0562 + 0.29, 0.0562 + 0.3, 0.1038 + 0.4};
    calibration.parameters = {{"stray_C1", 0.3},
                              {"stray_C2", 0.31},
                              {"stray_C3", 0.29},
                              {"stray_C4", 0.3},
                              {"stray_Cn", 0.4},
                              {"normal_stiffness_N", 31},
                              {"stiffening", 0.1},
                              {"shear_stiffness_N_per_m", 1195},
                              {"shear_gap_exponent", -0.4},
                              {"noise", 1e-5},
                              {"disc_radius_m", 4e-3},
                              {"inner_radius_m", 2.5e-3},
                              {"outer_radius_m", 6e-3},
                              {"opening_rad", 80 * kHalfTurn_rad / 180},
                              {"centre_radius_m", 2e-3},
                              {"gap_m", 3e-3}};
    return calibration;
}

// Area that a disc of radius R at (dx, dy) shares with a sector, by quadrature over the angle; uses the edge and no
// closed form.
inline double sector_area_mm2(double R, double inner, double outer, double centre, double opening, double dx, double dy) {
    const int n = 400;
    const double d = std::hypot(dx, dy), phi = std::atan2(dy, dx);
    double sum = 0;
    for (int i = 0; i < n; ++i) {
        const double t = centre - opening / 2 + (i + 0.5) * opening / n - phi;
        const double edge = std::clamp(d * std::cos(t) + std::sqrt(R * R - std::pow(d * std::sin(t), 2)), inner, outer);
        sum += 0.5 * (edge * edge - inner * inner) * opening / n;
    }
    return sum;
}

// The readings of the electrodes of overlap_calibration(), pF, for closeness u and a shift in mm.
inline std::vector<double> pad_reading(const Calibration& calibration, double u, double dx, double dy) {
    std::vector<double> reading;
    const double rest = sector_area_mm2(4, 2.5, 6, 0, 80 * kHalfTurn_rad / 180, 0, 0);
    const double centres[] = {0, kHalfTurn_rad, kHalfTurn_rad / 2, -kHalfTurn_rad / 2};
    for (std::size_t e = 0; e < 4; ++e) {
        const double area = sector_area_mm2(4, 2.5, 6, centres[e], 80 * kHalfTurn_rad / 180, dx, dy);
        reading.push_back(calibration.parameters.at("stray_" + kChannels[e]) + 0.0562 * u * area / rest);
    }
    reading.push_back(0.4 + 0.1038 * u * sector_area_mm2(4, 0, 2, 0, 2 * kHalfTurn_rad, dx, dy) / (4 * kHalfTurn_rad));
    return reading;
}

struct Pad {
    double fx, fy, fz;
};
inline Pad pad_force(double u, double dx_mm, double dy_mm) {
    const double k = 1.195 * std::pow(u, -0.4);
    const double lift = 0.5 * 0.4 * k * u * (dx_mm * dx_mm + dy_mm * dy_mm) / 3;  // half p k u shift^2 / gap
    return {k * dx_mm, k * dy_mm, -31.0 / 3 * (u * u - 1 / u) * std::pow(u, 0.1) + lift};
}

}  // namespace tactiled
