// The table sensor: strain gauges R1 .. R8 under a plate on four columns (Lee, Kim, Shikida, Sato).
#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {
namespace {

// Microstrain per N of Fx, Fy, +Fz and per N mm of Mx, My, with loads spread over the plate, from our own finite
// elements of the documents' drawing (second-order tetrahedra, base fixed): tests/data/fem/table_compliance.csv.
constexpr double kMicrostrain[8][kAxes] = {{-725.01343, -0.094902425, -422.07116, -0.061826573, -531.00136},  // R1
                                           {573.23704, 0.055165574, -0.40151468, 0.022944936, 35.833833},     // R2
                                           {0.051518854, -723.21061, -422.07423, 530.23887, 0.031153372},     // R3
                                           {0.016107705, 572.5778, -0.3313653, -35.618243, 0.14219876},       // R4
                                           {723.20362, -0.14753601, -422.791, -0.48462217, 530.77385},        // R5
                                           {-573.12943, -0.017111266, -0.60026485, 0.14393239, -34.977131},   // R6
                                           {0.11084696, 724.46451, -421.86958, -530.77391, -0.083920972},     // R7
                                           {-0.28510846, -572.28609, -0.36195474, 35.432073, -0.28255423}};   // R8

// 19,366e-6 and 10,847e-6 per N and gauge as Lee printed them, divided by the strains above. These are not gauge
// factors of a metal film (about 2 for Ni-Cr); they only represent the sample's calibration.
constexpr double kPrintedNormal = 19366 / 422.2, kPrintedTangential = 10847 / 724.0;

}  // namespace

void read_table(Options& options, Sensor& sensor) {
    TableSample& t = sensor.table;
    const bool printed = options.one_of("sample", {"documents", "foil"}, "documents") == "documents";
    t.gauge_factor_normal = options.number("gauge_factor_normal", {0.01, 1000}, printed ? kPrintedNormal : 2);
    t.gauge_factor_tangential = options.number("gauge_factor_tangential", {0.01, 1000}, printed ? kPrintedTangential : 2);
    sensor.unit = "dR/R0";
    for (std::size_t k = 0; k < 8; ++k) {
        sensor.channels.push_back(fmt::format("R{}", k + 1));
        for (std::size_t axis = 0; axis < kAxes; ++axis)
            sensor.gain[k][axis] = kMicrostrain[k][axis] * (axis == kFz  ? 1e-6 * t.gauge_factor_normal
                                                            : axis < kFz ? 1e-6 * t.gauge_factor_tangential
                                                                         : 1e-3 * t.gauge_factor_tangential);
    }
    sensor.resolution_N = 0.05;  // Lee's target, and a step of 12 bits without an amplifier
    sensor.full_scale_N = 1;

    const std::string influence = options.text("influence", "");
    if (influence.empty()) return;
    Problems problems;
    const auto path = std::filesystem::path(options.file()).parent_path() / influence;
    Options file = Options::parse_file(path.string(), problems, 4u << 20);
    for (const auto& row : file.table("tables").rows("influence")) {
        if (row.size() != 26)
            return options.problem("influence", influence + ": each row of tables.influence has 26 numbers");
        std::copy(row.begin(), row.end(), t.influence.emplace_back().begin());
    }
    if (!problems.empty()) return options.problem("influence", problems.lines().front());
    if (t.influence.empty()) options.problem("influence", influence + ": has no tables.influence");
}

}  // namespace tactiled::sim
