// The faults of the simulated world: the likely ones of the list in README.md, singly and in pairs.
#pragma once
#include <span>
#include <string>

#include "world.hpp"

namespace tactiled::faults {

// Who may suffer: the sensors of the link; also the one that one of them is compared with; the two that are compared; the
// one that is calibrated anew; all; none.
enum class Reach { link, twin, pair, jaw, node, nobody };

struct Fault {
    const char* name;
    int number;  // in the list
    Reach reach;
    std::uint64_t recovers_ms;  // after its end
    std::uint64_t lasts_ms;     // 0: 30 .. 300, at random
    void (*begin)(World&, unsigned link);
    void (*end)(World&, unsigned link);
};
std::span<const Fault> faults();

// Two faults at random times on random links; nullptr: one only. Ends when both have been recovered from.
Findings run(std::uint64_t seed, const Fault* first, const Fault* second, const Plant* plant = nullptr);
// Every fault, every pair: seed modulo their number.
std::string name_of_seed(std::uint64_t seed);
Findings run_seed(std::uint64_t seed, const Plant* plant = nullptr);
std::uint64_t combinations();

}  // namespace tactiled::faults
