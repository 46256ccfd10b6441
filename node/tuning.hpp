// The settings of a sensor that a reload may exchange while the sensor runs. The sensor owns one Tuning, and its parts point
// to this Tuning and keep no copies. A new key is a member of SensorTuning and an entry in its list (config/sensor.cpp).
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "config/calibration.hpp"
#include "config/config.hpp"
#include "decoupling/decoupler.hpp"
#include "drivers/driver.hpp"
#include "drivers/frame.hpp"

namespace tactiled {

// The keys of the configuration, and values that tuning_of() derives from them, the calibration and the driver. Use the
// derived value where there are both: frozen_of for frozen_after, tare_limit_of_.. for tare_limit_N, delay_s for delay_ms,
// thermometer_... for temperature_frozen_after and temperature_jump_K, and `pair` for the keys agree_...
struct Tuning : SensorTuning {
    std::uint64_t stale_ns = 100'000'000;  // longest time without a frame for which the sensor has a value
    bool doubts_zero = true;               // zero_after is not "keep"
    bool forgets_zero = false;             // zero_after is "forget"
    // A channel that repeats one number is frozen after this number of readings, if they last this long. 0 readings = never.
    struct Frozen {
        unsigned after = 0;
        std::uint64_t ns = 0;
    };
    std::array<Frozen, kMaxChannels> frozen_of{};
    // The least mean square of successive differences of a channel, in the frame's numbers, and the time between them; 0 =
    // any.
    std::array<double, kMaxChannels> least_noise_of{};
    std::uint64_t noise_interval_ns = 0;
    bool noisy = false;                     // noise changes every reading, so the same number in all channels is an idle bus
    unsigned thermometer_frozen_after = 0;  // readings; 0 = never
    double thermometer_jump_K = 1;
    // Limit of a new zero relative to the calibration's: each component's of the force, and of the magnitude; 0 = none.
    std::array<double, 3> tare_limit_of_component_N{};
    double tare_limit_of_magnitude_N = 0;
    // Reasons that each sample has, from the calibration and the keys alone.
    std::uint32_t reasons = 0;
    // Known delay of converter and transmission of each channel of the model: part of the standard deviation (latency.hpp).
    // Empty = none.
    std::vector<double> delay_s;

    [[nodiscard]] std::uint64_t tare_ns() const noexcept { return std::uint64_t(tare_ms) * 1'000'000u; }
};

[[nodiscard]] inline TemperatureInUse temperature_in_use(const SensorMeasuring& settings) {
    return {settings.temperature_range_C[0], settings.temperature_range_C[1], settings.temperature_difference_K,
            settings.temperature_sd_K};
}

// Returns the tuning of a sensor. `channel_of_frame`: for each channel of the model, its index in the frame; empty for an
// array. `full_scale`: N and Nm, NaN = unknown. `driver` is nullptr if its configuration is wrong; the node then does not
// run. setup
Tuning tuning_of(const SensorSettings& settings, const Calibration& calibration, const std::vector<int>& channel_of_frame,
                 const float (&full_scale)[6], const Driver* driver);

}  // namespace tactiled
