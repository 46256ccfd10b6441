#include "node/tuning.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tactiled {
namespace {

constexpr double kTareLimit = 0.2;  // relative to full scale
constexpr int kFrozenAfter = 100;   // readings, if the driver states that noise changes them; minimum of all limits
// The limit relative to the longest run R of equal readings in the calibration's rows. If R is the longest run in n
// readings, the probability that a reading repeats is about n^(-1 / R). A run of 10 R is then expected once in 10^23
// readings for n = 200.
constexpr int kFrozenTimes = 10;
constexpr double kJump_K = 1;  // faster than kSlew_K_per_s: another thermometer
// Without rows at rest the limit is kFrozenAfter readings and this time. For a sensor of few bits, whose readings repeat for
// longer, set frozen_after = 0.
constexpr std::uint64_t kFrozenUnknownNs = 10'000'000'000;

// Sets the limits from which on a channel that repeats one number counts as frozen. The driver has set `noisy`.
void put_frozen(const Calibration& calibration, Tuning& tuning) {
    if (tuning.frozen_after == 0) tuning.noisy = false;
    if (tuning.frozen_after >= 0) return tuning.frozen_of.fill({unsigned(tuning.frozen_after), 0});
    const Repeats& repeats = calibration.repeats;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        if (repeats.readings.empty()) {
            tuning.frozen_of[k] = {unsigned(kFrozenAfter), tuning.noisy ? 0 : kFrozenUnknownNs};
            continue;
        }
        const int run = repeats.readings[k];
        const int after = run == 0 ? (tuning.noisy ? kFrozenAfter : 0) : std::max(kFrozenAfter, kFrozenTimes * run);
        const double longest_ns = double(kFrozenTimes) * double(run) * repeats.interval_s * 1e9;
        tuning.frozen_of[k] = {unsigned(after), std::uint64_t(std::min(longest_ns, 1e18))};
    }
}

// A dummy is one more channel of the converter that the others have, so it may repeat a number as often as each of them may;
// for ever, if one may or if that is not known. It follows the temperature as fast as they do: no step of it is too fast.
void put_thermometer(const SensorSettings& settings, const Calibration& calibration, Tuning& tuning) {
    const bool is_dummy = !calibration.temperature.dummy.empty();
    unsigned after = tuning.noisy && !settings.temperature.empty() ? unsigned(kFrozenAfter) : 0;
    bool may_repeat = calibration.repeats.readings.empty() && !tuning.noisy;
    for (std::size_t k = 0; is_dummy && k < calibration.channels.size(); ++k) {
        const Tuning::Frozen& one = tuning.frozen_of[k];
        may_repeat |= one.after == 0;
        after = std::max(after, one.after);
    }
    tuning.thermometer_frozen_after = settings.temperature_frozen_after >= 0 ? unsigned(settings.temperature_frozen_after)
                                      : may_repeat                           ? 0
                                                                             : after;
    tuning.thermometer_jump_K = settings.temperature_jump_K >= 0 ? settings.temperature_jump_K
                                : is_dummy                       ? std::numeric_limits<double>::infinity()
                                                                 : kJump_K;
}

// Sets the least noise of the calibrated device. The driver's numbers are counts_per_unit times those of the calibration.
void put_least_noise(const Calibration& calibration, double counts_per_unit, Tuning& tuning) {
    constexpr double kLeast = 1. / 4;  // relative to the sd at rest
    const Repeats& repeats = calibration.repeats;
    for (std::size_t k = 0; k < repeats.noise.size(); ++k) {
        const double sd = kLeast * repeats.noise[k] * counts_per_unit;
        tuning.least_noise_of[k] = 2 * sd * sd;
        if (sd > 0 && !tuning.accept_too_quiet) tuning.noise_interval_ns = std::uint64_t(repeats.interval_s * 1e9);
    }
}

// Returns true if the damage that a calibration leaves undetected is unknown or above the limit; never without a limit.
bool is_above_limit(const UndetectedDamage& damage, double limit) {
    if (limit == SensorTuning::kUnlimited) return false;
    return !damage.is_known() || damage.mean(damage.worst_kind()) > limit;
}

}  // namespace

Tuning tuning_of(const SensorSettings& settings, const Calibration& calibration, const std::vector<int>& channel_of_frame,
                 const float (&full_scale)[6], const Driver* driver) {
    Tuning tuning;
    static_cast<SensorTuning&>(tuning) = settings;
    const auto device = std::uint16_t(settings.device);
    tuning.stale_ns = std::uint64_t(settings.stale_ms) * 1'000'000u;
    tuning.doubts_zero = settings.zero_after != "keep";
    tuning.forgets_zero = settings.zero_after == "forget";
    tuning.noisy = driver != nullptr && driver->is_noisy(device);
    put_frozen(calibration, tuning);
    put_thermometer(settings, calibration, tuning);
    if (is_above_limit(calibration.undetected_damage_of(settings.method), settings.undetected_damage_limit))
        tuning.reasons |= TACTILED_NOT_REDUNDANT;
    put_least_noise(calibration, settings.counts_per_unit, tuning);
    tuning.tare_limit_of_magnitude_N = std::max(0.0, settings.tare_limit_N);
    for (std::size_t c = 0; c < tuning.tare_limit_of_component_N.size() && settings.tare_limit_N < 0; ++c)
        if (std::isfinite(full_scale[c])) tuning.tare_limit_of_component_N[c] = kTareLimit * double(full_scale[c]);
    if (channel_of_frame.empty()) tuning.delay_s.push_back(std::max(0., settings.delay_ms * 1e-3));  // an array
    for (const int channel : channel_of_frame)
        tuning.delay_s.push_back(settings.delay_ms >= 0             ? settings.delay_ms * 1e-3
                                 : driver == nullptr || channel < 0 ? 0
                                                                    : driver->delay_s(device, std::size_t(channel)));
    return tuning;
}

}  // namespace tactiled
