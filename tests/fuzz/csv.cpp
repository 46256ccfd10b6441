// Texts as CSV files. Oracles: an accepted table, written again with every cell in quotes, is read the same; numbers are
// those of the C library; the rows are those that a model splits at leisure.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "config/options.hpp"
#include "decoupling/csv.hpp"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;

class TextFile {
public:
    TextFile() : fd_(::memfd_create("csv", 0)), path_("/proc/self/fd/" + std::to_string(fd_)) {}
    const std::string& hold(std::string_view text) const {
        check(::ftruncate(fd_, 0) == 0 && ::pwrite(fd_, text.data(), text.size(), 0) == ssize_t(text.size()));
        return path_;
    }

private:
    int fd_;
    std::string path_;
};

struct Table {
    std::vector<std::string> columns;
    std::vector<std::vector<std::string>> rows;
    bool operator==(const Table&) const = default;
};

bool read(const std::string& path, Table& table) {
    try {
        CsvReader reader(path);
        table.columns = reader.columns();
        while (reader.next()) {
            auto& row = table.rows.emplace_back();
            for (std::size_t k = 0; k < table.columns.size(); ++k) {
                row.emplace_back(reader.text(k));
                check(reader.find(table.columns[k]) == k);
                try {
                    const double number = reader.number(k);
                    std::string cell = row.back();
                    std::replace(cell.begin(), cell.end(), ',', '.');  // a decimal comma
                    check(cell.empty() ? std::isnan(number) : !std::isinf(number));
                    if (!std::isnan(number)) {
                        char* end = nullptr;
                        check(std::strtod(cell.c_str(), &end) == number && *end == 0);
                    }
                } catch (const SetupError&) {}
            }
        }
        return true;
    } catch (const SetupError& error) {
        check(std::strlen(error.what()) != 0);
        return false;
    }
}

std::string quoted(const std::vector<std::string>& cells) {
    std::string line;
    for (const auto& cell : cells) {
        line += line.empty() ? "\"" : ",\"";
        for (const char c : cell) line += c == '"' ? std::string("\"\"") : std::string(1, c);
        line += '"';
    }
    return line + '\n';
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const TextFile file;
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    Table table;
    if (!read(file.hold(text), table)) return 0;
    std::string again = quoted(table.columns);
    for (const auto& row : table.rows) again += quoted(row);
    Table back;
    check(read(file.hold(again), back) && back == table);
    return 0;
}
