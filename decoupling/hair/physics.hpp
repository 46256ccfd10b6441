// Cao et al., eq. 1-14: sensitivities of a hair from its geometry, re-derived (decoupling/hair/README.md, "Errata").
// The hair is an arc of radius R over 120 degrees: at the angle t from its root it is at x = R sin t, y = R (1 - cos
// t), its tip at 1.5 R. The elastomer is a foundation that presses with q = k * displacement (N/m, so k is in N/m^2 =
// Pa), and the resistor, from 0 to 60 degrees, responds with pi_l times the mean bending stress 6 M / (w t^2) along
// its length.
#pragma once
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "decoupling/solve/parameters.hpp"

namespace tactiled {

struct Elastomer {
    std::string_view name;
    double young_kPa;
};
// Cao et al., their table of materials. These are starting points: with the hair's own stiffness (finite elements)
// the sensitivity to shear is not proportional to 1/E.
inline constexpr std::array<Elastomer, 3> kElastomers{{{"PDMS", 750}, {"Ecoflex", 250}, {"hydrogel", 150}}};

struct HairPhysics {
    double radius_m = 0.7162e-3;     // 1.5 mm over 120 degrees
    double width_m = 0.5e-3;         // w
    double thickness_m = 9e-6;       // t of the table; the text states 10 um
    double root_distance_m = 1e-3;   // L of eq. 7; not printed: an assumption
    double k_x_Pa = 4374;            // foundation modulus, unknown: chosen so that D_tau is the measured 7.91e-7
    double k_y_Pa = 11090;           // chosen so that D_sigma is the measured 3.74e-7
    double friction = 0.5;           // mu of eq. 7; an assumption
    double pi_l_per_Pa = 2 / 3.2e9;  // gauge factor 2 (metal) over the modulus of the polyimide
    double elastomer_kPa = 750;      // E
    double poisson = 0.49;           // G = E / 2 (1 + nu)
};

// The members as parameters of a calibration, for the loop and for the fit.
struct HairGeometry {
    Parameter parameter;
    double HairPhysics::*member;
};
inline constexpr std::array<HairGeometry, 10> kHairGeometry{
    {{{"radius_m", "of the hair's arc, m", kAboveZero, kLargest}, &HairPhysics::radius_m},
     {{"width_m", "of the hair, m", kAboveZero, kLargest}, &HairPhysics::width_m},
     {{"thickness_m", "of the hair, m", kAboveZero, kLargest}, &HairPhysics::thickness_m},
     {{"root_distance_m", "L of Cao et al., m", 0, kLargest}, &HairPhysics::root_distance_m},
     {{"k_x_Pa", "foundation modulus, N/m^2", kAboveZero, kLargest}, &HairPhysics::k_x_Pa},
     {{"k_y_Pa", "foundation modulus, N/m^2", kAboveZero, kLargest}, &HairPhysics::k_y_Pa},
     {{"friction", "mu", 0, kLargest}, &HairPhysics::friction},
     {{"pi_l_per_Pa", "piezoresistive coefficient, 1/Pa", kAboveZero, kLargest}, &HairPhysics::pi_l_per_Pa},
     {{"elastomer_kPa", "Young's modulus, kPa; PDMS 750, Ecoflex 250, hydrogel 150", kAboveZero, kLargest},
      &HairPhysics::elastomer_kPa},
     {{"poisson", "Poisson's ratio of the elastomer", 0, 0.5, HairPhysics{}.poisson}, &HairPhysics::poisson}}};

// Returns the parameters alone; `with_defaults`: with the values of HairPhysics as defaults, as a fit takes them.
constexpr std::array<Parameter, kHairGeometry.size()> hair_geometry_parameters(bool with_defaults) {
    std::array<Parameter, kHairGeometry.size()> parameters{};
    for (std::size_t i = 0; i < parameters.size(); ++i) {
        parameters[i] = kHairGeometry[i].parameter;
        if (with_defaults) parameters[i].fallback = HairPhysics{}.*kHairGeometry[i].member;
    }
    return parameters;
}

// setup
inline HairPhysics hair_physics(const CalibrationData& data) {
    HairPhysics physics;
    for (const HairGeometry& each : kHairGeometry) physics.*each.member = data[each.parameter.name];
    return physics;
}

// Mean of 3 (1/2 + cos t)^2 over 0 .. 60 degrees: a horizontal load per unit height, M = q a^2 / 2. 5.351225
inline constexpr double kHorizontalMean = 9 * (2 * std::numbers::pi + 5 * std::numbers::sqrt3) / (8 * std::numbers::pi);
// Mean of 3 (2 (1 - sin t)^2 - (sqrt(3)/2 - sin t)^2): a vertical load per unit width, with the arc beyond 60 degrees
// counted twice where it turns back (their eq. 9). 1.381157
inline constexpr double kVerticalMean = 3 * (14 * std::numbers::pi + 9 * std::numbers::sqrt3 - 48) / (8 * std::numbers::pi);

// pi_l R^2 / (w t^2), in m/N: dR/R0 at a mean factor of 1 and q = 1 N/m.
inline double reading_of_load_m_per_N(const HairPhysics& p) noexcept {
    const double slenderness = p.radius_m / p.thickness_m;
    return p.pi_l_per_Pa * slenderness * slenderness / p.width_m;
}

// D_tau, 1/Pa: eq. 1-5. The tip moves by 1.5 R tau / G.
inline double shear_sensitivity_per_Pa(const HairPhysics& p) noexcept {
    const double shear_modulus_Pa = 1e3 * p.elastomer_kPa / (2 * (1 + p.poisson));
    return kHorizontalMean * reading_of_load_m_per_N(p) * p.k_x_Pa * 1.5 * p.radius_m / shear_modulus_Pa;
}

// D_sigma, 1/Pa: eq. 6-13. The tip moves down by 1.5 R sigma / E, outwards by mu (sigma / E) (L + sqrt(3)/2 R).
inline double normal_sensitivity_per_Pa(const HairPhysics& p) noexcept {
    const double outwards_m = p.friction * (p.root_distance_m + std::numbers::sqrt3 / 2 * p.radius_m);
    return reading_of_load_m_per_N(p) / (1e3 * p.elastomer_kPa) *
           (kVerticalMean * p.k_y_Pa * 1.5 * p.radius_m + kHorizontalMean * p.k_x_Pa * outwards_m);
}

}  // namespace tactiled
