#include "decoupling/hair/setup.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "decoupling/temperature.hpp"

namespace tactiled {
namespace {

constexpr std::array<std::string_view, 3> kNameOf{"fz", "fx", "fy"};

}  // namespace

std::string read_wiring(const Calibration& calibration, HairSetup& setup) {
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const std::size_t hair = hair_index(calibration.channels[k]);
        if (hair == 4) return fmt::format("channel \"{}\"; a hair sensor has H1 .. H4", calibration.channels[k]);
        if ((setup.wired >> hair & 1u) != 0) return fmt::format("channel \"{}\" twice", calibration.channels[k]);
        setup.wired |= 1u << hair;
        setup.hair[k] = hair;
    }
    for (const auto& name : calibration.components) {
        const auto at = std::find(kNameOf.begin(), kNameOf.end(), name);
        if (at == kNameOf.end()) return fmt::format("component \"{}\"; a hair sensor measures fx fy fz", name);
        setup.unknowns |= 1u << (at - kNameOf.begin());
    }
    const bool x = (setup.unknowns & 2u) != 0, y = (setup.unknowns & 4u) != 0;
    if ((setup.unknowns & 1u) == 0 || !(x || y)) return "components needs fz and at least one of fx fy";
    if ((x && (setup.wired & kPairX) == 0) || (y && (setup.wired & kPairY) == 0))
        return fmt::format("component {} needs {}", x && (setup.wired & kPairX) == 0 ? "fx" : "fy",
                           x && (setup.wired & kPairX) == 0 ? "H1 or H3" : "H2 or H4");
    return "";
}

std::string read_gains(const CalibrationData& data, std::string_view leaks, HairSetup& setup) {
    setup.area_m2 = data["area_m2"];
    const double normal = data["normal_scale_Pa"], shear = data["shear_scale_Pa"];
    setup.scale_Pa = {normal, shear, shear};
    setup.response.min[0] = -data["pull_scale_Pa"] / normal;
    const NumberRows& gains = *data.table("gains");
    const NumberRows* leak = data.table(leaks);
    for (std::size_t k = 0; k < gains.size(); ++k) {
        const std::size_t i = setup.hair[k];
        for (std::size_t j = 0; j < 3; ++j) setup.response.gain[i][j] = gains[k][j] * setup.scale_Pa[j];
        if (leak != nullptr)
            std::copy((*leak)[k].begin(), (*leak)[k].end(),
                      setup.response.leak[i].end() - std::ptrdiff_t((*leak)[k].size()));
    }
    return read_noise(data, setup);
}

std::string read_noise(const CalibrationData& data, HairSetup& setup) {
    const NumberRows* noise = data.table("noise");
    if (noise == nullptr) return "";
    setup.noise_known = true;
    for (std::size_t k = 0; k < noise->front().size(); ++k) {
        setup.response.noise[setup.hair[k]] = noise->front()[k];
        if (!(noise->front()[k] > 0)) return "table noise has a number that is not above 0";
    }
    return "";
}

namespace {

// Platinum film, handbook value: 1 K on all hairs reads as a press of 8 kPa. The resistors of one wafer differ by 1 %. The
// modulus of rubber follows the absolute temperature. H0 is a hair without a cap.
const TemperatureEffect effect{.name = "hair",
                               .zero_per_K = 3e-3,
                               .channel_unit = "dR/R0",
                               .gain_per_K = 3.4e-3,
                               .dummy = kHairDummy,
                               .mismatch = 0.01};

}  // namespace

}  // namespace tactiled
