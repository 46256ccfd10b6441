#include "config/fields.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "config/names.hpp"

namespace tactiled::field {

std::string number_text(double value) { return fmt::format("{}", value); }

std::string range_text(Range range) {
    constexpr double kAny = 1e300;  // bounds as wide as this only keep a value finite
    if (range.max < kAny) return fmt::format("{} .. {}", range.min, range.max);
    return range.min <= -kAny ? "" : range.min > 0 && range.min <= 1 / kAny ? "> 0" : fmt::format("{} ..", range.min);
}

std::string list_text(const double* values, std::size_t n) {
    return fmt::format("[{}]", fmt::join(values, values + n, ", "));
}

std::string text_kind(Text text) {
    switch (text) {
        case Text::any: break;
        case Text::name: return "1 .. 31 characters A-Z a-z 0-9 _ . -";
        case Text::full_path: return "full path";
    }
    return "";
}

std::string choices_text(const std::vector<std::string>& choices) {
    return fmt::format("\"{}\"", fmt::join(choices, "\" \""));
}

std::string quoted(const std::string& value) { return fmt::format("\"{}\"", value); }

std::string read_text(Options& table, const std::string& key, const std::string* fallback, Text text) {
    std::string value = fallback != nullptr ? table.text(key, *fallback) : table.text(key);
    const bool absent = value.empty() && (fallback == nullptr || fallback->empty());  // reported already, or permitted
    if (text == Text::name && !absent && !valid_name(value))
        table.problem(key, fmt::format("{} = {}; {}", key, in_quotes(value), kValidName));
    if (text == Text::full_path && !absent && (value.empty() || value.front() != '/'))
        table.problem(key, fmt::format("{} = {} should be a full path, starting with /", key, in_quotes(value)));
    return value;
}

std::string with_node_name(const std::string& fallback, const std::string& node_name) {
    const std::size_t at = fallback.find("NAME");
    return at == fallback.npos ? fallback : std::string(fallback).replace(at, 4, node_name);
}

}  // namespace tactiled::field
