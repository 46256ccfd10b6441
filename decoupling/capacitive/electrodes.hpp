// The electrodes of the piezo-capacitive sensor, their places and names, for the loop and for the fit.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string_view>

#include "decoupling/capacitive/sector_overlap.hpp"
#include "decoupling/solve/parameters.hpp"

namespace tactiled {

// A force along +x moves the upper electrode along +x, towards C1: C1 rises, C2 falls. Cn is in the middle.
struct Electrode {
    const char* name;
    int along_x, along_y;
};
inline constexpr std::size_t kElectrodes = 5, kCentre = 4;
inline constexpr std::array<Electrode, kElectrodes> kElectrode{
    {{"C1", +1, 0}, {"C2", -1, 0}, {"C3", 0, +1}, {"C4", 0, -1}, {"Cn", 0, 0}}};

// Returns the index in kElectrode, or kElectrodes for an unknown name.
constexpr std::size_t electrode_index(std::string_view name) noexcept {
    for (std::size_t e = 0; e < kElectrodes; ++e)
        if (name == kElectrode[e].name) return e;
    return kElectrodes;
}

// Channel of each electrode, -1 = not wired.
using Wiring = std::array<int, kElectrodes>;

struct ElectrodeGeometry {
    double disc_radius_m;                                // radius of the upper electrode, which moves
    double inner_radius_m, outer_radius_m, opening_rad;  // dimensions of the four sectors
    double centre_radius_m;
    double gap_m;  // gap at rest

    [[nodiscard]] Sector sector(std::size_t electrode) const noexcept {
        if (electrode == kCentre) return {0, centre_radius_m, 0, std::numbers::pi};
        return {inner_radius_m, outer_radius_m, std::atan2(kElectrode[electrode].along_y, kElectrode[electrode].along_x),
                opening_rad / 2};
    }
    // Returns the reason why the geometry is impossible, "" if it is possible.
    [[nodiscard]] std::string fault() const {
        if (!(inner_radius_m < disc_radius_m && disc_radius_m < outer_radius_m))
            return "needed is inner_radius_m < disc_radius_m < outer_radius_m: else a small shift changes nothing";
        if (!(centre_radius_m <= inner_radius_m)) return "needed is centre_radius_m <= inner_radius_m: electrodes overlap";
        return "";
    }
};

// A shift beyond this part of the disc's radius would destroy the pad.
inline constexpr double kLargestShift = 0.9;

inline constexpr std::array<Parameter, 6> kGeometryParameters{
    {{"disc_radius_m", "radius of the electrode that moves", 1e-5, 1},
     {"inner_radius_m", "inner radius of the electrodes C1 .. C4", 1e-6, 1},
     {"outer_radius_m", "outer radius of the electrodes C1 .. C4", 1e-5, 1},
     {"opening_rad", "angle that each of C1 .. C4 spans, about 1.4 (80 degrees)", 0.1, 1.5707963267948966},
     {"centre_radius_m", "radius of the electrode Cn", 1e-6, 1},
     {"gap_m", "distance of the electrodes at rest", 1e-6, 1}}};

// Reads the geometry from kGeometryParameters. setup
inline ElectrodeGeometry electrode_geometry(const CalibrationData& data) {
    return {data["disc_radius_m"], data["inner_radius_m"],  data["outer_radius_m"],
            data["opening_rad"],   data["centre_radius_m"], data["gap_m"]};
}

}  // namespace tactiled
