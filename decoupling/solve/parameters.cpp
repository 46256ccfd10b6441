#include "decoupling/solve/parameters.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tactiled {
namespace {

std::string fault_of_name(const char* kind, const std::string& name, const std::vector<std::string>& known,
                          const std::vector<std::string>& others) {
    if (std::find(known.begin(), known.end(), name) != known.end()) return "";
    if (std::find(others.begin(), others.end(), name) != others.end()) return "";
    const auto near = nearest_name(name, known);
    return fmt::format("{} {} is unknown; {}", kind, name,
                       near            ? "did you mean " + *near + "?"
                       : known.empty() ? "the method has none"
                                       : fmt::format("known are {}", fmt::join(known, " ")));
}

std::string fault_of_range(const Parameter& known, double value) {
    if (value >= known.min && value <= known.max) return "";
    if (known.max == kLargest && known.min == kAboveZero)
        return fmt::format("parameter {} = {} is not above 0: {}", known.name, value, known.what);
    if (known.max == kLargest)
        return fmt::format("parameter {} = {} is below {}: {}", known.name, value, known.min, known.what);
    return fmt::format("parameter {} = {} is outside {} .. {}: {}", known.name, value, known.min, known.max, known.what);
}

std::string fault_of_size(std::string_view name, const NumberRows& table, std::size_t rows, std::size_t columns) {
    if (table.empty()) return fmt::format("table {} is missing", name);
    if ((rows != kAnyNumber && table.size() != rows) || (columns != kAnyNumber && table.front().size() != columns)) {
        const auto text = [](std::size_t n) { return n == kAnyNumber ? "any number" : fmt::format("{}", n); };
        return fmt::format("table {} has {} rows of {}; needed are {} of {}", name, table.size(), table.front().size(),
                           text(rows), text(columns));
    }
    for (const auto& row : table)
        if (row.size() != table.front().size()) return fmt::format("table {}: its rows are not equally long", name);
    return "";
}

}  // namespace

std::string CalibrationData::fault(const OtherNames& others) const {
    std::vector<std::string> names;
    for (const Parameter& known : parameters_) names.emplace_back(known.name);
    for (const auto& [name, value] : calibration_.parameters)
        if (std::string fault = fault_of_name("parameter", name, names, others.parameters); !fault.empty()) return fault;
    for (const Parameter& known : parameters_)
        if (!has(known.name) && std::isnan(known.fallback))
            return fmt::format("parameter {} is missing: {}", known.name, known.what);
    if (std::string fault = fault_of_ranges(); !fault.empty()) return fault;
    names.clear();
    for (const KnownTable& known : tables_) names.emplace_back(known.name);
    for (const auto& [name, rows] : calibration_.tables)
        if (std::string fault = fault_of_name("table", name, names, others.tables); !fault.empty()) return fault;
    for (const KnownTable& known : tables_) {
        const NumberRows* rows = table(known.name);
        if (rows == nullptr && !known.needed) continue;
        std::string fault =
            fault_of_size(known.name, rows == nullptr ? NumberRows{} : *rows, size_of(known.rows), size_of(known.columns));
        if (!fault.empty()) return fault;
    }
    return "";
}

std::string CalibrationData::fault_of_ranges() const {
    for (const Parameter& known : parameters_)
        if (const auto found = calibration_.parameters.find(known.name); found != calibration_.parameters.end())
            if (std::string fault = fault_of_range(known, found->second); !fault.empty()) return fault;
    return "";
}

double CalibrationData::operator[](std::string_view name) const {
    const auto known = std::ranges::find(parameters_, name, &Parameter::name);
    assert(known != parameters_.end());
    const auto found = calibration_.parameters.find(known->name);
    return found == calibration_.parameters.end() ? known->fallback : found->second;
}

bool CalibrationData::has(std::string_view name) const { return calibration_.parameters.count(std::string(name)) != 0; }

const NumberRows* CalibrationData::table(std::string_view name) const {
    const auto found = calibration_.tables.find(std::string(name));
    return found == calibration_.tables.end() ? nullptr : &found->second;
}

const NumberRows* CalibrationData::table(std::string_view name, std::size_t rows, std::size_t columns,
                                         std::string& fault) const {
    const NumberRows* found = table(name);
    fault = fault_of_size(name, found == nullptr ? NumberRows{} : *found, rows, columns);
    return fault.empty() ? found : nullptr;
}

std::size_t CalibrationData::size_of(std::size_t stated) const noexcept {
    if (stated == kPerChannel) return calibration_.channels.size();
    if (stated == kPerComponent) return calibration_.components.size();
    return stated;
}

}  // namespace tactiled
