#include "decoupling/csv_time.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace tactiled {
namespace {

constexpr double kLatest_s = 9e9;  // the year 2255, and below 2^63 in nanoseconds; the same before 0
// An absolute time lies between 2000 and 2100, so that its unit follows from its size.
constexpr double kYear2000_s = 946'684'800, kYear2100_s = 4'102'444'800;

struct Scale {
    const char* name;
    double unit_s;
};
constexpr Scale kScales[] = {{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}};

const char* name_of(double unit_s) {
    for (const Scale& scale : kScales)
        if (scale.unit_s == unit_s) return scale.name;
    return unit_s == 60 ? "min" : "h";
}

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
    return std::find(words.begin(), words.end(), word) != words.end();
}

struct Named {
    enum What { none, time, seconds, nanoseconds } what = none;
    double unit_s = 0;
};

// Words that say which clock it is, and not what the column is.
bool says_which(std::string_view word) {
    return is_one_of(word, {"header", "unix", "epoch", "utc", "relative", "rel", "elapsed", "ros", "host", "local", "sys",
                            "system", "since", "start", "recv", "log", "sensor", "device", "gps"});
}

Named named(const ColumnName& name) {
    const std::string_view column = name.text;
    std::vector<std::string> words;
    for (const std::string& word : name.words)
        if (!says_which(word) || (name.words.size() == 1 && word == "elapsed")) words.push_back(word);
    const bool is_capital = name.unit != nullptr && name.unit->text == "S" && words.size() == 1 &&
                            is_one_of(words[0], {"t", "time", "timestamp"});  // seconds there, siemens elsewhere
    const double unit_s = is_capital                                                      ? 1
                          : name.unit != nullptr && name.unit->quantity == Quantity::time ? name.unit->factor
                                                                                          : 0;
    if (name.unit != nullptr && unit_s == 0) return {};
    const bool is_seconds = unit_s == 1 && column.find("sec") != column.npos;
    if (words.size() == 1) {
        const ColumnUnit* unit = find_unit(words[0]);
        if (unit_s == 0 && words[0].size() > 1 && unit != nullptr && unit->quantity == Quantity::time)
            return {words[0].starts_with("nano") || words[0] == "nsec" || words[0] == "nsecs" ? Named::nanoseconds
                    : unit->factor == 1                                                       ? Named::seconds
                                                                                              : Named::time,
                    unit->factor};
        if (is_one_of(words[0], {"t", "time", "timestamp", "timestamps", "stamp", "date", "datetime", "elapsed", "clock"}))
            return {is_seconds                                            ? Named::seconds
                    : unit_s == 1e-9 && column.find("sec") != column.npos ? Named::nanoseconds
                                                                          : Named::time,
                    unit_s};
    }
    // stamp.sec and stamp.nanosec, time_stamp, date time
    if (words.size() == 2 && is_one_of(words[0], {"time", "date", "stamp"}) &&
        is_one_of(words[1], {"stamp", "time", "date"}))
        return {Named::time, unit_s};
    return {Named::none, unit_s};
}

// Reads "2026-03-01T10:00:00.25+01:00" as nanoseconds since 1970; no value if it is no such time.
std::optional<std::int64_t> iso_ns(std::string_view text) {
    std::size_t at = 0;
    const auto digits = [&](std::size_t n) -> int {
        int value = 0;
        if (text.size() < at + n) return -1;
        for (std::size_t i = 0; i < n; ++i, ++at) {
            if (text[at] < '0' || text[at] > '9') return -1;
            value = 10 * value + (text[at] - '0');
        }
        return value;
    };
    const auto mark = [&](std::string_view any) { return at < text.size() && any.find(text[at]) != any.npos && ++at > 0; };
    const int year = digits(4);
    if (year < 0 || !mark("-/")) return std::nullopt;
    const int month = digits(2);
    if (month < 1 || month > 12 || !mark("-/")) return std::nullopt;
    const int day = digits(2);
    if (day < 1 || day > 31 || !mark("T t_")) return std::nullopt;
    const int hour = digits(2);
    if (hour < 0 || hour > 24 || !mark(":")) return std::nullopt;
    const int minute = digits(2);
    if (minute < 0 || minute > 59) return std::nullopt;
    int second = 0;
    std::int64_t fraction_ns = 0;
    if (mark(":")) {
        second = digits(2);
        if (second < 0 || second > 60) return std::nullopt;
        if (mark(".,"))
            for (std::int64_t unit = 100'000'000; at < text.size() && text[at] >= '0' && text[at] <= '9'; ++at, unit /= 10)
                fraction_ns += unit * (text[at] - '0');
    }
    std::int64_t zone_s = 0;
    if (!mark("Zz") && at < text.size()) {
        const bool is_east = text[at] == '+';
        if (!mark("+-")) return std::nullopt;
        const int hours = digits(2);
        if (hours < 0) return std::nullopt;
        mark(":");
        const int minutes = at < text.size() ? digits(2) : 0;
        if (minutes < 0) return std::nullopt;
        zone_s = (is_east ? 1 : -1) * (hours * 3600 + minutes * 60);
    }
    if (at != text.size()) return std::nullopt;
    // Days from the civil date: the algorithm days_from_civil of the C++ calendar.
    const int y = month <= 2 ? year - 1 : year, era = y / 400, of_era = y - era * 400;
    const int of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
    const std::int64_t days = std::int64_t(era) * 146'097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719'468;
    const std::int64_t seconds = days * 86'400 + hour * 3600 + minute * 60 + second - zone_s;
    if (std::abs(double(seconds)) > kLatest_s) return std::nullopt;
    return seconds * 1'000'000'000 + fraction_ns;
}

std::optional<std::int64_t> whole(std::string_view cell) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc() || end != cell.data() + cell.size()) return std::nullopt;
    return value;
}

}  // namespace

bool names_time(const ColumnName& column) {
    const Named what = named(column);
    return what.what != Named::none || what.unit_s > 0;
}

bool is_date(std::string_view cell) { return iso_ns(cell).has_value(); }

TimeColumn::TimeColumn(const std::vector<std::string>& columns) {
    std::optional<std::size_t> seconds, nanoseconds, first, of_unit;
    const std::vector<ColumnName> names = column_names(columns);
    for (std::size_t k = 0; k < columns.size(); ++k) {
        const Named what = named(names[k]);
        if (what.what == Named::seconds && !seconds) seconds = k;
        if (what.what == Named::nanoseconds && !nanoseconds) nanoseconds = k;
        if (what.what != Named::none && !first) first = k;
        if (what.what == Named::none && what.unit_s > 0 && !of_unit) of_unit = k;  // a name in another language
    }
    if (!first) first = of_unit;
    if (const auto at = std::find(columns.begin(), columns.end(), "t_s"); at != columns.end())
        first = std::size_t(at - columns.begin());
    column_ = first;
    if (seconds && nanoseconds && first && (*first == *seconds || *first == *nanoseconds)) {
        column_ = seconds;
        nanoseconds_ = nanoseconds;
        kind_ = Kind::parts;
    }
    if (!column_) return;
    name_ = columns[*column_];
    unit_s_ = named(names[*column_]).unit_s;
}

std::vector<std::size_t> TimeColumn::columns() const {
    std::vector<std::size_t> result;
    for (const auto& column : {column_, nanoseconds_})
        if (column) result.push_back(*column);
    return result;
}

// The unit of the name, unless the number would be no time of these centuries then; else the size of the number.
void TimeColumn::decide(double value) {
    if (unit_s_ > 0 && std::abs(value) * unit_s_ <= kLatest_s) {
        kind_ = Kind::stated;
        factor_s_ = unit_s_;
        return;
    }
    for (const Scale& scale : kScales)
        if (value * scale.unit_s >= kYear2000_s && value * scale.unit_s < kYear2100_s) {
            kind_ = Kind::epoch;
            factor_s_ = scale.unit_s;
            return;
        }
    kind_ = unit_s_ > 0 ? Kind::stated : Kind::assumed;
    factor_s_ = unit_s_ > 0 ? unit_s_ : 1;
}

std::int64_t TimeColumn::of_number(const CsvReader& csv, double value) {
    if (kind_ == Kind::unknown) decide(value);
    if (kind_ == Kind::parts) factor_s_ = 1;
    if (std::abs(value) * factor_s_ > kLatest_s)
        csv.refuse(
            fmt::format("column {}: {:.4g} {} is no time of these centuries: is the column in ms, us or ns? Name it "
                        "t_s, t_ms, t_us or t_ns",
                        name_, value, name_of(factor_s_)));
    // A double holds nanoseconds since 1970 to 256 ns only.
    const double unit_ns = factor_s_ * 1e9;
    if (const auto exact = whole(csv.text(*column_))) return *exact * std::int64_t(std::llround(unit_ns));
    const double units = std::floor(value), part = value - units;
    return std::llround(units) * std::int64_t(std::llround(unit_ns)) + std::llround(part * unit_ns);
}

void TimeColumn::look_at(const CsvReader& csv) {
    for (std::size_t k = 0; k < csv.columns().size() && !column_; ++k)
        if (is_date(csv.text(k))) column_ = k, name_ = csv.columns()[k];
}

std::optional<std::int64_t> TimeColumn::read(const CsvReader& csv) {
    const std::string_view cell = csv.text(*column_);
    if (cell.empty()) return std::nullopt;
    if (const auto value = csv.value(*column_)) {
        if (kind_ == Kind::iso) csv.refuse(fmt::format("column {}: a number among dates", name_));
        if (std::isnan(*value)) return std::nullopt;
        const std::int64_t ns = of_number(csv, *value);
        if (!nanoseconds_) return ns;
        const double more = csv.number(*nanoseconds_);
        if (std::isnan(more)) return std::nullopt;
        if (!(more >= 0 && more < 1e9))
            csv.refuse(fmt::format("column {}: {} is outside 0 .. 999999999", csv.columns()[*nanoseconds_], more));
        return ns + std::int64_t(more);
    }
    const auto ns = iso_ns(cell);
    if (!ns || (kind_ != Kind::iso && kind_ != Kind::unknown))
        csv.refuse(csv.fault(*column_) + (ns ? "" : "; times are numbers, or dates such as 2026-03-01T10:00:00.250Z"));
    kind_ = Kind::iso;
    return ns;
}

std::string TimeColumn::about() const {
    switch (kind_) {
        case Kind::stated: return factor_s_ == 1 ? "" : fmt::format("in {}", name_of(factor_s_));
        case Kind::assumed: return "in s, because it names no unit";
        case Kind::epoch: return fmt::format("in {} since 1970, by its size", name_of(factor_s_));
        case Kind::iso: return "a date";
        case Kind::parts: return "seconds and nanoseconds";
        case Kind::unknown: break;
    }
    return "";
}

}  // namespace tactiled
