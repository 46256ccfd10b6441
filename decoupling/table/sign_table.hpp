// The sign table of the table-shaped sensor: the response of each gauge to a force, for the loop and for the fit.
#pragma once
#include <array>
#include <optional>
#include <string_view>

namespace tactiled {

// Along the positive axes the order of the gauges is R2 R1 R5 R6 on x and R4 R3 R7 R8 on y. +1: a force along +x (or
// +y) stretches the gauge, so that its resistance rises. The resistance of every inner gauge rises under a press.
struct TableGauge {
    int number;
    bool inner;
    int along_x, along_y;
};

inline constexpr std::array<TableGauge, 8> kTableGauges{{
    {1, true, -1, 0},
    {2, false, +1, 0},
    {3, true, 0, -1},
    {4, false, 0, +1},
    {5, true, +1, 0},
    {6, false, -1, 0},
    {7, true, 0, +1},
    {8, false, 0, -1},
}};

// Returns the gauge of a channel's name, "R1" .. "R8".
constexpr std::optional<TableGauge> table_gauge(std::string_view name) noexcept {
    if (name.size() != 2 || name[0] != 'R' || name[1] < '1' || name[1] > '8') return std::nullopt;
    return kTableGauges[static_cast<std::size_t>(name[1] - '1')];
}

}  // namespace tactiled
