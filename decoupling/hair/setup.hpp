// What model "hair" reads from a calibration.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "decoupling/decoupler.hpp"
#include "decoupling/hair/solver.hpp"

namespace tactiled {

inline constexpr std::uint32_t kPairX = 0b0101, kPairY = 0b1010;  // H1 H3, H2 H4

struct HairSetup {
    HairResponse response;
    std::array<std::size_t, 4> hair{};  // of a channel
    std::uint32_t wired = 0, unknowns = 0;
    double area_m2 = 0;
    HairLoad scale_Pa{1, 1, 1};
    std::array<double, 2> diff_per_Pa{};  // sum_diff: S_d of H1 H3 and of H2 H4
    bool noise_known = false;
};

// Fills `setup` for a method; what is wrong with the calibration, "" where nothing is. setup
std::string read_hair_setup(const Calibration& calibration, const std::string& method, HairSetup& setup);

}  // namespace tactiled
