// signals.csv and labelled.csv in, forces.csv out: a row at a time, so that `-` may be an endless pipe. Numbers do not
// depend on the locale. Every error names file:line, the column and what is right.
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
    // "-" is standard input. Reads the header. setup: throws SetupError where the file cannot be opened or its header is
    // no list of distinct names
    explicit CsvReader(const std::string& path);

    [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
    [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;

    // Goes to the next row that is not empty. false at the end. setup: throws SetupError where the row has another
    // number of cells than the header, is longer than 1 MiB, or a quote is not closed
    bool next();

    // The cell without surrounding blanks and quotes; valid until the next row.
    [[nodiscard]] std::string_view text(std::size_t column) const { return cells_[column]; }
    // NaN where the cell is empty or says nan. setup: throws SetupError where it is no number, or beyond a double
    [[nodiscard]] double number(std::size_t column) const;

    [[nodiscard]] std::int64_t line() const { return line_; }
    [[nodiscard]] const std::string& name() const { return name_; }
    [[noreturn]] void refuse(const std::string& text) const;  // "file:line: text"

private:
    bool read_line();
    void split();

    std::string name_;
    File file_;
    std::string buffer_;  // the line
    std::vector<std::string> cells_;
    std::vector<std::string> columns_;
    std::int64_t line_ = 0;  // of the text; a pipe at 1 kHz passes 2^31 in 25 days
};

class ForcesWriter {
public:
    // "-" is standard output, written through with each row. Writes the header. setup: throws SetupError where the file
    // cannot be created
    explicit ForcesWriter(const std::string& path);
    // A component that the sensor cannot measure is an empty cell. Each number is the shortest text that reads back to the
    // same double.
    // setup: throws std::runtime_error where it cannot be written
    void write(double t_s, const Estimate& estimate, std::string_view quality);
    void close();  // same as write()

private:
    void put(const std::string& row);

    std::string name_;
    File file_;
    std::string row_;
};

}  // namespace tactiled
