// Reads labelled.csv: channels of a sensor together with the forces that a reference measured at the same time.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/fit/columns.hpp"

namespace tactiled {

struct LabelledRow {
    std::int64_t line;            // line in the file
    std::vector<double> channel;  // NaN where missing
    Wrench wrench_S = kUnseen;    // NaN where the reference has none
    std::size_t session = 0;      // index in Labelled::sessions
    std::uint64_t t_ns = 0;       // time in the file, 0 = unknown
    double temperature_C = kNaN;  // temperature in the file
};

struct Labelled {
    std::string name;  // path of the file
    std::vector<std::string> channels;
    std::vector<std::string> sessions;  // sessions in the file; empty = the file has no such column
    std::vector<LabelledRow> rows;      // in the order of the file, with or without a label
    std::string columns = {};           // the list of the classes of its columns, one line for each
};

struct Selection {
    std::vector<std::string> sessions;  // names of the sessions to read; empty = all
    std::vector<std::string> channels;  // names of the channels, in this order; empty = columns whose names have that shape
    std::string labels = {};  // a file with the labels, aligned by time (align.hpp); "" = they are in the same file
    std::vector<std::string> columns = {};  // names of the columns of a file without a header
    KnownNames known = nullptr;             // names that the model knows as channels
    bool only_labels = false;               // a file of labels: no column is a channel
};

// Returns the column of component c in labelled.csv and forces.csv: "fx_N" .. "mz_Nm".
std::string label_column(std::size_t c);

// Classes the columns (columns.hpp), converts labels and times, and aligns labels of another file.
// setup: throws SetupError with all faults of the file in one message, and the list of its columns
Labelled read_labelled(const std::string& path, const Selection& selection);

}  // namespace tactiled
