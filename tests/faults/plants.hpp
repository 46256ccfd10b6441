// Planted bugs that the witness must find, to prove that it finds errors.
#pragma once
#include <vector>

#include "world.hpp"

namespace tactiled::faults {

std::vector<Plant> plants();

}  // namespace tactiled::faults
