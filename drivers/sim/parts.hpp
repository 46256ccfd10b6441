// Parts of a scene, in which an effect may rest although others need it elsewhere.
#pragma once
#include <cstdint>
#include <vector>

#include "drivers/sim/scene.hpp"

namespace tactiled::sim {

// A run of whole segments.
struct Part {
    std::size_t first_segment, last_segment;  // both included
    double begin_s, end_s;
    // Samples that are taken well within the part, whatever effects of time do; whole blocks.
    std::uint64_t first_sample, end_sample;
};

// At most 16 parts that cover the scene; short ones are merged with a neighbour. `margin_s`: how far a sample may be taken
// from the time at which it is due. setup
std::vector<Part> parts_of(const Scene& scene, double margin_s);

}  // namespace tactiled::sim
