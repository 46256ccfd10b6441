#include "node/lab/row_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "config/config.hpp"
#include "node/sensor_setup.hpp"

namespace tactiled::ctl {
namespace {

// Added to the times of the rows: 0 stands for an unknown time.
constexpr std::uint64_t kOrigin_ns = 1'000'000'000;

}  // namespace

RowSensor::RowSensor(const Calibration& calibration, const RowKeys& keys) : each_alone_(keys.each_alone) {
    Sensor::Setup setup;
    setup.decoupler = make_decoupler(calibration, keys.method, keys.budget_us);
    const bool is_array = setup.decoupler->patch() != nullptr;
    SensorSettings settings = default_sensor();
    settings.method = keys.method;
    settings.delay_ms = keys.delay_ms;
    settings.saturates_at = keys.saturates_at;
    settings.accept_unproved_age = true;
    settings.zero_after = "keep";  // a gap between rows is no restart of a device
    if (each_alone_) {
        settings.frozen_after = settings.temperature_frozen_after = 0;
        settings.temperature_jump_K = std::numeric_limits<double>::infinity();
        settings.accept_too_quiet = true;
    }
    if (!is_array) put_channels(settings, calibration, setup);
    put_measuring(settings, calibration, setup);
    setup.temperature = keys.temperature;
    has_dummy_ = setup.temperature_of_frame >= 0;
    if (!has_dummy_) setup.temperature_of_sensor = 0;  // judge() passes that of the row
    setup.needs_tare = setup.needs_tare && !keys.has_tare;
    setup.boot_ns = setup.clock_ns;  // a file is never suspended
    constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
    setup.tuning = tuning_of(settings, calibration, setup.channel_of_frame,
                             {kUnknown, kUnknown, kUnknown, kUnknown, kUnknown, kUnknown}, nullptr);
    stale_ns_ = setup.tuning.stale_ns;
    sensor_.emplace(std::move(setup));
}

Estimate RowSensor::judge(const Reading& reading, double thermometer) {
    const std::uint64_t t_ns = reading.t_ns + kOrigin_ns;
    if (last_ns_ == 0) sensor_->start(1, t_ns);
    const bool is_late = last_ns_ != 0 && t_ns > last_ns_ + stale_ns_;
    last_ns_ = t_ns;
    Frame frame;
    frame.t_ns = t_ns;
    frame.missing = reading.missing;
    frame.saturated = reading.saturated;
    std::size_t n = sensor_->patch() == nullptr ? reading.channel.size() : 0;
    std::copy_n(reading.channel.begin(), n, frame.channel.begin());
    if (has_dummy_) {
        frame.channel[n] = thermometer;
        if (std::isnan(thermometer)) frame.missing |= 1u << n;
        ++n;
    } else {
        tactiled_sample of_row{};
        of_row.temperature_C = float(thermometer);
        sensor_->take_temperature(of_row);
    }
    frame.n_channels = std::uint8_t(n);
    const tactiled_sample sample = sensor_->sample(frame, t_ns, reading.taxels);
    Estimate estimate = sensor_->estimate();
    if (each_alone_) return estimate;
    for (std::size_t i = 0; i < 3; ++i) {
        estimate.sd[i] = sample.sd_force_N[i];
        estimate.sd[i + 3] = sample.sd_torque_Nm[i];
    }
    estimate.reasons = sample.reasons;
    if (is_late) estimate.reasons &= ~std::uint32_t(TACTILED_STEPPED);
    return estimate;
}

void RowSensor::tare(const Wrench& zero_S) {
    TaredZero tared{.tare_count = 1};
    tared.of_method.fill(zero_S);
    sensor_->restore_zero(tared, 0, std::nullopt);
}

}  // namespace tactiled::ctl
