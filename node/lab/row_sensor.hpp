// The rows of a file as the daemon's sensor judges them: the checks of the stream, the jumps, the ageing of the zero and the
// temperature are those of node/sensor.hpp.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "decoupling/decoupler.hpp"
#include "node/sensor.hpp"

namespace tactiled::ctl {

// Keys of a [[sensor]] that a file does not show.
struct RowKeys {
    std::string method;
    double budget_us = 10, delay_ms = 0;
    std::array<double, 2> saturates_at{};  // calibrated unit
    TemperatureInUse temperature{};
    bool has_tare = false;    // the zero is taken from the file, so that the calibration needs no tare
    bool each_alone = false;  // rows of no stream: the quality and the sd are those of the method
};

class RowSensor {
public:
    // setup: throws SetupError where a key or the calibration is wrong
    RowSensor(const Calibration& calibration, const RowKeys& keys);

    // The model of an array, nullptr if the sensor is none.
    [[nodiscard]] Patch* patch() const noexcept { return sensor_->patch(); }
    // Returns the estimate of the model with quality, reasons and standard deviation of the sample: the force is
    // raw_force_S_N, with the zero of the calibration, from which the daemon also subtracts what moved at rests.
    // `thermometer`: of the row, the reading of a dummy or degC; NaN = unknown. A row that comes later than stale_ms has no
    // row before it that could contradict it.
    [[nodiscard]] Estimate judge(const Reading& reading, double thermometer);

    // The rows until now had no load, and this mean force, with the zero of the calibration.
    void tare(const Wrench& zero_S);

    // Returns the parts of the standard deviation of the last row.
    [[nodiscard]] const tactiled_budget& budget() const noexcept { return sensor_->placed().budget; }

private:
    std::optional<Sensor> sensor_;
    bool has_dummy_ = false, each_alone_ = false;
    std::uint64_t stale_ns_ = 0, last_ns_ = 0;
};

}  // namespace tactiled::ctl
