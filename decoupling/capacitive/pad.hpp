// Deformation of the soft pad between the electrodes. `closeness` u = d0 / d is 1 at rest and above 1 under a press;
// a plate capacitance is proportional to it.
#pragma once
#include <cmath>

namespace tactiled {

// A pad cannot be pressed to a fifth of its thickness or stretched to five times of it: u is limited.
inline constexpr double kMinCloseness = 0.2, kMaxCloseness = 5;

// Apparent modulus (Pa) of a disc bonded on both faces: Gent and Lindley 1959, E (1 + 2 S^2), in series with the bulk
// modulus. shape = radius / (2 thickness). The bulk modulus is the parameter, not Poisson's ratio, because near 0.5
// the modulus would depend on the sixth digit of the ratio (hard case H23).
inline double bonded_disc_modulus(double young_Pa, double bulk_Pa, double shape) noexcept {
    const double apparent = young_Pa * (1 + 2 * shape * shape);
    return apparent / (1 + apparent / bulk_Pa);
}

struct PadLaw {
    double normal_stiffness_N;  // apparent modulus times area: d(press)/d(closeness) at rest
    double stiffening;          // exponent q, -2 .. 1; 0 = neo-Hookean
    double shear_stiffness;     // N per unit of shift, at rest
    double shear_gap_exponent;  // p: shear stiffness * u^p; 1 = G A / d
    double gap = 0;             // d0, in the unit of shift; 0 = the influence of a shear on the press is neglected

    // Press in N, > 0 under a press: K/3 (u^2 - 1/u) u^q with v = u - 1, monotone for every u > 0 if -2 <= q <= 1. For q = 0
    // this is neo-Hookean compression, nominal stress E/3 (1/lambda^2 - lambda), lambda = 1/u. rt: wait-free
    [[nodiscard]] double press_N(double v) const noexcept {
        const double u = 1 + v;
        return normal_stiffness_N * v * (u * u + u + 1) / (3 * u) * power(u, stiffening);
    }
    // Contribution of a shift to the press at that closeness, N: a pad that stores k(u) shift^2 / 2 pushes back if k rises
    // as it closes, -d/dd of that energy = p k(u) u shift^2 / 2 d0. It has no parameter of its own. rt: wait-free
    [[nodiscard]] double press_by_shift_N(double v, double shift2) const noexcept {
        if (!(gap > 0)) return 0;
        return 0.5 * shear_gap_exponent * shear_stiffness_at(v) * (1 + v) * shift2 / gap;
    }
    // rt: wait-free
    [[nodiscard]] double shear_stiffness_at(double v) const noexcept {
        return shear_stiffness * power(1 + v, shear_gap_exponent);
    }

private:
    static double power(double u, double exponent) noexcept { return exponent == 0 ? 1.0 : std::pow(u, exponent); }
};

}  // namespace tactiled
