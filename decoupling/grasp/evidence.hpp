// Checks that the forces of the jaws support the weight that follows from their sum. Pure functions of the means of
// one window.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

// One jaw's mean over the window of a weight, minus its zero.
struct JawForces {
    Eigen::Matrix3d S_from_G = Eigen::Matrix3d::Identity();
    Eigen::Vector3d force_S_N = Eigen::Vector3d::Zero();  // the sensor's and the zero's sd together
    Eigen::Vector3d sd_N = Eigen::Vector3d::Zero();       // of sensor and zero together
    Eigen::Vector2d axis_S = Eigen::Vector2d::Zero();     // tangential direction in which the jaw carries
    Eigen::Vector2d rest_S_N{kNaN, kNaN};                 // in the grip before the lift; NaN: not observed
    double carries_m_s2 = 0;                              // force along the axis per kg of the object; 0: none
};

// The share of each jaw in the load, compared with the share that it should have.
struct Shares {
    std::array<double, kMaxJaws> off{};  // (load - expected load) / mean load of a jaw
    double max_off = 0;                  // the largest |off - reference|
    std::uint32_t jaws = 0;              // bit n: jaw n contradicts the others by more than the tolerance
    std::uint32_t dead = 0;              // bit n: jaw n is one of `jaws` and has almost no load
    bool known = false;                  // at least two jaws carry weight and are measured
};

// Compares the loads of the jaws since the rest before the lift. `reference` is `off` of an earlier grasp or moment, 0 where
// there is none. `tolerance` applies to |off - reference| and is increased by the sensors' own sd. rt: bounded by the jaws
Shares shares_of(std::span<const JawForces> jaws, std::span<const double, kMaxJaws> reference, double tolerance) noexcept;

// Returns true if each jaw faces another one, so that the presses of a held object balance. rt: bounded by the jaws
bool jaws_face_each_other(std::span<const JawForces> jaws) noexcept;

// The sum of all forces perpendicular to gravity. It is 0 for an object at rest that only these jaws hold.
struct Balance {
    Eigen::Vector3d off_G = Eigen::Vector3d::Zero();  // N in G, divided by the sum of the presses
    double across_N = 0;                              // its size in N minus `expected_N`, at least 0
    double presses_N = 0;                             // the sum of the presses
    double sds = 0;                                   // its size in standard deviations
    std::uint32_t jaws = 0;                           // bit n: an error of jaw n's press would explain it
};

// `gravity_G` is the direction of gravity with any length. `reference_G` is off_G at the time of a known weight, and
// `gain_sd` the relative sd of a press. `expected_N` is a permitted force, such as that of an acceleration. rt: bounded by
// the jaws
Balance balance_of(std::span<const JawForces> jaws, const Eigen::Vector3d& gravity_G, const Eigen::Vector3d& reference_G,
                   double gain_sd, double expected_N) noexcept;

}  // namespace tactiled::grasp
