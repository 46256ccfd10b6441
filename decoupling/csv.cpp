#include "decoupling/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>
#include <set>
#include <stdexcept>

#include "drivers/taxels.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kLongestLine_bytes = 1u << 20;
constexpr std::size_t kMaxColumns = kMaxTaxels * kMaxTaxelValues + 16;  // an array with its labels

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
std::string hint(std::string_view cell, std::string_view column, std::int64_t line) {
    const bool starts_with_digit =
        !cell.empty() && (std::isdigit(static_cast<unsigned char>(cell[0])) != 0 || cell[0] == '-');
    if (cell == column) return "; the header is there a second time: are two files joined?";
    if (column == "t_s" && starts_with_digit && cell.find_first_of(":-T", 1) != cell.npos)
        return "; times are seconds, such as 12.5";
    if (starts_with_digit && cell.find(',') != cell.npos) return "; decimals are written with '.', thousands without a mark";
    const auto blank = cell.find(' ');
    if (starts_with_digit && blank != cell.npos && parse(cell.substr(0, blank)))
        return "; the unit is in the column's name only";
    const bool is_word = std::none_of(cell.begin(), cell.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    const bool is_missing = cell.find('/') != cell.npos || cell.size() > 3 || cell == "-" || cell == "NA";  // N/A, None, ...
    if (line == 2 && is_word && !is_missing) return "; is this a row of units? Delete it";
    return "; a missing one is an empty cell";
}

std::string why_not_opened(const std::string& path) { return fmt::format("{}: {}", path, std::strerror(errno)); }

}  // namespace

CsvReader::CsvReader(const std::string& path) : name_(path == "-" ? "standard input" : path) {
    file_.reset(path == "-" ? stdin : std::fopen(path.c_str(), "re"));
    if (file_ == nullptr) throw SetupError(why_not_opened(path));
    if (!read_line()) throw SetupError(name_ + ": is empty; the first line names the columns: t_s,R1,R3,...");
    // the byte order mark that spreadsheets write before UTF-8
    if (buffer_.starts_with("\xEF\xBB\xBF")) buffer_.erase(0, 3);
    if (buffer_.starts_with("\xFF\xFE") || buffer_.starts_with("\xFE\xFF") || buffer_.find('\0') != buffer_.npos)
        refuse("is no text in UTF-8 (UTF-16?); save it as \"CSV UTF-8\"");
    if (buffer_.find('\r') != buffer_.npos) refuse("lines end with a carriage return alone; end them with a line feed");
    if (buffer_.starts_with('#') || buffer_.starts_with("sep="))
        refuse("is no header; delete the lines before the one that names the columns: t_s,R1,R3,...");
    split();
    columns_ = cells_;
    if (columns_.size() == 1 && columns_[0].find('\t') != std::string::npos)
        refuse("columns are separated by tabs here; separate them by ','");
    if (columns_.size() == 1 && columns_[0].find(';') != std::string::npos)
        refuse(
            "columns are separated by ';' here; separate them by ',' and write decimals with '.', as tr ';,' ',.' < FILE "
            "does");
    if (columns_.size() == 1 && columns_[0].find(' ') != std::string::npos)
        refuse("columns are separated by blanks here; separate them by ','");
    if (columns_.size() > kMaxColumns) refuse(fmt::format("{} columns; at most {}", columns_.size(), kMaxColumns));
    std::set<std::string_view> names;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
        if (columns_[k].empty())
            refuse(fmt::format("column {} has no name{}", k + 1, k == 0 ? "; is it a row number? Delete it" : ""));
        if (parse(columns_[k]))
            refuse(fmt::format("column {} is named \"{}\"; the first line names the columns: t_s,R1,R3,...", k + 1,
                               shown(columns_[k])));
        if (!names.insert(columns_[k]).second) refuse(fmt::format("column \"{}\" is there twice", shown(columns_[k])));
    }
}

std::optional<std::size_t> CsvReader::find(std::string_view name) const {
    const auto at = std::find(columns_.begin(), columns_.end(), name);
    if (at == columns_.end()) return std::nullopt;
    return std::size_t(at - columns_.begin());
}

bool CsvReader::next() {
    do {
        if (!read_line()) return false;
    } while (std::all_of(buffer_.begin(), buffer_.end(), is_blank));
    split();
    if (cells_.size() != columns_.size())
        refuse(fmt::format("{} cells, the header has {} columns{}", cells_.size(), columns_.size(),
                           cells_.size() == columns_.size() + 1 && cells_.back().empty() ? "; is there a ',' at the end?"
                           : 2 * cells_.size() > 3 * columns_.size()                     ? "; decimals are written with '.'"
                                                                                         : ""));
    return true;
}

double CsvReader::number(std::size_t column) const {
    const std::string_view cell = cells_[column];
    if (cell.empty()) return kNaN;
    const auto value = parse(cell);
    if (!value || std::isinf(*value))
        refuse(fmt::format("column {}: \"{}\" is no number{}", shown(columns_[column]), shown(cell),
                           hint(cell, columns_[column], line_)));
    return *value;
}

void CsvReader::refuse(const std::string& text) const { throw SetupError(fmt::format("{}:{}: {}", name_, line_, text)); }

bool CsvReader::read_line() {
    buffer_.clear();
    int c;
    while ((c = ::getc_unlocked(file_.get())) != EOF && c != '\n') {
        if (buffer_.size() == kLongestLine_bytes) {
            ++line_;
            refuse(fmt::format("longer than {} bytes; is this a CSV file?", kLongestLine_bytes));
        }
        buffer_ += char(c);
    }
    if (c == EOF && std::ferror(file_.get()) != 0) throw SetupError(why_not_opened(name_));
    if (c == EOF && buffer_.empty()) return false;
    ++line_;
    if (!buffer_.empty() && buffer_.back() == '\r') buffer_.pop_back();
    return true;
}

// Quotes as in RFC 4180, except that a quoted line break is refused: names and numbers have none.
void CsvReader::split() {
    cells_.clear();
    std::size_t at = 0;
    const auto skip_blanks = [&] {
        while (at < buffer_.size() && is_blank(buffer_[at])) ++at;
    };
    for (;;) {
        std::string cell;
        skip_blanks();
        if (at < buffer_.size() && buffer_[at] == '"') {
            for (++at;; ++at) {
                if (at >= buffer_.size()) refuse(fmt::format("column {}: the quote is not closed", cells_.size() + 1));
                if (buffer_[at] == '"' && (at + 1 >= buffer_.size() || buffer_[at + 1] != '"')) break;
                if (buffer_[at] == '"') ++at;
                cell += buffer_[at];
            }
            ++at;
            skip_blanks();
            if (at < buffer_.size() && buffer_[at] != ',')
                refuse(fmt::format("column {}: text after the closing quote", cells_.size() + 1));
        } else {
            const std::size_t end = std::min(buffer_.find(',', at), buffer_.size());
            cell = buffer_.substr(at, end - at);
            while (!cell.empty() && is_blank(cell.back())) cell.pop_back();
            at = end;
        }
        cells_.push_back(std::move(cell));
        if (at >= buffer_.size()) return;
        ++at;  // the comma
    }
}

ForcesWriter::ForcesWriter(const std::string& path) : name_(path == "-" ? "standard output" : path) {
    file_.reset(path == "-" ? stdout : std::fopen(path.c_str(), "we"));
    if (file_ == nullptr) throw SetupError(why_not_opened(path));
    // A consumer at the other end of a pipe receives each row immediately and not after 4 kB.
    if (path == "-") std::setvbuf(stdout, nullptr, _IOLBF, 1u << 16);
    put("t_s,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,sd_fx_N,sd_fy_N,sd_fz_N,quality,cop_x_m,cop_y_m,direction,residual,"
        "sd_mx_Nm,sd_my_Nm,sd_mz_Nm,sd_cop_x_m,sd_cop_y_m\n");
}

void ForcesWriter::write(double t_s, const Estimate& estimate, std::string_view quality) {
    row_.clear();
    const auto add = [&](double number) {
        if (std::isfinite(number)) fmt::format_to(std::back_inserter(row_), "{}", number);
        row_ += ',';
    };
    add(t_s);
    for (const double component : estimate.wrench_S) add(component);
    for (std::size_t c = 0; c < 3; ++c) add(estimate.sd[c]);
    // Several reasons are separated by commas and need quotes.
    const bool quoted = quality.find(',') != std::string_view::npos;
    if (quoted) row_ += '"';
    row_ += quality;
    if (quoted) row_ += '"';
    row_ += ',';
    for (const double coordinate : estimate.cop_S_m) add(coordinate);
    add(estimate.direction == 0 ? kNaN : double(estimate.direction));
    add(estimate.residual);
    for (std::size_t c = 3; c < 6; ++c) add(estimate.sd[c]);
    for (const double sd : estimate.cop_sd_m) add(sd);
    row_.back() = '\n';
    put(row_);
}

void ForcesWriter::close() {
    std::FILE* file = file_.release();
    const bool shared = file == stdout;
    if ((shared ? std::fflush(file) : std::fclose(file)) != 0) throw std::runtime_error(why_not_opened(name_));
}

void ForcesWriter::put(const std::string& row) {
    if (std::fwrite(row.data(), 1, row.size(), file_.get()) != row.size()) throw std::runtime_error(why_not_opened(name_));
}

}  // namespace tactiled
