#include "decoupling/csv.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

namespace tactiled {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

// Returns the text of an invalid cell for a message: short, and without control characters for the terminal.
std::string shown(std::string_view text) {
    std::string result;
    for (const char c : text.substr(0, 40)) result += (c >= ' ' && c <= '~') ? c : '?';
    if (text.size() > 40) result += "...";
    return result;
}

std::optional<double> parse(std::string_view text) {
    if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

// Returns a hint to the meaning of a cell that is not a number, "" if there is none.
std::string hint(std::string_view cell, std::int64_t line) {
    const bool starts_with_digit =
        !cell.empty() && (std::isdigit(static_cast<unsigned char>(cell[0])) != 0 || cell[0] == '-');
    if (starts_with_digit && cell.find(',') != cell.npos) return "; decimals are written with '.', thousands without a mark";
    const auto blank = cell.find(' ');
    if (starts_with_digit && blank != cell.npos && parse(cell.substr(0, blank)))
        return "; the unit is in the column's name only";
    const bool is_word = std::none_of(cell.begin(), cell.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    if (line == 2 && is_word && cell.size() <= 3) return "; is this a row of units? Delete it";
    return "; a missing one is an empty cell";
}

}  // namespace

bool is_missing(std::string_view cell) {
    constexpr std::string_view kMarks[] = {"NA", "N/A", "#N/A", "n/a", "NULL", "null", "None", "NaT", "-", "--", "<NA>"};
    return std::find(std::begin(kMarks), std::end(kMarks), cell) != std::end(kMarks);
}

CsvReader::CsvReader(const std::string& path, std::vector<std::string> names) : lines_(path) {
    find_header(std::move(names));
}

std::optional<std::size_t> CsvReader::find(std::string_view name) const {
    auto at = std::find(columns_.begin(), columns_.end(), name);
    if (at == columns_.end())
        at =
            std::find_if(columns_.begin(), columns_.end(), [&](const auto& column) { return channel_name(column) == name; });
    if (at == columns_.end()) return std::nullopt;
    return std::size_t(at - columns_.begin());
}

std::string channel_name(std::string_view column) {
    std::string name(column);
    std::replace_if(
        name.begin(), name.end(), [](char c) { return is_blank(c) || c == ',' || c == '"'; }, '_');
    return name;
}

bool CsvReader::next() {
    for (;;) {
        if (!read_line()) return false;
        if (buffer_.starts_with('#')) {
            ++comments_;
            continue;
        }
        if (std::all_of(buffer_.begin(), buffer_.end(), is_blank)) continue;
        split();
        if (cells_ != header_) break;
        ++headers_;  // files that were joined
    }
    if (cells_.size() != columns_.size())
        refuse(fmt::format("{} cells, the header has {} columns{}", cells_.size(), columns_.size(),
                           cells_.size() == columns_.size() + 1 && cells_.back().empty()  ? "; is there a ',' at the end?"
                           : separator_ == ',' && 2 * cells_.size() > 3 * columns_.size() ? "; decimals are written with '.'"
                                                                                          : ""));
    return true;
}

std::optional<double> CsvReader::value(std::size_t column) const {
    const std::string_view cell = cells_[column];
    if (cell.empty() || is_missing(cell)) return kNaN;
    const std::size_t comma = separator_ == ',' ? cell.npos : cell.find(',');
    const char mark = comma != cell.npos ? ',' : cell.find('.') != cell.npos ? '.' : char(0);
    std::optional<double> value;
    if (mark == ',') {
        if (cell.find('.') != cell.npos) return std::nullopt;
        std::string text(cell);
        text[comma] = '.';
        value = parse(text);
    } else {
        value = parse(cell);
    }
    if (!value || std::isinf(*value)) return std::nullopt;
    // With both marks in one file, one of them separates thousands.
    if (mark != 0 && separator_ != ',') {
        if (decimal_mark_ == 0) decimal_mark_ = mark;
        if (decimal_mark_ != mark) return std::nullopt;
    }
    return value;
}

std::string CsvReader::fault(std::size_t column) const {
    const std::string_view cell = cells_[column];
    const bool other_mark = separator_ != ',' && decimal_mark_ != 0 &&
                            cell.find(decimal_mark_ == ',' ? '.' : ',') != cell.npos &&
                            cell.find_first_of("0123456789") == 0;
    return fmt::format("column {}: \"{}\" is no number{}", shown(columns_[column]), shown(cell),
                       other_mark ? fmt::format("; the decimals before have '{}', and thousands have no mark", decimal_mark_)
                                  : hint(cell, line_));
}

double CsvReader::number(std::size_t column) const {
    const auto number = value(column);
    if (!number) refuse(fault(column));
    return *number;
}

std::string CsvReader::about() const {
    std::vector<std::string> parts;
    if (const std::string text = lines_.about(); !text.empty()) parts.push_back(text);
    if (separator_ != ',')
        parts.push_back(separator_ == '\t'  ? "separated by tabs"
                        : separator_ == ' ' ? "separated by blanks"
                                            : fmt::format("separated by '{}'", separator_));
    if (decimal_mark_ == ',') parts.emplace_back("decimals with ','");
    if (is_marked_) parts.emplace_back("header behind '#'");
    if (comments_ > 0) parts.push_back(fmt::format("{} comments between the rows", comments_));
    if (headers_ > 0) parts.push_back(fmt::format("the header {} times more between the rows", headers_));
    return fmt::format("{}", fmt::join(parts, ", "));
}

void CsvReader::refuse(const std::string& text) const { throw SetupError(fmt::format("{}:{}: {}", name(), line_, text)); }

bool CsvReader::read_line() {
    if (!ahead_.empty()) {
        buffer_ = std::move(ahead_.back().text);
        line_ = ahead_.back().number;
        ahead_.pop_back();
        return true;
    }
    const bool is_there = lines_.next(buffer_);
    line_ = lines_.line();
    return is_there;
}

// Quotes as in RFC 4180, except that a quoted line break is refused: names and numbers have none.
std::vector<std::string> CsvReader::cells_of(std::string_view line, char separator) const {
    std::vector<std::string> cells;
    std::size_t at = 0;
    const auto skip_blanks = [&] {
        while (at < line.size() && is_blank(line[at]) && line[at] != separator) ++at;
        while (separator == ' ' && at < line.size() && is_blank(line[at])) ++at;
    };
    const auto ends = [&](std::size_t i) {
        return i >= line.size() || line[i] == separator || (separator == ' ' && is_blank(line[i]));
    };
    for (;;) {
        std::string cell;
        skip_blanks();
        if (at < line.size() && line[at] == '"') {
            for (++at;; ++at) {
                if (at >= line.size()) refuse(fmt::format("column {}: the quote is not closed", cells.size() + 1));
                if (line[at] == '"' && (at + 1 >= line.size() || line[at + 1] != '"')) break;
                if (line[at] == '"') ++at;
                cell += line[at];
            }
            ++at;
            while (!ends(at) && is_blank(line[at])) ++at;
            if (!ends(at)) refuse(fmt::format("column {}: text after the closing quote", cells.size() + 1));
        } else {
            const std::size_t begin = at;
            while (!ends(at)) ++at;
            cell = line.substr(begin, at - begin);
            while (!cell.empty() && is_blank(cell.back())) cell.pop_back();
        }
        cells.push_back(std::move(cell));
        if (separator == ' ') skip_blanks();
        if (at >= line.size()) return cells;
        if (separator != ' ') ++at;
    }
}

}  // namespace tactiled
