// The places, normals and neighbours of the taxels of an array, from its calibration.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "decoupling/solve/parameters.hpp"

namespace tactiled {

// Taxel i of all members is the i-th that the device sends.
struct TaxelPlaces {
    static constexpr std::size_t kNeighbours = 4;
    struct Neighbours {
        std::uint16_t n = 0;
        std::array<std::uint16_t, kNeighbours> of{};
        std::uint16_t n_between = 0;  // pairs of them between which the taxel lies
        std::array<std::array<std::uint16_t, 2>, 2> between{};
    };

    std::size_t n = 0;
    std::uint32_t rows = 0, columns = 0;       // 0: a list. A grid in the order of its rows, from the one of the largest y
    std::vector<float> x, y, z;                // m, frame S
    std::vector<std::array<float, 3>> normal;  // unit vectors, out of the skin
    std::vector<std::array<std::array<float, 3>, 3>> axes;  // axes of a taxel's frame in S; empty: those of S
    std::vector<Neighbours> neighbours;                     // the nearest ones
    // Distance of two neighbours along x, y, z: of columns and rows, or the median of a list; 0 = the skin is flat.
    std::array<float, 3> pitch_m{};
    float taxel_area_m2 = 0;  // NaN = unknown

    [[nodiscard]] bool is_flat() const noexcept { return axes.empty(); }
};

// Parameters and tables of a calibration from which places() reads.
inline constexpr std::array<Parameter, 5> kPlaceParameters{
    {{"rows", "rows of a grid", 1, 4096, 0},
     {"columns", "columns of a grid", 1, 4096, 0},
     {"pitch_mm", "distance of two columns, mm", 1e-3, 1e3, 0},
     {"pitch_y_mm", "distance of two rows, mm; 0 = pitch_mm", 1e-3, 1e3, 0},
     {"taxel_area_mm2", "area of a taxel, mm2; 0 = the pitches of a grid", 1e-6, 1e6, 0}}};
inline constexpr std::array<KnownTable, 3> kPlaceTables{
    {{"place_mm", kAnyNumber, 3, false}, {"normal", kAnyNumber, 3, false}, {"wiring", 1, kAnyNumber, false}}};

// Returns the places; `fault` is set if there are none or if they contradict each other. setup
TaxelPlaces places_of(const CalibrationData& data, std::string& fault);

}  // namespace tactiled
