// labelled.csv: channels of a sensor beside the forces that a reference measured at the same time.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled {

struct LabelledRow {
    std::int64_t line;            // in the file
    std::vector<double> channel;  // NaN where missing
    Wrench wrench_S = kUnseen;    // NaN where the reference gave none
    std::size_t session = 0;      // index in Labelled::sessions
    std::uint64_t t_ns = 0;       // of the file's t_s, 0 = unknown
    double temperature_C = kNaN;  // of the file's temperature_C
};

struct Labelled {
    std::string name;  // of the file
    std::vector<std::string> channels;
    std::vector<std::string> sessions;  // those that occur; empty = the file has no such column
    std::vector<LabelledRow> rows;      // in the order of the file, with or without a label
};

struct Selection {
    std::vector<std::string> sessions;  // only these; empty = all
    std::vector<std::string> channels;  // only these, in this order; empty = every column that is no label
};

// The column of component c in labelled.csv and forces.csv: "fx_N" .. "mz_Nm".
std::string label_column(std::size_t c);

// setup: throws SetupError where the file, a column or a number is wrong, or nothing is left of it
Labelled read_labelled(const std::string& path, const Selection& selection);

}  // namespace tactiled
