// The common parts of the methods of model "hair": reading a calibration, and their decoupler.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "decoupling/hair/solver.hpp"
#include "decoupling/method.hpp"

namespace tactiled {

inline constexpr std::uint32_t kPairX = 0b0101, kPairY = 0b1010;  // H1 H3, H2 H4

inline constexpr Parameter kArea{"area_m2", "of the cap; 2.827e-5 of one of 6 mm diameter", kAboveZero, kLargest};

// The parameters of the methods that are fitted to readings only.
inline constexpr std::array<Parameter, 4> kFittedParameters{
    {kArea,
     {"normal_scale_Pa", "greatest normal stress of the calibration", kAboveZero, kLargest},
     {"shear_scale_Pa", "greatest shear stress of the calibration", kAboveZero, kLargest},
     {"pull_scale_Pa", "greatest pull of the calibration", 0, kLargest, 0}}};

// One row per hair, dR/R0 at 1 Pa of sigma, tau_x and tau_y; the standard deviation of each hair.
inline constexpr KnownTable kHairGains{"gains", kPerChannel, 3}, kHairNoise{"noise", 1, kPerChannel, false};

struct HairSetup {
    HairResponse response;
    std::array<std::size_t, 4> hair{};  // hair of each channel
    std::uint32_t wired = 0, unknowns = 0;
    double area_m2 = 0;
    HairLoad scale_Pa{1, 1, 1};
    bool two_steps = false;               // true: by DIFF and SUM of pairs
    std::array<double, 2> diff_per_Pa{};  // S_d for the pairs H1 H3 and H2 H4, for two_steps
    bool noise_known = false;
};

// Each function fills its part of `setup` and returns the fault, "" if there is none. setup
std::string read_wiring(const Calibration& calibration, HairSetup& setup);  // first: the hair of each channel
std::string read_noise(const CalibrationData& data, HairSetup& setup);
// Reads kFittedParameters and the table `gains`, and the last leak terms from the table `leaks` if there is one.
std::string read_gains(const CalibrationData& data, std::string_view leaks, HairSetup& setup);

// Returns nullptr with `fault` set if the setup does not determine the loads; an existing fault is kept. setup
std::unique_ptr<Decoupler> make_hair(const CalibrationData& data, std::string_view method, const HairSetup& setup,
                                     std::string& fault);

}  // namespace tactiled
