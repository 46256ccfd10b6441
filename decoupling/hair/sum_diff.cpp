// Model "hair", method "sum_diff": the two steps of Cao et al. DIFF of a pair gives its shear, the shear gives the
// intercept of SUM, and SUM gives the normal stress (two_steps() in hair.cpp).
#include <fmt/format.h>

#include <cmath>

#include "decoupling/hair/setup.hpp"

namespace tactiled {
namespace {

constexpr double kMinSum = 0.1;  // relative to the sum of magnitudes; 1 if both hairs of a pair respond equally

constexpr auto kParameters =
    joined(kFittedParameters,
           std::array<Parameter, 2>{{{"diff_x_per_Pa", "DIFF of H1 H3 at 1 Pa of shear, r3 - r1", -kLargest, kLargest, 0},
                                     {"diff_y_per_Pa", "DIFF of H2 H4 at 1 Pa of shear, r4 - r2", -kLargest, kLargest, 0}}});
constexpr std::array<KnownTable, 3> kTables{{kHairGains, {"intercept", kPerChannel, kInterceptTerms, false}, kHairNoise}};

std::string read_pairs(const CalibrationData& data, HairSetup& setup) {
    const bool x = (setup.unknowns & 2u) != 0, y = (setup.unknowns & 4u) != 0;
    if ((x && (setup.wired & kPairX) != kPairX) || (y && (setup.wired & kPairY) != kPairY))
        return "method sum_diff needs H1 H3 for fx and H2 H4 for fy; with other hairs use matrix";
    setup.two_steps = true;
    setup.diff_per_Pa = {data["diff_x_per_Pa"], data["diff_y_per_Pa"]};
    for (std::size_t axis = 0; axis < 2; ++axis)
        if ((setup.unknowns >> (axis + 1) & 1u) != 0 && setup.diff_per_Pa[axis] == 0)
            return fmt::format("parameter {} (DIFF of the pair at 1 Pa of shear, {}) is missing or 0",
                               axis == 0 ? "diff_x_per_Pa" : "diff_y_per_Pa", axis == 0 ? "r3 - r1" : "r4 - r2");
    return "";
}

// The hairs of a pair must respond to a press with the same sign.
std::string fault_of_sums(const HairSetup& setup) {
    for (const std::uint32_t pair : {kPairX, kPairY}) {
        double sum = 0, size = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            sum += (pair >> i & 1u) != 0 ? setup.response.gain[i][0] : 0;
            size += (pair >> i & 1u) != 0 ? std::abs(setup.response.gain[i][0]) : 0;
        }
        if ((setup.wired & pair) == pair && !(std::abs(sum) > kMinSum * size))
            return fmt::format(
                "table gains: the hairs {} respond to a press with opposite signs, so their SUM has no meaning",
                pair == kPairX ? "H1 H3" : "H2 H4");
    }
    return "";
}

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    HairSetup setup;
    fault = read_wiring(data.calibration(), setup);
    if (fault.empty()) fault = read_pairs(data, setup);
    if (fault.empty()) fault = read_gains(data, "intercept", setup);
    if (fault.empty()) fault = fault_of_sums(setup);
    return make_hair(data, "sum_diff", setup, fault);
}

const MethodEntry entry{
    .model = "hair", .method = "sum_diff", .place = 10, .parameters = kParameters, .tables = kTables, .make = make};

}  // namespace
}  // namespace tactiled
