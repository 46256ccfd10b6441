// Columns with the name of a channel and the numbers of another thing.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "decoupling/fit/labelled_table.hpp"

namespace tactiled {
namespace {

// A part of the spread: a reference has six digits at most, and a channel noise.
constexpr double kCopy = 1e-6;
constexpr std::size_t kEnoughRows = 30;  // fewer do not distinguish a copy from a sensor without noise
constexpr std::size_t kFewRowsOfCount = 5;

using Values = std::vector<double>;

// Returns true if the numbers rise by the same step in every row.
bool is_count(const Values& values) {
    if (values.size() < kFewRowsOfCount) return false;
    const double step = values[1] - values[0];
    if (!(step != 0)) return false;
    for (std::size_t i = 1; i < values.size(); ++i)
        if (!(std::abs(values[i] - values[i - 1] - step) <= 1e-9 * std::abs(step))) return false;
    return true;
}

bool is_constant(const Values& values) {
    double min = std::numeric_limits<double>::infinity(), max = -min;
    for (const double x : values)
        if (std::isfinite(x)) min = std::min(min, x), max = std::max(max, x);
    return !(min < max);
}

// Returns true if `values` is an affine function of `of`.
bool is_copy(const Values& values, const Values& of) {
    double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
    const auto each = [&](auto f) {
        for (std::size_t i = 0; i < values.size(); ++i)
            if (std::isfinite(values[i]) && std::isfinite(of[i])) f(of[i], values[i]);
    };
    each([&](double a, double b) { ++n, x += a, y += b; });
    if (n < double(kEnoughRows)) return false;
    x /= n, y /= n;
    each([&](double a, double b) { xx += (a - x) * (a - x), yy += (b - y) * (b - y), xy += (a - x) * (b - y); });
    if (!(xx > 0 && yy > 0)) return false;
    double rest = 0;
    each([&](double a, double b) { rest += std::pow(b - y - xy / xx * (a - x), 2); });
    return rest <= kCopy * kCopy * yy;
}

// Rows of one load, in the order of the loads: only those of two rows and more.
std::vector<std::vector<std::size_t>> rows_of_loads(const LabelledTable& table) {
    std::map<std::vector<double>, std::vector<std::size_t>> loads;
    for (std::size_t i = 0; i < table.rows(); ++i) {
        std::vector<double> load;
        for (std::size_t k = 0; k < table.columns.size(); ++k)
            if (table.columns[k].kind == ColumnKind::label && table.columns[k].is_used) load.push_back(table.values[k][i]);
        if (!load.empty() && std::all_of(load.begin(), load.end(), [](double x) { return std::isfinite(x); }))
            loads[load].push_back(i);
    }
    std::vector<std::vector<std::size_t>> result;
    for (auto& [load, rows] : loads)
        if (rows.size() > 1) result.push_back(std::move(rows));
    return result;
}

// Returns true if the value is the same in all rows of each load, and is not the same under all loads.
bool is_same_under_loads(const Values& values, const std::vector<std::vector<std::size_t>>& loads) {
    std::size_t rows = 0;
    Values of_load;
    for (const auto& load : loads) {
        for (const std::size_t i : load)
            if (values[i] != values[load[0]]) return false;
        rows += load.size();
        of_load.push_back(values[load[0]]);
    }
    std::sort(of_load.begin(), of_load.end());
    const auto distinct = std::unique(of_load.begin(), of_load.end()) - of_load.begin();
    return rows >= kEnoughRows && distinct > 2;
}

Values magnitudes(const Values& values) {
    Values result;
    for (const double x : values) result.push_back(std::abs(x));
    return result;
}

}  // namespace

void check_counts(LabelledTable& table) {
    for (std::size_t k = 0; k < table.columns.size(); ++k)
        if (table.columns[k].kind == ColumnKind::unknown && is_count(table.values[k])) {
            table.columns[k].kind = ColumnKind::count;
            table.columns[k].note = "rises by the same step in every row";
        }
}

void check_column_data(LabelledTable& table) {
    std::vector<std::pair<std::string, Values>> known;
    for (std::size_t k = 0; k < table.columns.size(); ++k) {
        const Column& column = table.columns[k];
        if (column.kind != ColumnKind::label || !column.is_used) continue;
        known.emplace_back(column.name, table.values[k]);
        known.emplace_back("the magnitude of " + column.name, magnitudes(table.values[k]));
    }
    Values t;
    for (const auto& t_ns : table.t_ns) t.push_back(t_ns && table.t_ns[0] ? double(*t_ns - *table.t_ns[0]) : std::nan(""));
    known.emplace_back("the time", t);
    const auto loads = rows_of_loads(table);
    std::size_t moving = 0;  // channels that are not the same under each load
    for (std::size_t k = 0; k < table.columns.size(); ++k)
        moving += table.columns[k].kind == ColumnKind::channel && !is_same_under_loads(table.values[k], loads) ? 1 : 0;
    for (std::size_t k = 0; k < table.columns.size(); ++k) {
        Column& column = table.columns[k];
        const Values& values = table.values[k];
        const bool is_open = column.kind == ColumnKind::unknown;
        if (!is_open && column.kind != ColumnKind::channel) continue;
        const auto becomes = [&](ColumnKind kind, const std::string& note) {
            column.kind = kind, column.note = note, column.is_used = false;
        };
        if (is_open && is_constant(values)) {
            becomes(ColumnKind::constant, "");
        } else if (!is_constant(values)) {
            for (const auto& [name, of] : known)
                if (is_copy(values, of)) {
                    becomes(ColumnKind::unknown, "a copy of " + name);
                    break;
                }
            if (column.kind == ColumnKind::channel && moving > 0 && is_same_under_loads(values, loads))
                becomes(ColumnKind::unknown, "the same in all rows of a load, as a command is");
        }
    }
}

}  // namespace tactiled
