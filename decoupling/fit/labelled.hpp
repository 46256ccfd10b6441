// Reads labelled.csv: channels of a sensor together with the forces that a reference measured at the same time.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled {

struct LabelledRow {
    std::int64_t line;            // line in the file
    std::vector<double> channel;  // NaN where missing
    Wrench wrench_S = kUnseen;    // NaN where the reference has none
    std::size_t session = 0;      // index in Labelled::sessions
    std::uint64_t t_ns = 0;       // the file's t_s, 0 = unknown
    double temperature_C = kNaN;  // the file's temperature_C
};

struct Labelled {
    std::string name;  // path of the file
    std::vector<std::string> channels;
    std::vector<std::string> sessions;  // sessions in the file; empty = the file has no such column
    std::vector<LabelledRow> rows;      // in the order of the file, with or without a label
};

struct Selection {
    std::vector<std::string> sessions;  // names of the sessions to read; empty = all
    std::vector<std::string> channels;  // names of the channels, in this order; empty = every column that is not a label
};

// Returns the column of component c in labelled.csv and forces.csv: "fx_N" .. "mz_Nm".
std::string label_column(std::size_t c);

// setup: throws SetupError where the file, a column or a number is wrong, or no row remains
Labelled read_labelled(const std::string& path, const Selection& selection);

}  // namespace tactiled
