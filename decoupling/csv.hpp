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

namespace tactiled {

struct CloseFile {
    void operator()(std::FILE* file) const noexcept {
        if (file != nullptr && file != stdin && file != stdout) std::fclose(file);
    }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

class CsvReader {
public:
    // Opens a file and reads its header; "-" is standard input. setup: throws SetupError where the file cannot be
    // opened or its header is not a list of distinct names
    explicit CsvReader(const std::string& path);

    [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
    [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;

    // Reads the next row that is not empty. Returns false at the end. setup: throws SetupError where the row has
    // another number of cells than the header, is longer than 1 MiB, or a quote is not closed
    bool next();

    // Returns the cell without surrounding blanks and quotes, valid until the next row.
    [[nodiscard]] std::string_view text(std::size_t column) const { return cells_[column]; }
    // Returns the number in a cell, NaN if it is empty or says nan. setup: throws SetupError where it is not a
    // number, or exceeds a double
    [[nodiscard]] double number(std::size_t column) const;

    [[nodiscard]] std::int64_t line() const { return line_; }
    [[nodiscard]] const std::string& name() const { return name_; }
    [[noreturn]] void refuse(const std::string& text) const;  // the message begins with "file:line: "

private:
    bool read_line();
    void split();

    std::string name_;
    File file_;
    std::string buffer_;  // the present line
    std::vector<std::string> cells_;
    std::vector<std::string> columns_;
    std::int64_t line_ = 0;  // line number; a pipe at 1 kHz passes 2^31 in 25 days
};

class ForcesWriter {
public:
    // Opens a file, or standard output for "-", which is flushed with each row, and writes the header. setup: throws
    // SetupError where the file cannot be created
    explicit ForcesWriter(const std::string& path);
    // Writes a row. A component that the sensor cannot measure is an empty cell. Each number is the shortest text that reads
    // back to the same double.
    // setup: throws std::runtime_error if writing fails
    void write(double t_s, const Estimate& estimate, std::string_view quality);
    void close();  // throws like write()

private:
    void put(const std::string& row);

    std::string name_;
    File file_;
    std::string row_;
};

}  // namespace tactiled
