// The faults of the simulated world: the likely ones of the list in README.md, singly and in pairs.
#pragma once
#include <span>
#include <string>

#include "world.hpp"

namespace tactiled::faults {

// Sensors that a fault may affect: the sensors of the link; also the one that one of them is compared with; the two
// that are compared; the one that is calibrated again; all; none.
enum class Reach { link, twin, pair, jaw, node, nobody };

struct Fault {
    const char* name;
    int number;  // number in the list
    Reach reach;
    std::uint64_t recovers_ms;  // time for the recovery after its end
    std::uint64_t lasts_ms;     // 0: 30 .. 300, at random
    void (*begin)(World&, unsigned link);
    void (*end)(World&, unsigned link);
};
std::span<const Fault> faults();

// Runs two faults at random times on random links; nullptr: only one. Ends when the node has recovered from both.
Findings run(std::uint64_t seed, const Fault* first, const Fault* second, const Plant* plant = nullptr);
// Every fault, every pair: the seed modulo their number.
std::string name_of_seed(std::uint64_t seed);
Findings run_seed(std::uint64_t seed, const Plant* plant = nullptr);
std::uint64_t combinations();

}  // namespace tactiled::faults
