// Fits mass and centre of mass of the part of the hand that a sensor carries, and the sensor's zero, to the readings in a
// few poses without contact of the hand.
#pragma once
#include <array>
#include <span>
#include <string>

#include "decoupling/tool/tool.hpp"

namespace tactiled::tool {

// Means of one pose in which the hand rests. NaN: a component that the sensor does not measure.
struct Pose {
    Vector gravity_G_m_s2{};
    std::array<double, 6> raw_S{};  // force in N, torque in Nm, without any tare
};

struct Fit {
    std::string fault;  // reason for a missing result; "" = the other members are valid
    double mass_kg = 0, mass_sd_kg = 0;
    Vector zero_S_N{}, zero_S_Nm{};
    double zero_sd_N = 0, zero_sd_Nm = 0;
    bool has_centre = false;  // the sensor measures torque
    Vector centre_G_m{};
    double centre_sd_m = 0;
    double residual_N = 0;  // rms residual of the force, per component
    double worst_N = 0;     // magnitude of the largest residual
};

inline constexpr std::size_t kMinPoses = 4;

// Least squares over at least kMinPoses: raw_S = S_from_G m g + zero, torque_S = S_from_G ((centre - position) x m g) +
// zero.
// setup: allocates
Fit fit_tool(std::span<const Pose> poses, const std::array<Vector, 3>& S_from_G, const Vector& position_G_m);

}  // namespace tactiled::tool
