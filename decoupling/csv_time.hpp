// The time of a row, in seconds, milliseconds, microseconds or nanoseconds, since an event or since 1970, as a number, as
// two numbers (seconds and nanoseconds) or as a date of ISO 8601.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "decoupling/column_name.hpp"
#include "decoupling/csv.hpp"

namespace tactiled {

// Returns true if the name is that of a time, whether it is used or not. setup
bool names_time(const ColumnName& column);
// Returns true if the cell is a date of ISO 8601 with a time.
bool is_date(std::string_view cell);

class TimeColumn {
public:
    // Finds the column by its name: t_s, else the first of time, timestamp, stamp, t, date, with or without
    // a unit, else the first with a unit of time.
    explicit TimeColumn(const std::vector<std::string>& columns);

    [[nodiscard]] bool is_there() const { return column_.has_value(); }
    [[nodiscard]] std::vector<std::size_t> columns() const;  // one, or two: seconds and nanoseconds

    // Takes the first column with a date in the present row, if no name says that it is a time.
    void look_at(const CsvReader& csv);

    // Reads the time of the present row into ns; no value where the cell is empty. The first row determines the unit if the
    // name has none. setup: throws SetupError where the cell is no time, or is not within 285 years of 0
    std::optional<std::int64_t> read(const CsvReader& csv);

    // Describes how times were read: "ms since 1970, by their size"; and whether only the size of the numbers says so.
    [[nodiscard]] std::string about() const;
    // The name has no unit and the times are no dates: they were read as seconds.
    [[nodiscard]] bool is_assumed() const { return kind_ == Kind::assumed; }

private:
    enum class Kind { unknown, stated, assumed, epoch, iso, parts };
    [[nodiscard]] std::int64_t of_number(const CsvReader& csv, double value);
    void decide(double value);

    std::optional<std::size_t> column_, nanoseconds_;
    std::string name_;
    double unit_s_ = 0;  // unit in the name; 0: none
    double factor_s_ = 1;
    Kind kind_ = Kind::unknown;
};

}  // namespace tactiled
