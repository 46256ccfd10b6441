// The common parts of the fits of model "capacitive". decoupling/capacitive/README.md lists the fitted and the stated
// parameters. The readings of a pad's electrodes at a given force, with derivatives by its unknowns:
//
//     C_k = zero_k + active_k (v + (1 + v) dA_k(dx, dy)),    press(v, dx, dy) = N,    (dx, dy) = (fx, fy) / k_s(v)
//
// T is double, or a dual number such as ceres::Jet with its value in `.a`.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>

#include "decoupling/capacitive/electrodes.hpp"
#include "decoupling/capacitive/pad.hpp"
#include "decoupling/fit/fit.hpp"

namespace tactiled {

enum CapacitiveUnknown {
    kZero = 0,
    kLogActive = 5,
    kLogStiffness = 10,
    kStiffening = 11,
    kLogShear = 12,
    kExponent = 13,
    kUnknowns = 14
};

// Returns the press at v under a shear force.
inline double press_at(const PadLaw& law, double v, double shear_N) {
    const double shift = shear_N / law.shear_stiffness_at(v);
    return law.press_N(v) + law.press_by_shift_N(v, shift * shift);
}

// Returns the v at which the pad of that law carries press and shear. The law is monotone in the relevant range, so
// bisection in log u is used; 60 halvings.
inline double compression(double press_N, double shear_N, const PadLaw& law) {
    double low = std::log(kMinCloseness), high = std::log(kMaxCloseness);
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (press_at(law, std::expm1(middle), shear_N) < press_N ? low : high) = middle;
    }
    return std::expm1(0.5 * (low + high));
}

inline double number(double x) { return x; }
template <typename Jet>
double number(const Jet& x) {
    return x.a;
}

struct CapacitiveModel {
    // nullptr: first order, shift in units of the length over which an electrode doubles
    const ElectrodeGeometry* geometry;

    // Returns the five capacitances at fx fy fz.
    template <typename T>
    void operator()(const T* p, const Wrench& force, T* reading) const {
        using std::exp;
        using std::hypot;
        using std::log1p;
        const double gap = geometry != nullptr ? geometry->gap_m / geometry->disc_radius_m : 0;
        const PadLaw law{std::exp(number(p[kLogStiffness])), number(p[kStiffening]), std::exp(number(p[kLogShear])),
                         number(p[kExponent]), gap};
        const double shear_N = std::hypot(force[0], force[1]);
        const double v0 = compression(-force[2], shear_N, law);
        // v as a function of the unknowns: one Newton step from the solution gives the right derivative.
        const double h = 1e-6 * (1 + v0);
        const double slope = (press_at(law, v0 + h, shear_N) - press_at(law, v0 - h, shear_N)) / (2 * h);
        const double u0 = 1 + v0;
        T press = exp(p[kLogStiffness] + p[kStiffening] * std::log(u0)) * (v0 * (u0 * u0 + u0 + 1) / (3 * u0));
        if (gap > 0)
            press += p[kExponent] * exp(-p[kLogShear] - p[kExponent] * std::log(u0)) * (0.5 * u0 * shear_N * shear_N / gap);
        const T v = v0 - (press - number(press)) / slope;
        const T stiffness = exp(p[kLogShear] + p[kExponent] * log1p(v));
        T dx = force[0] / stiffness, dy = force[1] / stiffness;
        const double shift = std::hypot(number(dx), number(dy));
        if (geometry != nullptr && shift > kLargestShift) {
            dx *= kLargestShift / shift;
            dy *= kLargestShift / shift;
        }
        for (std::size_t e = 0; e < kElectrodes; ++e) {
            const T grown = geometry != nullptr ? exact(e, dx, dy)
                                                : double(kElectrode[e].along_x) * dx + double(kElectrode[e].along_y) * dy;
            reading[e] = p[kZero + int(e)] + exp(p[kLogActive + int(e)]) * (v + (1.0 + v) * grown);
        }
    }

    template <typename T>
    T exact(std::size_t e, const T& dx, const T& dy) const {
        Sector sector = geometry->sector(e);
        sector.inner /= geometry->disc_radius_m;
        sector.outer /= geometry->disc_radius_m;
        const Overlap area = overlap(sector, 1, number(dx), number(dy));
        return (area.change + area.d_dx * (dx - number(dx)) + area.d_dy * (dy - number(dy))) / area_at_rest(sector, 1);
    }
};

bool is_electrode(std::string_view name);
inline constexpr KnownChannels kElectrodeOfPad{is_electrode, "an electrode of model \"capacitive\" (C1 .. C4, Cn)"};

struct FittedPad {
    std::array<double, kUnknowns> p;
    double noise, condition;
};
// Fits zero and active capacitance of each electrode, compression law, shear stiffness and its exponent by robust non-linear
// least squares, readings from forces. `geometry`: nullptr = the overlap to first order; `pair_gain`: relative change of C1
// per unit of shift. Everything except the shear stiffness is stored in the calibration. setup: throws Undetermined
FittedPad fit_pad(const Rows& rows, const ElectrodeGeometry* geometry, double pair_gain, Calibration& calibration,
                  std::vector<std::string>& warnings);

}  // namespace tactiled
