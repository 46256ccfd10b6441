// A calibration file: one individual sensor, the conversion of its channels to the components of the wrench, and its
// accuracy.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"

namespace tactiled {

// fx fy fz in N, mx my mz in Nm, frame S.
inline constexpr std::array<const char*, 6> kComponentNames{"fx", "fy", "fz", "mx", "my", "mz"};

// Damage of one channel that a reading may not show. The order is that of UndetectedDamage::share.
struct DamageKind {
    const char *key, *text;  // key of the calibration file; as the predicate of a channel
};
inline constexpr std::array<DamageKind, 5> kDamageKinds{{{"stuck", "stuck at an earlier value"},
                                                         {"half_gain", "at half gain"},
                                                         {"drifting", "drifting by 30 % of its range"},
                                                         {"exchanged", "exchanged with another"},
                                                         {"zero", "dead at its zero"}}};

// Share of the rows, 0 .. 1, in which a damaged channel moves a component by more than 10 % of full scale from the estimate
// of the undamaged row, and the sample is GOOD; of the rows that are GOOD without damage. decoupling/fit/damage.hpp
struct UndetectedDamage {
    std::array<std::vector<double>, kDamageKinds.size()> share;  // [kind][channel]; empty = unknown

    [[nodiscard]] bool is_known() const noexcept { return !share.front().empty(); }
    // Returns the mean over the channels. kind: index of kDamageKinds
    [[nodiscard]] double mean(std::size_t kind) const noexcept;
    // Returns the kind with the largest mean, which counts for undetected_damage_limit, and the worst channel of a kind.
    [[nodiscard]] std::size_t worst_kind() const noexcept;
    [[nodiscard]] std::size_t worst_channel(std::size_t kind) const noexcept;
};

// The calibration data of one method for an individual sensor; each method documents the members that it needs.
struct Fit {
    std::string method;                       // "matrix", "linear" ...
    std::vector<double> zero;                 // reading of each channel without load, in channel_unit
    std::vector<std::vector<double>> matrix;  // components x channels: N or Nm per channel_unit
    std::map<std::string, double> parameters;
    std::map<std::string, std::vector<std::vector<double>>> tables;  // rows of numbers: centres, weights ...
    // Per component, N or Nm; empty = unknown. The root mean square of the errors on held-out data is hypot(sd, sd_slope *
    // |component|, sd_load * load). The load is the magnitude of the
    // force as a part of the greatest full scale (decoupling/solve/load_scale.hpp).
    std::vector<double> sd, sd_slope, sd_load;
    // Per component, N or Nm; empty = 0. Increases the standard deviation to hypot(the above, sd_unloading (peak - load)),
    // with the load as a part of full scale and its peak since the last rest (decoupling/unloading.hpp).
    std::vector<double> sd_unloading;
    // Per component, N or Nm; empty = 0. The part of sd that differs from sample to sample under one load.
    std::vector<double> sd_noise;
    // Correlations of the errors of two components, -1 .. 1: n (n - 1) / 2 numbers, the rows above the diagonal; empty =
    // they are taken as independent.
    std::vector<double> correlation;
    // {alike, within}: the errors under two loads at the distance d, each component in its full scale, have the correlation
    // alike / (1 + (d / within)^2); empty = none.
    std::vector<double> alike;
    // Standard uncertainty of the labels that is common to all rows: per component, N or Nm (empty = 0), and relative.
    std::vector<double> reference_sd;
    double reference_gain_sd = 0;
    // Per component: root mean square error on held-out rows, N or Nm; empty = unknown.
    std::vector<double> held_out_rms;
    UndetectedDamage undetected_damage;
    double condition = 0;  // condition number of the scaled problem that was solved; 0 = unknown
    // Groups that were held out: "leave one session out (2 sessions)" ...; ends with kOwnZeros if each session had its own.
    static constexpr std::string_view kOwnZeros = ", each with its own zero";
    std::string validation;
};

inline constexpr std::size_t kMaxScores = 6;  // limit of a monitor with products
constexpr std::size_t products_of(std::size_t scores) { return scores * (scores + 1) / 2; }

// Readings that a load can cause, all channels together, as seen in the rows of the calibration: n channels with m scores
// t = scores (channel - mean), and r <= n - m residuals e = residual (channel - mean) - coefficients p, where p are the
// products t_1 t_1, t_1 t_2 .. t_m t_m minus product_mean. A reading is inside if |t|^2 <= limit^2 and
// |e|^2 <= residual_limit^2 (1 + (|t|^2 + |product_whitening p|^2) / (m + number of p)). See decoupling/monitor.hpp.
struct Monitor {
    std::vector<double> mean;                            // per channel, in channel_unit
    std::vector<std::vector<double>> scores;             // m rows of n numbers, 1 / channel_unit
    double limit = 0;                                    // 0 = the calibration has no monitor
    std::vector<std::vector<double>> residual;           // r rows of n numbers, 1 / channel_unit; empty = there is none
    double residual_limit = 0;                           // 0 = no residual
    std::vector<double> product_mean;                    // empty = the residual is linear
    std::vector<std::vector<double>> coefficients;       // r rows, one number per product
    std::vector<std::vector<double>> product_whitening;  // lower triangle
    double false_alarms = 0;                             // share of the held-out rows outside, 0 .. 1
    bool is_older = false;                               // from the joint domain of an older file: all channels are scores
};

// The longest repetition of one number by each channel while the load was held, and its noise, in the rows of the
// calibration.
struct Repeats {
    std::vector<int> readings;  // per channel: longest run of equal readings; 0 = its end was not seen. Empty = unknown
    double interval_s = 0;      // median time between two readings; 0 = unknown
    // Per channel, channel_unit: standard deviation of the noise in the quieter quarter of the stretches without a load; 0 =
    // below two steps of the channel, which do not show it. Empty = unknown
    std::vector<double> noise{};
};

// Zero and gain of each channel against temperature: with dT = temperature - reference_C reading = zero + zero_per_K dT + (1
// + gain_per_K dT) (reading at reference_C - zero) for each channel. See decoupling/temperature.hpp.
struct Temperature {
    double reference_C = 0;
    std::vector<double> range_C;                       // lowest and highest temperature for which the coefficients hold
    std::vector<double> zero, zero_per_K, gain_per_K;  // per channel: channel_unit, channel_unit / K, 1 / K; empty = unknown
    std::vector<double> zero_per_K_sd, gain_per_K_sd;  // one standard deviation of these; empty = 0
    // The thermometer, if it is a dummy: an unloaded gauge in a channel of its own. temperature = reference_C + (reading -
    // dummy_zero) / dummy_per_K.
    std::string dummy;          // name of its channel, which is none of `channels`; "" = a thermometer in degC
    double dummy_zero = 0;      // channel_unit
    double dummy_per_K = 1;     // channel_unit / K
    double dummy_per_K_sd = 0;  // one standard deviation; 0 if the coefficients of the channels are relative to the dummy
    double dummy_difference_K = 0.5;  // largest difference of temperature between the dummy and a channel, as stated

    [[nodiscard]] double of_dummy_C(double reading) const noexcept {
        return reference_C + (reading - dummy_zero) / dummy_per_K;
    }
};

// The fit of the preferred method, and the fits of other methods of the same model for the same channels and components.
struct Calibration : Fit {
    std::string path;
    std::string model;  // "generic", "table"
    // the body that pressed on the sensor during calibration: "uniform", "point", "unknown" ...
    std::string contact_model;
    std::string serial;
    std::string date;  // YYYY-MM-DD
    // from a drawing or a document; the individual sensor was not calibrated
    bool nominal = false;
    std::vector<std::string> channels;                // names, in the order of the matrix's columns
    std::string channel_unit;                         // "dR/R0", "pF", "counts" ...
    std::vector<double> channel_least, channel_most;  // range of the calibration's rows; empty = unknown
    Monitor monitor;
    Repeats repeats;
    Temperature temperature;
    std::vector<double>
        zero_drift;  // per channel: sd of the zero that the fits and each sd include, channel_unit; empty = 0
    std::vector<std::string> components;  // subset of kComponentNames that the sensor measures, in this order
    std::vector<double> full_scale;       // per component, N or Nm; empty = unknown
    // Per component, N or Nm: standard deviation of the zero an hour after it was known, and of the zero of another mounting
    // or power-up. Empty: not seen in the rows.
    std::vector<double> zero_rate_per_h, zero_shift;
    // Returns the growth that the daemon uses: the error of a force where no drift was seen, because none is not proved. The
    // sd alone may be that of a rest.
    [[nodiscard]] const std::vector<double>& zero_growth_per_h() const noexcept {
        return !zero_rate_per_h.empty() ? zero_rate_per_h : held_out_rms.size() == sd.size() ? held_out_rms : sd;
    }
    int rows = 0;  // labelled rows used
    // CRC-16/CCITT-FALSE over the file up to its line `crc = `, and over those of `taxels`
    std::uint16_t crc = 0;
    std::vector<Fit> others;
    // An array whose taxels have a model of their own: the calibration of all taxels or one of each, named by files in the
    // folder of this one. Empty: none; load_calibration() reads the files.
    std::vector<std::string> taxel_files;
    std::vector<Calibration> taxels;

    // Returns the undetected damage of the method that a sensor runs: "" = the calibration's own. For "auto" that
    // of the method with the largest mean counts; it is unknown if it is unknown for one.
    [[nodiscard]] const UndetectedDamage& undetected_damage_of(const std::string& name) const noexcept;
    // Returns this calibration with the fit of `name`, if it has one, and without the others.
    [[nodiscard]] Calibration with_method(const std::string& name) const;
};

// Reads and checks a file: format version, known model, matching sizes, finite numbers, CRC (a file without a crc
// line, written by hand, is accepted and its crc computed). Errors go to `problems`. setup: never throws for bad
// input
Calibration load_calibration(const std::string& path, Problems& problems);

// Does the same from text; `name` stands for the file in errors.
Calibration parse_calibration(std::string_view text, const std::string& name, Problems& problems);

// Returns the file's text with the crc line. load(save(c)) == c to the last bit.
std::string calibration_text(const Calibration& calibration);
// Writes a file by a temporary file, fsync, rename, and fsync of the folder; the calibration must be one that
// load_calibration would accept.
// setup: throws SetupError if a step fails; the old file is then unchanged
void save_calibration(const Calibration& calibration, const std::string& path);

}  // namespace tactiled
