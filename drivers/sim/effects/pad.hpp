// Geometry of the capacitive sensor: the effect of press, shift and tilt of the upper electrode on each of the lower
// ones.
//
// The linear model gives channel = rest + active (1 + a + e), a and e the relative changes of area and gap to first order.
// The effects add to it in the order of the chain:
//     exact_overlap    a -> A(shift) / A(0) - 1
//     load_moment      + the electrode's own strain by the tilt
//     gap_gain         (all but e) -> (all but e) / (1 - e)
//     tilt, fringe_field   times a factor of the gap
// so exact_overlap and gap_gain together give rest + active A(shift) / A(0) * gap(0) / gap, and each alone leaves the other
// part linear.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

struct Pad {
    static constexpr std::size_t kMax = 5;
    static constexpr double kMaxStrain = 0.8;  // the pad prevents a gap below a fifth of the gap at rest
    static constexpr double kMaxShift = 0.9;   // relative to the disc's radius

    struct Electrode {
        double inner_m, outer_m, centre_rad, opening_rad;
    };

    std::size_t n = 0;
    std::array<std::size_t, kMax> channel{};
    std::array<double, kMax> active_pF{}, rest_pF{};  // the part that depends on the gap, and the rest of the zero
    std::array<Electrode, kMax> electrode{};
    std::array<double, kMax> x_m{}, y_m{}, radius_m{};  // its centroid; radius of a disc of the same area
    double disc_m, gap_m, strain_per_N, shift_per_N_m;
    double tilt_rad_per_Nm;

    explicit Pad(const Sensor& sensor)
        : disc_m(sensor.capacitive.disc_radius_m),
          gap_m(sensor.capacitive.gap_m),
          strain_per_N(sensor.capacitive.strain_per_N),
          shift_per_N_m(sensor.capacitive.shift_per_N_m) {
        const CapacitiveSample& c = sensor.capacitive;
        constexpr std::array angle{0.0, 1.0, 0.5, -0.5};  // C1 +x, C2 -x, C3 +y, C4 -y; of pi
        for (std::size_t i = 0; i < kMax; ++i) {
            constexpr std::array<const char*, kMax> name{"C1", "C2", "C3", "C4", "Cn"};
            const std::size_t k = sensor.find(name[i]);
            if (k >= sensor.n()) continue;
            const bool sector = i < 4;
            channel[n] = k;
            active_pF[n] = sector ? c.sector_pF : c.centre_pF;
            rest_pF[n] = sensor.zero[k] - active_pF[n];
            electrode[n] = sector ? Electrode{c.inner_radius_m, c.outer_radius_m, angle[i] * std::numbers::pi, c.opening_rad}
                                  : Electrode{0, c.centre_radius_m, 0, 2 * std::numbers::pi};
            const double in = electrode[n].inner_m, out = std::clamp(disc_m, in, electrode[n].outer_m);
            const double half = electrode[n].opening_rad / 2, area = half * (out - in) * (out + in);
            radius_m[n] = std::max(std::sqrt(area / std::numbers::pi), 1e-6);
            if (sector && area > 0) {
                const double centroid = 2 * std::sin(half) * (out * out * out - in * in * in) / (3 * area);
                x_m[n] = centroid * std::cos(electrode[n].centre_rad);
                y_m[n] = centroid * std::sin(electrode[n].centre_rad);
            }
            ++n;
        }
        // A bonded disc's apparent modulus is E (1 + 2 S^2) to a press (Gent, Lindley 1959) and E (1 + 2 S^2 / 3) to a tilt
        // (the same lubrication argument, derived): tilt = moment * gap / (modulus * pi R^4 / 4).
        const double S2 = disc_m * disc_m / (4 * gap_m * gap_m);
        tilt_rad_per_Nm = strain_per_N * gap_m * 4 / (disc_m * disc_m) * (1 + 2 * S2) / (1 + 2 * S2 / 3);
    }

    // > 0 under a press
    [[nodiscard]] double strain(double fz_N) const noexcept { return -strain_per_N * fz_N; }
    // gap at rest / gap
    [[nodiscard]] static double closeness(double strain) noexcept { return 1 / (1 - std::min(strain, kMaxStrain)); }
    // Strain of electrode i by the tilt under 1 N of press at (x, y), 1/N; largest over the signs of x and y if they
    // are bounds.
    [[nodiscard]] double tilt_strain(std::size_t i, double x, double y) const noexcept {
        return tilt_rad_per_Nm / gap_m * (std::abs(x_m[i]) * x + std::abs(y_m[i]) * y);
    }
    // Upper limit of |overlap_change| for a shift up to this: per metre of shift the area changes by the width of the
    // moving edge within the sector, which is the sector's width where the edge is farthest out plus the inclination
    // of the edge.
    [[nodiscard]] double largest_overlap(std::size_t i, double shift) const noexcept {
        const Electrode& e = electrode[i];
        const double s = std::min(shift, kMaxShift * disc_m), rest = area_at_rest(e);
        if (!(rest > 0) || disc_m - s >= e.outer_m) return 0;
        const double out = std::min(disc_m + s, e.outer_m);
        const double width = e.opening_rad < std::numbers::pi ? 2 * out * std::sin(e.opening_rad / 2) + 2 * s : 2 * out;
        return width * s / rest;
    }
    // A(shift) / A(0) - 1. rt: wait-free
    [[nodiscard]] double overlap_change(std::size_t i, double dx_m, double dy_m) const noexcept {
        const double rest = area_at_rest(electrode[i]);
        return rest > 0 ? area_change(electrode[i], disc_m, dx_m, dy_m) / rest : 0;
    }

    [[nodiscard]] double area_at_rest(const Electrode& e) const noexcept {
        const double out = std::clamp(disc_m, e.inner_m, e.outer_m);
        return e.opening_rad / 2 * (out - e.inner_m) * (out + e.inner_m);
    }

    // Area that a disc shares with the electrode after its shift, minus that before. With t from the shift's
    // direction, u = delta sin t, S = sqrt((R - u)(R + u)) the edge is at rho = delta cos t + S, and 1/2 rho^2 has an
    // integral; where the edge is beyond the electrode's inner or outer edge, the electrode's edge counts.
    static double area_change(const Electrode& e, double R, double dx, double dy) noexcept {
        double delta = std::hypot(dx, dy);
        if (!(delta > 0)) return 0;
        delta = std::min(delta, kMaxShift * R);
        const double centre = std::remainder(e.centre_rad - std::atan2(dy, dx), 2 * std::numbers::pi);
        const double from = centre - e.opening_rad / 2, to = centre + e.opening_rad / 2;
        std::array<double, 14> cut;
        std::size_t cuts = 0;
        cut[cuts++] = from;
        for (const double a : {e.inner_m, e.outer_m}) {
            const double cosine = (a * a + delta * delta - R * R) / (2 * a * delta);
            if (!(std::abs(cosine) < 1)) continue;  // also skips a = 0
            for (const double t : {std::acos(cosine), -std::acos(cosine)})
                for (const double turn : {-2 * std::numbers::pi, 0.0, 2 * std::numbers::pi})
                    if (t + turn > from && t + turn < to) cut[cuts++] = t + turn;
        }
        cut[cuts++] = to;
        std::sort(cut.begin(), cut.begin() + std::ptrdiff_t(cuts));

        const double before = std::clamp(R, e.inner_m, e.outer_m);
        double change = 0;
        for (std::size_t i = 0; i + 1 < cuts; ++i) {
            const double t1 = cut[i], t2 = cut[i + 1], middle = (t1 + t2) / 2, u = delta * std::sin(middle);
            const double rho = delta * std::cos(middle) + std::sqrt((R - u) * (R + u));
            double edge = R;
            if (rho <= e.inner_m) {
                edge = e.inner_m;
            } else if (rho >= e.outer_m) {
                edge = e.outer_m;
            } else {
                const double u1 = delta * std::sin(t1), S1 = std::sqrt((R - u1) * (R + u1));
                const double u2 = delta * std::sin(t2), S2 = std::sqrt((R - u2) * (R + u2));
                change += (delta * delta * std::cos(t1 + t2) * std::sin(t2 - t1) + u2 * S2 - u1 * S1 +
                           R * R * (std::atan2(u2, S2) - std::atan2(u1, S1))) /
                          2;
            }
            change += (edge - before) * (edge + before) / 2 * (t2 - t1);
        }
        return change;
    }
};

}  // namespace tactiled::sim
