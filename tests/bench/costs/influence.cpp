#include "tests/bench/costs/influence.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <random>

namespace tactiled::ctl {

Calibration influence_calibration(const CostSetup& setup) {
    Problems problems;
    Calibration calibration = load_calibration(setup.influence_path(), problems);
    const std::string hint =
        "this cost needs a plate's influence map: run it in the project's folder, or name a calibration of "
        "method map with --influence";
    if (!problems.empty()) throw SetupError(fmt::format("{}\n{}", problems.lines().front(), hint));
    calibration = calibration.with_method("map");
    if (calibration.tables.count("influence") == 0 || calibration.channels.size() != 8)
        throw SetupError(fmt::format("{}: has no table influence for R1 .. R8; {}", setup.influence_path(), hint));
    return calibration;
}

PlateContact contact_at_row(const Calibration& calibration, std::size_t row, std::size_t seed) {
    const auto& cells = calibration.tables.at("influence")[row];
    std::mt19937_64 random(row * 1000 + seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    const double press_N = 0.5 + 0.5 * uniform(random), shear_N = 0.5 * press_N * uniform(random),
                 cycle = 2 * std::numbers::pi * uniform(random);
    PlateContact contact{cells[0], cells[1], {shear_N * std::cos(cycle), shear_N * std::sin(cycle), -press_N}, {}};
    const double gauge_factor = calibration.parameters.at("gauge_factor");
    for (std::size_t k = 0; k < 8; ++k) {
        double sum = 0;
        for (std::size_t c = 0; c < 3; ++c) sum += contact.force_N[c] * cells[2 + 3 * k + c];
        contact.reading.push_back(gauge_factor * sum);
    }
    return contact;
}

}  // namespace tactiled::ctl
