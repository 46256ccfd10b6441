// Finds which taxels of an array the presses load, and which do not respond.
#pragma once
#include <cstdint>
#include <vector>

#include "decoupling/fit/array_presses.hpp"

namespace tactiled {

struct TaxelSurvey {
    std::vector<std::uint8_t> is_dead, is_loaded;
    std::vector<std::vector<std::size_t>> dead_of;  // for each step: dead taxels in or beside its contact or its neighbours
};

// `start` may list dead taxels. setup
TaxelSurvey survey(const Presses& presses, const TaxelPlaces& places, const Calibration& start);

}  // namespace tactiled
