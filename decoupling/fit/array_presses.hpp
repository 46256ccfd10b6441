// Reads the recording of an array: a CSV with a row for each frame.
//
//     Z0,Z1 ...          or X0,Y0,Z0,X1 ...: the values of taxel 0, 1 ..., named as the channels of the calibration
//     fz_N, or fx_N fy_N fz_N        the total force on the array in S; a press has fz < 0
//     x_mm, y_mm         the centre of the press in S; optional, and a cell may be empty
//     press              names the press that a row belongs to; empty: the array is not loaded. Optional: otherwise rows
//     whose
//                        forces are all 0 are not loaded, and a press ends with an unloaded row or at another place
//     t_s, session       not used
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/patch/places.hpp"

namespace tactiled {

struct ArrayRequest {
    std::string in;
    // Places of the taxels, and what is known beforehand: channels, the tables `taxel`, `gain` and `dead`.
    Calibration start;
    double saturates_below = -std::numeric_limits<double>::infinity();
    double saturates_above = std::numeric_limits<double>::infinity();
};

// The mean of consecutive rows of one press with the same labels.
struct PressStep {
    std::int64_t line = 0;  // line of its last row
    std::size_t press = 0;
    int rows = 0;
    std::array<double, 3> force_N{};          // NaN = no label
    std::array<double, 2> place_m{};          // NaN = unknown
    std::vector<std::uint16_t> taxel;         // in contact, or beside one that is
    std::vector<std::vector<float>> value{};  // [value][of these taxels], less the zero
};

struct Presses {
    std::size_t taxels = 0;
    std::vector<std::string> channels;
    std::vector<std::vector<double>> zero, noise;  // [value][taxel]: mean and sd of the unloaded rows, channel_unit
    std::vector<std::uint8_t> is_missing;          // taxels without a value in more than half of the rows
    std::vector<PressStep> steps;
    std::size_t presses = 0;
    int rest_rows = 0, loaded_rows = 0, left_out = 0;  // left_out: loaded, but a taxel has no value

    // Variance of the mean of a step less the zero, over that of one value.
    [[nodiscard]] double noise_part(const PressStep& step) const { return 1. / step.rows + 1. / rest_rows; }
};

// Returns the column of each value of each taxel, [value][taxel]. Channels are found in the header if `channels` is empty.
// setup: throws SetupError where columns are missing, or are not those of `taxels` taxels
std::vector<std::vector<std::size_t>> taxel_columns(const CsvReader& csv, std::size_t taxels,
                                                    std::vector<std::string>& channels);

// Reads the file twice. setup: throws SetupError where the file is wrong or has no unloaded or no loaded rows
Presses read_presses(const ArrayRequest& request, const TaxelPlaces& places);

// Calls `f(raw values in the order of Taxels)` for each unloaded row. setup: throws SetupError
void for_each_unloaded(const ArrayRequest& request, const TaxelPlaces& places,
                       const std::function<void(const std::vector<float>&)>& f);

// A taxel is in contact if it exceeds its noise so many times: noise alone puts one of n into contact in a step of 100 (the
// level of decoupling/patch/contact.hpp).
double contact_level(std::size_t n);

}  // namespace tactiled
