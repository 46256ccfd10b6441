// A force in one register, int16 of 0.01 N, against two, float32: what the PLC reads back of it.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "node/modbus/encode.hpp"
#include "tests/bench/costs/cost.hpp"

namespace tactiled::ctl {
namespace {

using namespace tactiled::modbus;

struct Read {
    double force_N;
    bool saturated;
};
Read through_int16(double force_N) {
    bool saturated = false;
    const auto word = i16_of(force_N, kForceUnit_N, saturated);
    return {double(std::int16_t(word)) * kForceUnit_N, saturated};
}
Read through_float32(double force_N) {
    std::uint16_t word[2];
    put_float(force_N, false, word);
    return {double(std::bit_cast<float>(std::uint32_t(word[0]) << 16 | word[1])), false};
}

Cost measure(const CostSetup& setup) {
    const std::size_t n = setup.samples_or(20'000);
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    Cost cost;
    cost.columns = {"register", "words", "force_N", "worst_error_N", "saturated_share"};
    Figure::Series whole{"int16 of 0.01 N, one register", Symbol::circle, Stroke::solid},
        beyond{"the same, saturated", Symbol::cross, Stroke::none, {}, kBlue},
        single{"float32, two registers", Symbol::square, Stroke::solid};
    double largest_good_N = 0, worst_inside_N = 0, float_there_N = 0;
    // Two steps a decade, forces between one and the next; the last of a register is one of its own.
    std::vector<double> ends_N;
    for (double power = -3; power < 3.9; power += 0.5) ends_N.push_back(std::pow(10, power));
    ends_N.push_back(kMaxI16 * kForceUnit_N);
    std::sort(ends_N.begin(), ends_N.end());
    for (std::size_t i = 1; i < ends_N.size(); ++i) {
        double worst[2] = {0, 0}, saturated = 0;
        for (std::size_t k = 0; k < n; ++k) {
            const double force_N = (k % 2 == 0 ? 1 : -1) * std::lerp(ends_N[i - 1], ends_N[i], uniform(random));
            const Read integer = through_int16(force_N), real = through_float32(force_N);
            worst[0] = std::max(worst[0], std::abs(integer.force_N - force_N));
            worst[1] = std::max(worst[1], std::abs(real.force_N - force_N));
            saturated += integer.saturated ? 1.0 / double(n) : 0;
        }
        cost.rows.push_back({"int16", {1, ends_N[i], worst[0], saturated}});
        cost.rows.push_back({"float32", {2, ends_N[i], worst[1], 0}});
        (saturated > 0 ? beyond : whole).points.push_back({ends_N[i], worst[0], ""});
        single.points.push_back({ends_N[i], worst[1], ""});
        if (saturated > 0) continue;
        largest_good_N = ends_N[i];
        worst_inside_N = std::max(worst_inside_N, worst[0]);
        float_there_N = worst[1];
    }
    whole.points.back().label = fmt::format("{:g} N, the last", largest_good_N);
    cost.figure = {"Register: error of what is read back, against the force",
                   {"force, N (worst up to it, from the point before)", true},
                   {"worst error, N", true},
                   {whole, beyond, single}};
    cost.advice = fmt::format(
        "Read the int16 block where {:.1f} mN will do: up to {:g} N it is off by {:.1f} mN at most, for half the "
        "words; read float32 ({:.2g} mN at that force) for anything finer, or beyond, where int16 stays at its end "
        "and OVERLOAD is set.",
        worst_inside_N * 1e3, largest_good_N, worst_inside_N * 1e3, float_there_N * 1e3);
    return cost;
}

}  // namespace

extern const CostEntry register_cost;
const CostEntry register_cost{"register", "int16 against float32 in registers: error against words",
                              "node/costs_register.svg", measure};

}  // namespace tactiled::ctl
