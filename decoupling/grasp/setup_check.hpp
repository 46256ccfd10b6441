// Finds errors of a gripper's configuration from a guided grasp: the hand open, closed on an object of known mass, lifted,
// tilted. Compares the readings with those expected from the configuration, and from it with one error.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

// A jaw as configured, and the means of its force in S minus those of the open hand.
struct CheckedJaw {
    std::string name;
    std::array<Vector, 3> S_from_G{};
    double share = 0;                           // 0: all jaws alike
    double contact_on_N = 0, full_scale_N = 0;  // press; 0: full scale not known
    Vector closed_N{}, lifted_N{}, tilted_N{};
};

struct GuidedGrasp {
    std::vector<CheckedJaw> jaws;
    unsigned jaws_of_gripper = 0;
    double mass_kg = 0;
    Vector gravity_G_m_s2{};         // configured or reported, while it was lifted
    std::size_t lower_jaw = 0;       // the tilt brought this one down ...
    double tilt_rad = 0;             // ... by so much;
    Vector tilted_gravity_G_m_s2{};  // or, where it is not 0, as the robot reported it
};

enum class SetupFault { gravity_sign, turned, exchanged, contact, shares, dead, sum, unexplained };

struct SetupFinding {
    SetupFault fault;
    std::size_t jaw = 0, other = 0;  // turned, contact and dead: the jaw; exchanged: both
    int degrees = 0;                 // turned: about z of S, from the configured to the true axes
    double value = 0;                // contact: the press; sum: the part of the weight that the forces add up to
    std::vector<double> shares{};    // shares: the measured ones
    Vector x_S_in_G{};               // turned: the corrected axis
};

// Returns the findings, the most important first; empty if the readings agree with the configuration.
// setup: allocates
std::vector<SetupFinding> check_setup(const GuidedGrasp& seen);

}  // namespace tactiled::grasp
