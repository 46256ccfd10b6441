// The parts that the methods of model "hair" share: how they read a calibration, and their decoupler.
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

// The parameters of the methods that are fitted to readings alone.
inline constexpr std::array<Parameter, 4> kFittedParameters{
    {kArea,
     {"normal_scale_Pa", "greatest normal stress of the calibration", kAboveZero, kLargest},
     {"shear_scale_Pa", "greatest shear stress of the calibration", kAboveZero, kLargest},
     {"pull_scale_Pa", "greatest pull of the calibration", 0, kLargest, 0}}};

// A row a hair, dR/R0 at 1 Pa of sigma, tau_x and tau_y; the standard deviation of each hair.
inline constexpr KnownTable kHairGains{"gains", kPerChannel, 3}, kHairNoise{"noise", 1, kPerChannel, false};

struct HairSetup {
    HairResponse response;
    std::array<std::size_t, 4> hair{};  // of a channel
    std::uint32_t wired = 0, unknowns = 0;
    double area_m2 = 0;
    HairLoad scale_Pa{1, 1, 1};
    bool two_steps = false;               // by DIFF and SUM of pairs
    std::array<double, 2> diff_per_Pa{};  // two_steps: S_d of H1 H3 and of H2 H4
    bool noise_known = false;
};

// Each fills its part of `setup` and returns the fault, "" where there is none. setup
std::string read_wiring(const Calibration& calibration, HairSetup& setup);  // first: which hair a channel is
std::string read_noise(const CalibrationData& data, HairSetup& setup);
// kFittedParameters and the table `gains`; the last of the leak terms from the table `leaks` where there is one.
std::string read_gains(const CalibrationData& data, std::string_view leaks, HairSetup& setup);

// nullptr where the setup does not determine the loads, and `fault` says why; a fault that is there already stays. setup
std::unique_ptr<Decoupler> make_hair(const CalibrationData& data, std::string_view method, const HairSetup& setup,
                                     std::string& fault);

}  // namespace tactiled
