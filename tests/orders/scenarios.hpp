// The scenarios, by file. Each runs the product's own source, as instead.hpp says.
#pragma once
#include <vector>

#include "explorer.hpp"

namespace orders {

std::vector<Scenario> ring_scenarios();      // node/ring.hpp
std::vector<Scenario> runner_scenarios();    // node/runner.hpp, node/wake_word.hpp
std::vector<Scenario> handover_scenarios();  // node/handover.hpp, node/lending.hpp
std::vector<Scenario> slot_scenarios();      // node/shm/publish.hpp with tactiled/layout.h
std::vector<Scenario> segment_scenarios();   // node/shm/writer.cpp with tactiled/reader.h

// Litmus tests of the explorer itself. Adds their table to `page`; false where an outcome is wrong.
bool litmus(std::string& page);

}  // namespace orders
