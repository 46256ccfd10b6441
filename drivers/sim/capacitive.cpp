// The piezo-capacitive sensor: four sectors and a centre electrode over a soft pad, and a piezo film (the thesis on
// minimally invasive surgery). C1 is towards +x, C2 -x, C3 +y, C4 -y: a shear towards an electrode raises its
// capacitance.
#include <cmath>
#include <numbers>

#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

void read_capacitive(Options& options, Sensor& sensor) {
    CapacitiveSample& c = sensor.capacitive;
    c.disc_radius_m = options.number("disc_radius_m", {1e-4, 0.1}, 5e-3);
    c.inner_radius_m = options.number("inner_radius_m", {1e-5, 0.1}, 3e-3);
    c.outer_radius_m = options.number("outer_radius_m", {1e-4, 0.1}, 7e-3);
    c.opening_rad = options.number("opening_deg", {1, 90}, 80) * std::numbers::pi / 180;
    c.centre_radius_m = options.number("centre_radius_m", {1e-5, 0.1}, 2e-3);
    c.gap_m = options.number("gap_m", {1e-5, 0.05}, 3e-3);
    c.young_Pa = options.number("young_Pa", {1e3, 1e9}, 0.1e6);
    c.poisson = options.number("poisson", {0, 0.49999}, 0.49);
    // 0.096 mm at 1 N for a bonded pad of 12 mm by 3 mm, from our own finite elements. Shift: G A / d of the same
    // pad.
    c.strain_per_N = options.number("strain_per_N", {1e-6, 1}, 0.0326);
    c.shift_per_N_m = options.number("shift_per_N_m", {1e-8, 0.01}, 0.79e-3);
    if (!(c.inner_radius_m < c.disc_radius_m && c.disc_radius_m < c.outer_radius_m))
        options.problem("disc_radius_m", "needed is inner_radius_m < disc_radius_m < outer_radius_m");

    // From the thesis' curves at rest: 1.3039 pF and 0.0405 pF/N under a press, 1.2285 pF and 0.038 pF/N under a
    // shear. The slopes give the capacitance of the pad; the rest of the capacitance is stray.
    const double press_slope = options.number("press_pF_per_N", {1e-6, 10}, 0.0405);
    const double shear_slope = options.number("shear_pF_per_N", {1e-6, 10}, 0.038);
    const double sector_m2 = (c.disc_radius_m * c.disc_radius_m - c.inner_radius_m * c.inner_radius_m) * c.opening_rad / 2;
    const double area_per_N = 2 * c.disc_radius_m * std::sin(c.opening_rad / 2) * c.shift_per_N_m / sector_m2;
    c.centre_pF = press_slope / c.strain_per_N;
    c.sector_pF = shear_slope / area_per_N;
    const double centre_rest = options.number("centre_pF", {1e-3, 1e4}, 1.3039);
    const double sector_rest = options.number("sector_pF", {1e-3, 1e4}, 1.2285);
    c.stray_centre_pF = centre_rest - c.centre_pF;
    c.stray_sector_pF = sector_rest - c.sector_pF;
    if (c.stray_centre_pF < 0) options.problem("centre_pF", "centre_pF is less than press_pF_per_N / strain_per_N");
    if (c.stray_sector_pF < 0) options.problem("sector_pF", "sector_pF is less than what shear_pF_per_N asks for");
    c.piezo_V_per_N = options.number("piezo_V_per_N", {0, 1000}, 0.2917);

    sensor.unit = "pF";
    sensor.channels = {"C1", "C2", "C3", "C4", "Cn"};
    constexpr double kTowards[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    for (std::size_t k = 0; k < 4; ++k) {
        sensor.gain[k][kFx] = kTowards[k][0] * shear_slope;
        sensor.gain[k][kFy] = kTowards[k][1] * shear_slope;
        sensor.gain[k][kFz] = -c.sector_pF * c.strain_per_N;
        sensor.zero[k] = sector_rest;
    }
    sensor.gain[4][kFz] = -press_slope;
    sensor.zero[4] = centre_rest;
    if (c.piezo_V_per_N > 0) {
        sensor.channels.emplace_back("Vp");
        sensor.gain[5][kFz] = -c.piezo_V_per_N;
        sensor.zero[5] = options.number("piezo_zero_V", {-10, 10}, 0.0768);
    }
    sensor.full_scale_N = 10;
    sensor.resolution_N = 0.08;  // accuracy of the AD7746, 4 fF, over 0.0485 pF/N
}

}  // namespace tactiled::sim
