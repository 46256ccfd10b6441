// The header of a CSV file: which line has the names, and how cells are separated.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>

#include "decoupling/column_name.hpp"
#include "decoupling/csv.hpp"
#include "drivers/taxels.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxColumns = kMaxTaxels * kMaxTaxelValues + 16;  // an array with its labels
constexpr std::size_t kMaxPreamble = 100;  // lines above the first row of numbers: instruments write up to 40
constexpr std::size_t kMaxComments = 100'000;
constexpr std::string_view kSeparators = "\t;, ";  // a decimal comma is no separator where another one is
constexpr char kBom[] = "\xEF\xBB\xBF";

bool is_number(std::string_view cell, char separator) {
    std::string text(cell);
    if (separator != ',')
        if (const auto comma = text.find(','); comma != text.npos && text.find('.') == text.npos) text[comma] = '.';
    const std::string_view digits = std::string_view(text).substr(text.starts_with('+') ? 1 : 0);
    double value;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return end == digits.data() + digits.size() && (error == std::errc() || error == std::errc::result_out_of_range);
}

// A row of readings: half of its cells or more are numbers. The others may be times, sessions and marks.
bool has_numbers(const std::vector<std::string>& cells, char separator) {
    const auto n = std::count_if(cells.begin(), cells.end(), [&](const auto& cell) { return is_number(cell, separator); });
    const auto empty = std::count(cells.begin(), cells.end(), "");
    return n > 0 && 2 * std::size_t(n) >= cells.size() - std::size_t(empty);
}

// "# t_s, R1" has its names behind the mark; "#1,#2" is a list of names.
std::string_view behind_mark(std::string_view line) {
    const std::size_t begin = line.find_first_not_of("#%/ \t");
    return begin == line.npos ? std::string_view() : line.substr(begin);
}

bool is_comment(std::string_view line) { return line.starts_with('#') || line.starts_with('%') || line.starts_with("//"); }

std::string_view without_brackets(std::string_view cell) {
    const bool has = cell.size() > 2 && (cell.front() == '[' || cell.front() == '(');
    return has ? cell.substr(1, cell.size() - 2) : cell;
}

bool is_empty(std::string_view line) { return line.find_first_not_of(" \t") == line.npos; }

}  // namespace

// The lines up to the first row of readings, without empty ones.
struct CsvReader::Preamble {
    std::vector<Line> lines;
    bool has_row = false;  // the last line is a row of readings
    char separator = ',';
    std::size_t cells = 0;  // number in the row

    [[nodiscard]] std::size_t texts() const { return lines.size() - (has_row ? 1 : 0); }
};

// 0: a quote is not closed.
std::size_t CsvReader::number_of_cells(std::string_view line, char separator) const {
    try {
        return cells_of(line, separator).size();
    } catch (const SetupError&) { return 0; }
}

void CsvReader::find_header(std::vector<std::string> names) {
    Preamble preamble;
    // Returns true if the line is a row of readings; sets how it is separated: as a line above it.
    const auto is_row = [&](const std::string& line) {
        for (const char separator : kSeparators) {
            const std::size_t n = number_of_cells(line, separator);
            if (n < 2 || !has_numbers(cells_of(line, separator), separator)) continue;
            const bool is_alike =
                preamble.lines.empty() || std::any_of(preamble.lines.begin(), preamble.lines.end(), [&](const Line& above) {
                    return number_of_cells(above.text, separator) == n ||
                           (is_comment(above.text) && number_of_cells(behind_mark(above.text), separator) == n);
                });
            if (!is_alike) continue;
            preamble.separator = separator;
            preamble.cells = n;
            return true;
        }
        return false;
    };
    std::string line;
    char stated = 0;
    for (std::size_t texts = 0; texts < kMaxPreamble && preamble.lines.size() < kMaxComments && lines_.next(line);) {
        line_ = lines_.line();
        if (line.starts_with(kBom)) line.erase(0, 3);  // behind another one, as Excel does with files that have one
        if (line.starts_with("sep=") && line.size() == 5 && preamble.lines.empty()) {
            stated = line[4];
            continue;
        }
        if (is_empty(line)) continue;
        texts += is_comment(line) ? 0 : 1;
        preamble.has_row = !is_comment(line) && is_row(line);
        preamble.lines.push_back({line, lines_.line()});
        if (preamble.has_row) break;
        // A row that is like no line above, or a single column.
        if (!is_comment(line) && preamble.lines.size() == 2 && !is_comment(preamble.lines[0].text) &&
            number_of_cells(line, ',') == 1 && number_of_cells(line, ';') == 1 && is_number(line, ',')) {
            preamble.has_row = true;
            preamble.cells = 1;
            break;
        }
    }
    if (preamble.lines.empty()) throw SetupError(name() + ": is empty; the first line names the columns: t_s,R1,R3,...");
    if (!preamble.has_row) {
        // No row of readings: the first line that is no comment is the header, with the separator that makes most of it.
        const auto first = std::find_if(preamble.lines.begin(), preamble.lines.end(),
                                        [](const Line& each) { return !is_comment(each.text); });
        const Line& header = first == preamble.lines.end() ? preamble.lines.back() : *first;
        for (const char separator : {',', ';', '\t', ' '})
            if (const std::size_t n = number_of_cells(behind_mark(header.text), separator); n > preamble.cells)
                if (preamble.cells < 2 || separator != ' ') preamble.separator = separator, preamble.cells = n;
    }
    if (stated != 0) preamble.separator = stated;
    separator_ = preamble.separator;
    take_header(preamble, std::move(names));
    check_names();
}

// Chooses the header among the lines above the first row, and keeps the lines behind it for next().
void CsvReader::take_header(const Preamble& preamble, std::vector<std::string> names) {
    const auto& lines = preamble.lines;
    std::size_t header = lines.size();  // its index
    if (names.empty()) {
        const auto fits = [&](std::size_t i, std::string_view text) {
            line_ = lines[i].number;
            if (number_of_cells(text, separator_) != preamble.cells) return false;
            const auto cells = cells_of(text, separator_);
            return std::none_of(cells.begin(), cells.end(), [&](const auto& cell) { return is_number(cell, separator_); });
        };
        for (std::size_t i = 0; i < preamble.texts() && header == lines.size(); ++i)
            if (!is_comment(lines[i].text) && fits(i, lines[i].text)) header = i;
        for (std::size_t i = preamble.texts(); i-- > 0 && header == lines.size();)
            if (is_comment(lines[i].text) && fits(i, behind_mark(lines[i].text))) header = i, is_marked_ = true;
        // Without a line that fits, messages call the first line that is no comment the header.
        for (std::size_t i = 0; i < lines.size() && header == lines.size(); ++i)
            if (!is_comment(lines[i].text)) header = i;
        if (header == lines.size()) header = lines.size() - 1;
        line_ = lines[header].number;
        const std::string_view text = is_marked_ ? behind_mark(lines[header].text) : std::string_view(lines[header].text);
        columns_ = cells_of(text, separator_);
        header_ = columns_;
        const bool all_numbers = preamble.has_row && header + 1 == lines.size();
        if (all_numbers)
            refuse(fmt::format("column 1 is named \"{}\"; the first line names the columns: t_s,R1,R3,... (or --columns)",
                               columns_[0]));
    } else {
        columns_ = std::move(names);
        header = preamble.texts() - 1;
        if (preamble.has_row && preamble.cells != columns_.size()) {
            line_ = lines.back().number;
            refuse(fmt::format("{} cells, --columns names {}", preamble.cells, columns_.size()));
        }
    }
    for (std::size_t i = lines.size(); i-- > 0 && i != header;) ahead_.push_back(lines[i]);
    // A row of units behind the header: "s, counts, mN, -".
    if (ahead_.size() < 2 || number_of_cells(ahead_.back().text, separator_) != columns_.size()) return;
    const auto units = cells_of(ahead_.back().text, separator_);
    const bool are_units = std::all_of(units.begin(), units.end(), [](const std::string& cell) {
        return cell.empty() || cell == "-" || find_unit(without_brackets(cell)) != nullptr;
    });
    if (!are_units || std::all_of(units.begin(), units.end(), [](const auto& cell) { return cell.empty() || cell == "-"; }))
        return;
    ahead_.pop_back();
    for (std::size_t k = 0; k < columns_.size(); ++k)
        if (find_unit(without_brackets(units[k])) != nullptr && column_name(columns_[k]).unit == nullptr)
            columns_[k] += fmt::format(" [{}]", without_brackets(units[k]));
}

void CsvReader::check_names() {
    if (columns_.size() > kMaxColumns) refuse(fmt::format("{} columns; at most {}", columns_.size(), kMaxColumns));
    std::set<std::string_view> names;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
        if (columns_[k].empty()) columns_[k] = fmt::format("column {}", k + 1);
        if (is_number(columns_[k], separator_))
            refuse(fmt::format("column {} is named \"{}\"; the first line names the columns: t_s,R1,R3,... (or --columns)",
                               k + 1, columns_[k].substr(0, 40)));
        if (!names.insert(columns_[k]).second)
            refuse(fmt::format("column \"{}\" is there twice", columns_[k].substr(0, 40)));
    }
}

}  // namespace tactiled
