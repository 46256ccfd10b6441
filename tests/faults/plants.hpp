// Bugs that the witness must find: a witness that finds nothing proves nothing.
#pragma once
#include <vector>

#include "world.hpp"

namespace tactiled::faults {

std::vector<Plant> plants();

}  // namespace tactiled::faults
