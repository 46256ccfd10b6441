// The cells of a labelled file with the classes of its columns, and everything that is wrong with it.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "decoupling/fit/labelled.hpp"

namespace tactiled {

struct LabelledTable {
    std::string name, about;  // the file and its unusual properties
    std::string time_about;   // describes the reading of times
    std::vector<Column> columns;
    std::vector<std::vector<double>> values;        // [column][row]; NaN where missing or no number
    std::vector<std::optional<std::int64_t>> t_ns;  // per row
    std::vector<std::int64_t> line;                 // per row
    std::vector<std::size_t> session;               // per row: index in `sessions`
    std::vector<std::string> sessions;              // empty: no such column
    std::vector<std::string> faults;                // sentences that begin with "file:line: " or "file: "

    [[nodiscard]] std::size_t rows() const { return line.size(); }
    [[nodiscard]] std::string list() const;  // names the columns of each class
};

// setup: throws SetupError where the file cannot be read at all
LabelledTable read_labelled_table(const std::string& path, const Selection& selection);

// setup: throws SetupError with all faults of the tables and their lists, if there are any
void refuse_faults(const std::vector<const LabelledTable*>& tables);

// ---- column_checks.cpp ----

// Makes unknown columns whose numbers rise by the same step from row to row to row numbers. setup
void check_counts(LabelledTable& table);

// Finds among the channels those that cannot be one: a copy of a label or of the time, and a number that is the same in all
// rows of each load although the other channels are not. They become unknown. Sets the class of constants. setup
void check_column_data(LabelledTable& table);

}  // namespace tactiled
