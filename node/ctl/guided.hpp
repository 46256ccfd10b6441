// Functions of the guided verbs (tool-fit, grasp-check): ask a person to do something, and average the sensors.
#pragma once
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "node/setup.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// Prints `text`, and waits for a line. Returns no value at the end of the input and after Ctrl-C.
std::optional<std::string> ask_person(const std::string& text);
// Three numbers with spaces or commas between them; nothing where the text is none such.
std::optional<std::array<double, 3>> three_numbers(const std::string& text);

// The configuration of the daemon of `segment`, or `path` where that is not empty. Throws SetupError.
Node configuration_of(const Segment& segment, const std::string& path);

// Means of the sensors over some time; NaN: a component that a sensor does not see.
struct Observed {
    std::string fault;                           // "" = the rest is valid
    std::vector<std::array<double, 6>> raw_S;    // by sensor of the node: force in N, torque in Nm, before any tare
    std::vector<std::array<double, 6>> tared_S;  // the same, less the tare
    std::vector<double> scatter_N;               // standard deviation of a sample of the force, largest component
    std::array<double, 3> gravity_G_m_s2{};      // gravity of the tool; NaN: not known
};
// Averages the sensors of `mask` over `seconds`. A fault where one is BAD, or moves.
Observed observe(const Segment& segment, std::uint32_t mask, double seconds);

}  // namespace tactiled::ctl
