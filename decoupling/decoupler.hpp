// A model computes the force and torque of the world on a sensor from its channels. It never fails: it returns an
// estimate with its standard deviation and quality, and the reader decides.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/calibration.hpp"
#include "config/options.hpp"
#include "drivers/taxels.hpp"
#include "tactiled/layout.h"

namespace tactiled {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Six components: fx fy fz (N), mx my mz (Nm), frame S. NaN = not measured by this sensor, or BAD.
using Wrench = std::array<double, 6>;
inline constexpr Wrench kUnseen{kNaN, kNaN, kNaN, kNaN, kNaN, kNaN};

// The channels of one sensor at one time, in the order of Calibration::channels and in its unit.
struct Reading {
    std::span<const double> channel;  // NaN where missing
    std::uint32_t missing = 0;        // bit n: channel n
    std::uint32_t saturated = 0;      // bit n: channel n
    // CLOCK_MONOTONIC of the frame, for models that depend on the past (piezo, hysteresis)
    std::uint64_t t_ns = 0;
    double temperature_C = kNaN;  // temperature of the sensor; NaN = unknown
    Taxels taxels{};              // raw values of an array, which has no channels
    Wrench zero_S{};              // of the tare, which is subtracted later: rest and load begin there
};

// The temperature of a sensor in use, as declared by the user.
struct TemperatureInUse {
    double lowest_C = kNaN, highest_C = kNaN;  // range of the sensor's temperature; NaN = not declared
    // largest difference between two channels, or between a channel and the thermometer; NaN = not declared
    double difference_K = kNaN;
    double sd_K = kNaN;  // standard deviation of the range or of the thermometer; NaN = not declared
};

// The correlations of the errors of a calibration. Constant while the decoupler exists.
struct Correlations {
    std::array<float, 15> between{};  // two components; the order of tactiled_budget.correlation
    Wrench full_scale{kNoLoad, kNoLoad, kNoLoad, kNoLoad, kNoLoad, kNoLoad};
    // The calibration errors under two loads at the distance d in full scales have the correlation
    // alike / (1 + (d / alike_within)^2). NaN: not known.
    float alike = std::numeric_limits<float>::quiet_NaN(), alike_within = 1;
    std::uint32_t model = 0;  // tactiled_budget.model

    static constexpr double kNoLoad = std::numeric_limits<double>::infinity();  // not measured, or without a full scale
    // Returns the index of components c < d in `between`.
    static constexpr std::size_t index(std::size_t c, std::size_t d) noexcept { return c * (9 - c) / 2 + d - 1; }
    static const Correlations kNone;
};
inline constexpr Correlations Correlations::kNone{};

struct Estimate {
    Wrench wrench_S = kUnseen;
    Wrench sd = kUnseen;        // one standard deviation
    bool has_value = false;     // else wrench_S is NaN
    std::uint32_t reasons = 0;  // enum tactiled_reason
    double residual = kNaN;     // difference from the model, in standard deviations of the channels
    // Centre of pressure where the model finds it by itself, and its sd; else NaN: place.hpp computes it from the wrench.
    std::array<double, 2> cop_S_m{kNaN, kNaN}, cop_sd_m{kNaN, kNaN};
    // Parts of sd: what differs from sample to sample, the instrument of the labels, and temperature. The rest is the
    // calibration's.
    Wrench noise{}, reference{}, temperature{};
    const Correlations* correlations = &Correlations::kNone;  // the decoupler has them; never nullptr
    std::uint32_t direction = 0;  // method "signs": row of the decision table, 0 = none or not this method

    [[nodiscard]] tactiled_quality quality() const noexcept {
        return tactiled_quality(tactiled_verdict(reasons, has_value));
    }
};

class Patch;

class Decoupler {
public:
    virtual ~Decoupler() = default;

    // Returns for any bits in `reading` a finite wrench with the reasons to doubt it, or no value.
    // rt: wait-free
    [[nodiscard]] virtual Estimate decouple(const Reading& reading) noexcept = 0;

    // Resets the state that depends on the past, after missed or invalid readings. rt: wait-free
    virtual void forget() noexcept {}

    // Sets the known delay of each channel, from the middle of its measurement to t_ns of the reading, s. setup
    virtual void set_delay(std::span<const double> /*of_channel_s*/) noexcept {}
    // Returns the channels (bit k) by which component c follows a change of the load: c has their delay. setup
    [[nodiscard]] virtual std::uint32_t timed_by(std::size_t /*c*/) const noexcept { return ~0u; }
    // Adds the possible influence of temperature to the standard deviation from then on (temperature.hpp). setup
    virtual void set_temperature(const TemperatureInUse& /*in_use*/) noexcept {}

    [[nodiscard]] virtual std::string_view method() const noexcept = 0;
    // Returns the model of an array, nullptr if this model has channels. rt: wait-free
    [[nodiscard]] virtual Patch* patch() noexcept { return nullptr; }
};

struct DecouplerFault {
    std::string key;   // the key of [[sensor]] to change: "model", "calibration" or "method"
    std::string text;  // contains the calibration's file or the key
};

// Makes the decoupler of a calibration. `method`: "" = the one that the calibration was fitted for; "auto" =
// auto_method.hpp, within `budget_us` per sample. A method without a fit in the calibration has no standard deviation.
// Returns nullptr with `fault` set on failure. setup
std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, const std::string& method, double budget_us,
                                          DecouplerFault& fault);
// Does the same. setup: throws SetupError with the fault's text
std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, const std::string& method = "",
                                          double budget_us = 0);

}  // namespace tactiled
