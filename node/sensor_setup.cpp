#include "node/sensor_setup.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "decoupling/solve/domain.hpp"
#include "decoupling/temperature.hpp"

namespace tactiled {
namespace {

// Returns the index in a frame for each channel of the calibration.
std::vector<int> channel_map(SensorSettings& settings, const Calibration& calibration) {
    std::vector<int> map;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const auto& name = calibration.channels[k];
        if (settings.channels.empty()) {  // the frame has exactly the calibrated channels, in that order
            map.push_back(int(k));
            continue;
        }
        const auto at = std::find(settings.channels.begin(), settings.channels.end(), name);
        if (at == settings.channels.end())
            settings.options.problem("channels",
                                     fmt::format("the calibration {} needs channel \"{}\"; channels = [{}] lacks it",
                                                 calibration.path, name, fmt::join(settings.channels, ", ")));
        map.push_back(int(at - settings.channels.begin()));
    }
    return map;
}

// The dummy of the calibration is a thermometer with the scale of the calibration.
void put_dummy(SensorSettings& settings, const Calibration& calibration, Sensor::Setup& setup) {
    const std::string& dummy = calibration.temperature.dummy;
    for (const auto& [key, value] :
         {std::pair{"temperature", settings.temperature}, std::pair{"temperature_of", settings.temperature_of}})
        if (!value.empty())
            settings.options.problem(
                key, fmt::format("{} = {}: the temperature is that of the dummy {} of {}; delete this key", key,
                                 in_quotes(value), in_quotes(dummy), settings.calibration));
    const auto at = std::find(settings.channels.begin(), settings.channels.end(), dummy);
    if (settings.channels.empty())
        ++setup.frame_channels;  // the frame has the dummy last
    else if (at == settings.channels.end())
        settings.options.problem(
            "channels", fmt::format("the calibration {} needs its dummy \"{}\"; channels = [{}] lacks it", calibration.path,
                                    dummy, fmt::join(settings.channels, ", ")));
    setup.temperature_of_frame =
        settings.channels.empty() ? int(calibration.channels.size()) : int(at - settings.channels.begin());
    setup.temperature_at_0_C = calibration.temperature.of_dummy_C(0);
    setup.temperature_per_unit_K = 1 / (calibration.temperature.dummy_per_K * settings.counts_per_unit);
}

// Returns the serial as a number if it has only digits, and at most as many as a double can distinguish.
std::optional<double> number_of(const std::string& serial) {
    constexpr std::size_t kMaxDigits = 15;
    const bool is_number = !serial.empty() && serial.size() <= kMaxDigits &&
                           std::all_of(serial.begin(), serial.end(), [](char c) { return c >= '0' && c <= '9'; });
    return is_number ? std::optional<double>(std::stod(serial)) : std::nullopt;
}

}  // namespace

ZeroError::Rates zero_rates(const Calibration& calibration) {
    constexpr double kCounts = 0.1, kMain = 3, kHour_s = 3600;  // parts of full scale and of the standard deviation
    ZeroError::Rates rates;
    if (!calibration.zero_shift.empty()) rates.shift = {};
    const std::vector<double>& per_h = calibration.zero_growth_per_h();
    for (std::size_t i = 0; i < calibration.components.size(); ++i) {
        const std::size_t c = component_index(calibration.components[i]);
        if (i < per_h.size()) rates.per_s[c] = per_h[i] / kHour_s;
        if (i < calibration.zero_shift.size()) rates.shift[c] = calibration.zero_shift[i];
        if (i < calibration.sd.size())
            rates.limit[c] = std::max(kMain * calibration.sd[i],
                                      i < calibration.full_scale.size() ? kCounts * calibration.full_scale[i] : 0);
    }
    return rates;
}

void put_channels(SensorSettings& settings, const Calibration& calibration, Sensor::Setup& setup) {
    setup.channel_of_frame = channel_map(settings, calibration);
    setup.frame_channels = settings.channels.empty() ? calibration.channels.size() : settings.channels.size();
}

void put_measuring(SensorSettings& settings, const Calibration& calibration, Sensor::Setup& setup) {
    setup.counts_per_unit = settings.counts_per_unit;
    const auto index_of = [&](const std::string& name) {
        return int(std::find(settings.channels.begin(), settings.channels.end(), name) - settings.channels.begin());
    };
    if (!settings.temperature.empty()) setup.temperature_of_frame = index_of(settings.temperature);
    setup.temperature_of_sensor = settings.thermometer;
    setup.temperature = temperature_in_use(settings);
    if (!calibration.temperature.dummy.empty()) put_dummy(settings, calibration, setup);
    const auto follows_temperature = [](const Calibration& c) {
        return !c.temperature.zero_per_K.empty() || temperature_effect(c) != nullptr;
    };
    if (std::isfinite(settings.temperature_sd_K) && !follows_temperature(calibration) &&
        !std::ranges::any_of(calibration.taxels, follows_temperature))
        settings.options.problem(
            "temperature_sd_K",
            fmt::format("temperature_sd_K = {}: neither {} nor model \"{}\" has coefficients of temperature, so it has no "
                        "effect: calibrate with temperature_C over at least 2 K, or delete this key",
                        settings.temperature_sd_K, settings.calibration, settings.model));
    if (!settings.serial_channel.empty()) {
        const std::optional<double> number = number_of(calibration.serial);
        if (!number)
            settings.options.problem(
                "serial_channel",
                fmt::format("serial_channel needs a calibration whose serial is a number; that of {} is {}",
                            settings.calibration, in_quotes(calibration.serial)));
        setup.serial_of_frame = index_of(settings.serial_channel);
        setup.serial = number.value_or(0);
    }
    const Patch* const patch = setup.decoupler->patch();
    const auto needs_tare = [](const Calibration& c) {
        return c.validation.ends_with(Calibration::kOwnZeros) || !c.zero_shift.empty();
    };
    setup.needs_tare = needs_tare(calibration) || std::ranges::any_of(calibration.taxels, needs_tare);
    setup.zero = zero_rates(patch != nullptr ? patch->with_zero_of_taxels(calibration) : calibration);
}

}  // namespace tactiled
