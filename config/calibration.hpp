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

// The data of one method about an individual sensor. Each method documents its own needs.
struct Fit {
    std::string method;                       // "matrix", "linear" ...
    std::vector<double> zero;                 // reading of each channel without load, in channel_unit
    std::vector<std::vector<double>> matrix;  // components x channels: N or Nm per channel_unit
    std::map<std::string, double> parameters;
    std::map<std::string, std::vector<std::vector<double>>> tables;  // rows of numbers: centres, weights ...
    // Per component, from errors on held-out data, N or Nm; empty = unknown. At least 68 % of them are below
    // hypot(sd, sd_slope * |component|), 95 % below 1.96 times and 99 % below 2.58 times that.
    std::vector<double> sd, sd_slope;
    // Per component: root mean square error on held-out rows, N or Nm; empty = unknown.
    std::vector<double> held_out_rms;
    double condition = 0;    // condition number of the scaled problem that was solved; 0 = unknown
    std::string validation;  // groups that were held out: "leave one session out (2 sessions)" ...
};

// The readings of the calibration's rows, all channels together: those with |whitening (channel - mean)| <= limit.
// See decoupling/joint_domain.hpp.
struct JointDomain {
    std::vector<double> mean;                    // per channel, in channel_unit
    std::vector<std::vector<double>> whitening;  // lower triangle, 1 / channel_unit: row i has i + 1 numbers
    double limit = 0;                            // 0 = the calibration has no joint domain
    double false_alarms = 0;                     // share of the held-out rows beyond the limit, 0 .. 1
};

// Its own Fit, and those of other methods of the same model, for the same channels and components.
struct Calibration : Fit {
    std::string path;
    std::string model;  // "generic", "table"
    // the body that pressed on the sensor during calibration: "uniform", "point", "unknown" ...
    std::string contact_model;
    std::string serial;
    std::string date;  // YYYY-MM-DD
    // from a drawing or a document: the individual sensor was not calibrated
    bool nominal = false;
    std::vector<std::string> channels;                // names, in the order of the matrix's columns
    std::string channel_unit;                         // "dR/R0", "pF", "counts" ...
    std::vector<double> channel_least, channel_most;  // range of the calibration's rows; empty = unknown
    JointDomain joint_domain;
    std::vector<double>
        zero_drift;  // per channel: sd of the zero that the fits and each sd allow for, channel_unit; empty = 0
    std::vector<std::string> components;  // subset of kComponentNames that the sensor measures, in this order
    std::vector<double> full_scale;       // per component, N or Nm; empty = unknown
    int rows = 0;                         // labelled rows used
    std::uint16_t crc = 0;                // CRC-16/CCITT-FALSE over the file up to its line `crc = `
    std::vector<Fit> others;

    // Returns this calibration with the fit of `name`, if it has one, and without the others.
    [[nodiscard]] Calibration with_method(const std::string& name) const;
};

// Reads and checks a file: format version, known model, matching sizes, finite numbers, CRC (a file without a crc
// line, written by hand, is accepted and its crc computed). Errors go to `problems`. setup: never throws for bad
// input
Calibration load_calibration(const std::string& path, Problems& problems);

// Does the same from text; `name` stands for the file in errors.
Calibration parse_calibration(std::string_view text, const std::string& name, Problems& problems);
// CRC-16/CCITT-FALSE: polynomial 0x1021, starts at 0xFFFF, 0x29B1 of "123456789".
std::uint16_t calibration_crc(std::string_view bytes);

// Returns the file's text with the crc line. load(save(c)) == c to the last bit.
std::string calibration_text(const Calibration& calibration);
// Writes a file by a temporary file, fsync, rename, and fsync of the folder; the calibration must be one that
// load_calibration would accept.
// setup: throws SetupError where a step is refused; the old file stands then
void save_calibration(const Calibration& calibration, const std::string& path);

}  // namespace tactiled
