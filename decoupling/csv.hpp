// Reads signals.csv and labelled.csv and writes forces.csv, one row at a time, so that `-` may be an endless pipe.
// Numbers do not depend on the locale. Every error names file:line, the column and the right value.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/text_lines.hpp"

namespace tactiled {

struct CloseFile {
    void operator()(std::FILE* file) const noexcept {
        if (file != nullptr && file != stdin && file != stdout) std::fclose(file);
    }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

// Returns the name that a column has as a channel: '_' in place of blanks, commas and quotes, which no list of channels
// can hold.
std::string channel_name(std::string_view column);

// True for a mark of spreadsheets, pandas, R and databases for a value that is not there.
bool is_missing(std::string_view cell);

class CsvReader {
public:
    // Opens a file and reads its header; "-" is standard input. Reads gzip and npy, text in UTF-8, UTF-16 and Latin-1; cells
    // between commas, semicolons, tabs or blanks; a header behind '#', and below other lines. `names`: of the columns of a
    // file without a header.
    // setup: throws SetupError where the file cannot be opened or its header is not a list of distinct names
    explicit CsvReader(const std::string& path, std::vector<std::string> names = {});

    [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
    // False for a column without a name in the header, which is called "column 3".
    [[nodiscard]] bool has_name(std::size_t column) const { return header_.empty() || !header_[column].empty(); }
    // Finds a column by its name, or by the name that a channel of it has.
    [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;

    // Reads the next row that is not empty and no comment. Returns false at the end. setup: throws SetupError where the row
    // has another number of cells than the header, is longer than 1 MiB, or a quote is not closed
    bool next();

    // Returns the cell without surrounding blanks and quotes, valid until the next row.
    [[nodiscard]] std::string_view text(std::size_t column) const { return cells_[column]; }
    // Returns the number in a cell, NaN if it is empty or a mark for a missing value; no value if it is not a number.
    [[nodiscard]] std::optional<double> value(std::size_t column) const;
    // The same. setup: throws SetupError where the cell is not a number, or exceeds a double
    [[nodiscard]] double number(std::size_t column) const;
    // Describes a cell that is not a number: "column R1: "x" is no number; ...".
    [[nodiscard]] std::string fault(std::size_t column) const;

    [[nodiscard]] std::int64_t line() const { return line_; }
    [[nodiscard]] char separator() const { return separator_; }  // ' ' = any number of blanks
    [[nodiscard]] const std::string& name() const { return lines_.name(); }
    // Describes what is unusual about the file: "gzip, separated by ';', decimals with ','"; "" = nothing.
    [[nodiscard]] std::string about() const;
    [[noreturn]] void refuse(const std::string& text) const;  // the message begins with "file:line: "

private:
    struct Line {
        std::string text;
        std::int64_t number;
    };
    struct Preamble;  // csv_header.cpp
    bool is_row(Preamble& preamble, const std::string& line);
    bool is_followed(Preamble& preamble, const std::string& word);
    bool fetch(Preamble& preamble, Line& line);

    bool read_line();
    void find_header(std::vector<std::string> names);
    [[nodiscard]] std::size_t choose_header(const Preamble& preamble);
    void take_header(const Preamble& preamble, std::vector<std::string> names);
    void take_units();
    void check_names();
    void split() { cells_ = cells_of(buffer_, separator_); }
    [[nodiscard]] std::vector<std::string> cells_of(std::string_view line, char separator) const;
    [[nodiscard]] std::size_t number_of_cells(std::string_view line, char separator) const;

    TextLines lines_;
    std::vector<Line> ahead_;  // lines behind the header that were read to find it, the next one last
    std::string buffer_;       // the present line
    std::vector<std::string> cells_;
    std::vector<std::string> columns_;
    std::vector<std::string> header_;  // the cells in the file
    char separator_ = ',';             // ' ' = any number of blanks
    mutable char decimal_mark_ = 0;    // the mark in the first number that has one
    bool is_marked_ = false;           // the header stands behind '#'
    std::int64_t line_ = 0, comments_ = 0, headers_ = 0;
};

class ForcesWriter {
public:
    // Opens a file, or standard output for "-", which is flushed with each row, and writes the header. setup: throws
    // SetupError where the file cannot be created
    explicit ForcesWriter(const std::string& path, bool has_budget = false);
    // Writes a row. A component that the sensor cannot measure is an empty cell. Each number is the shortest text that reads
    // back to the same double.
    // setup: throws std::runtime_error if writing fails
    // `budget`: the numbers of struct tactiled_budget in its order, if the file has them.
    void write(double t_s, const Estimate& estimate, std::string_view quality, const tactiled_budget& budget = {});
    void close();  // throws like write()

private:
    void put(const std::string& row);

    std::string name_;
    File file_;
    std::string row_;
    bool has_budget_;
};

}  // namespace tactiled
