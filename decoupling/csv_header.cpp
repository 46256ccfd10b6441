// The header of a CSV file: which line has the names, and how cells are separated.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <deque>
#include <iterator>
#include <set>

#include "decoupling/column_name.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/csv_time.hpp"
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

const ColumnUnit* unit_of_cell(const std::string& cell) { return find_unit(without_brackets(cell)); }

// Names, and not units, marks for missing values, dates, or the groups above the names.
bool are_names(const std::vector<std::string>& cells) {
    const bool has_other = std::any_of(cells.begin(), cells.end(), [](const std::string& cell) {
        return cell.empty() || is_missing(cell) || is_date(cell);
    });
    if (has_other || cells.size() > kMaxColumns) return false;
    const auto units =
        std::count_if(cells.begin(), cells.end(), [](const auto& cell) { return unit_of_cell(cell) != nullptr; });
    return std::set(cells.begin(), cells.end()).size() == cells.size() && 2 * std::size_t(units) <= cells.size();
}

// Readings of one column in two units, if both rows are right. Readings have no factor.
bool differ(const ColumnUnit& a, const ColumnUnit& b) {
    return a.quantity != b.quantity || a.factor != b.factor || a.offset != b.offset;
}

bool begins_with_letter(std::string_view cell) {
    return !cell.empty() && !is_missing(cell) && (std::isalpha(static_cast<unsigned char>(cell[0])) != 0 || cell[0] < 0);
}

bool is_empty(std::string_view line) { return line.find_first_not_of(" \t") == line.npos; }

}  // namespace

// The lines up to the first row of readings, without empty ones.
struct CsvReader::Preamble {
    std::vector<Line> lines;
    bool has_row = false;  // the last line is a row of readings
    char separator = ',';
    std::size_t cells = 0;     // number in the row
    std::deque<Line> waiting;  // lines below that were read to judge one

    [[nodiscard]] std::size_t texts() const { return lines.size() - (has_row ? 1 : 0); }
};

// 0: a quote is not closed.
std::size_t CsvReader::number_of_cells(std::string_view line, char separator) const {
    try {
        return cells_of(line, separator).size();
    } catch (const SetupError&) { return 0; }
}

// Returns true if the line is a row of readings; sets how it is separated: as a line above it.
bool CsvReader::is_row(Preamble& preamble, const std::string& line) {
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
        return is_followed(preamble, cells_of(line, separator)[0]);
    }
    return false;
}

// "Rate,1000" above the header looks like a row: a line that begins with a word is one only if lines with as many cells
// follow, up to one with the same word or to the end, and none has a number in the word's place.
bool CsvReader::is_followed(Preamble& preamble, const std::string& word) {
    if (!begins_with_letter(word) || is_number(word, preamble.separator)) return true;
    for (std::size_t i = 0; i < kMaxPreamble; ++i) {
        if (i == preamble.waiting.size()) {
            Line next;
            if (!lines_.next(next.text)) return true;
            next.number = lines_.line();
            preamble.waiting.push_back(std::move(next));
        }
        const std::string& text = preamble.waiting[i].text;
        if (is_empty(text) || is_comment(text)) continue;
        if (number_of_cells(text, preamble.separator) != preamble.cells) return false;
        const auto cells = cells_of(text, preamble.separator);
        if (cells[0] == word) return true;
        if (is_number(cells[0], preamble.separator)) return false;
    }
    return true;
}

// Takes the next line: one that was read to judge a line above it, or one of the file.
bool CsvReader::fetch(Preamble& preamble, Line& line) {
    if (preamble.waiting.empty()) {
        if (!lines_.next(line.text)) return false;
        line.number = lines_.line();
        return true;
    }
    line = std::move(preamble.waiting.front());
    preamble.waiting.pop_front();
    return true;
}

void CsvReader::find_header(std::vector<std::string> names) {
    Preamble preamble;
    Line at;
    std::string& line = at.text;
    char stated = 0;
    for (std::size_t texts = 0; texts < kMaxPreamble && preamble.lines.size() < kMaxComments && fetch(preamble, at);) {
        line_ = at.number;
        if (line.starts_with(kBom)) line.erase(0, 3);  // behind another one, as Excel does with files that have one
        if (line.starts_with("sep=") && line.size() == 5 && preamble.lines.empty()) {
            stated = line[4];
            continue;
        }
        if (is_empty(line)) continue;
        texts += is_comment(line) ? 0 : 1;
        preamble.has_row = !is_comment(line) && is_row(preamble, line);
        preamble.lines.push_back(at);
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
    ahead_.assign(std::make_move_iterator(preamble.waiting.rbegin()), std::make_move_iterator(preamble.waiting.rend()));
    take_header(preamble, std::move(names));
    check_names();
}

// Returns the index of the header: the last line of names above the first row, else the first line that fits, else the last
// comment that fits.
std::size_t CsvReader::choose_header(const Preamble& preamble) {
    const auto& lines = preamble.lines;
    const auto cells_that_fit = [&](std::size_t i, std::string_view text) {
        line_ = lines[i].number;
        std::vector<std::string> cells;
        if (number_of_cells(text, separator_) == preamble.cells) cells = cells_of(text, separator_);
        if (std::any_of(cells.begin(), cells.end(), [&](const auto& cell) { return is_number(cell, separator_); }))
            cells.clear();
        return cells;
    };
    std::optional<std::size_t> first, last;
    for (std::size_t i = 0; i < preamble.texts(); ++i) {
        const auto cells = is_comment(lines[i].text) ? std::vector<std::string>() : cells_that_fit(i, lines[i].text);
        if (cells.empty()) continue;
        if (!first) first = i;
        if (are_names(cells)) last = i;
    }
    if (last || first) return last ? *last : *first;
    for (std::size_t i = preamble.texts(); i-- > 0;)
        if (is_comment(lines[i].text) && !cells_that_fit(i, behind_mark(lines[i].text)).empty()) {
            is_marked_ = true;
            return i;
        }
    // Without a line that fits, messages call the first line that is no comment the header.
    for (std::size_t i = 0; i < lines.size(); ++i)
        if (!is_comment(lines[i].text)) return i;
    return lines.size() - 1;
}

// Chooses the header among the lines above the first row, and keeps the lines behind it for next().
void CsvReader::take_header(const Preamble& preamble, std::vector<std::string> names) {
    const auto& lines = preamble.lines;
    std::size_t header = preamble.texts() - 1;
    if (names.empty()) {
        header = choose_header(preamble);
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
        if (preamble.has_row && preamble.cells != columns_.size()) {
            line_ = lines.back().number;
            refuse(fmt::format("{} cells, --columns names {}", preamble.cells, columns_.size()));
        }
    }
    for (std::size_t i = lines.size(); i-- > 0 && i != header;) ahead_.push_back(lines[i]);
    take_units();
}

// A row of units behind the header: "s, counts, mN, -".
void CsvReader::take_units() {
    if (ahead_.size() < 2 || number_of_cells(ahead_.back().text, separator_) != columns_.size()) return;
    const auto units = cells_of(ahead_.back().text, separator_);
    const auto is_none = [](const std::string& cell) { return cell.empty() || cell == "-"; };
    const bool are_units = std::all_of(units.begin(), units.end(),
                                       [&](const auto& cell) { return is_none(cell) || unit_of_cell(cell) != nullptr; });
    if (!are_units || std::all_of(units.begin(), units.end(), is_none)) return;
    line_ = ahead_.back().number;
    ahead_.pop_back();
    const std::vector<ColumnName> named = column_names(columns_);
    for (std::size_t k = 0; k < columns_.size(); ++k) {
        const ColumnUnit* unit = unit_of_cell(units[k]);
        if (unit == nullptr) continue;
        if (named[k].unit == nullptr)
            columns_[k] += fmt::format(" [{}]", without_brackets(units[k]));
        else if (differ(*unit, *named[k].unit))
            refuse(fmt::format("column {} is in {} by its name and in {} by the row of units; keep the right one",
                               columns_[k], named[k].unit->text, units[k]));
    }
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
