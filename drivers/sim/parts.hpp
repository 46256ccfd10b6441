// Parts of a scene. An effect may be suspended in one part although another part needs it.
#pragma once
#include <cstdint>
#include <vector>

#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

// Consecutive whole segments.
struct Part {
    std::size_t first_segment, last_segment;  // both included
    double begin_s, end_s;
    // Samples that are within the part for every effect of time; whole blocks.
    std::uint64_t first_sample, end_sample;
};

// At most 16 parts that cover the scene; short ones are merged with a neighbour. `margin_s`: maximum difference between the
// actual and the nominal time of a sample. setup
std::vector<Part> parts_of(const Scene& scene, double margin_s);

}  // namespace tactiled::sim
