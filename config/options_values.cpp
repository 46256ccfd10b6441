// The values of a table's keys: their types, ranges and sizes, with an error for each that is wrong.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>

#include "config/options_node.hpp"
#include "config/text_file.hpp"

namespace tactiled {
namespace {

constexpr double kExactIntegers = 9007199254740992;  // 2^53: a float up to this value represents one integer only

std::string kind_of(const toml::node& node) {
    switch (node.type()) {
        case toml::node_type::string: return "a string";
        case toml::node_type::integer: return "an integer";
        case toml::node_type::floating_point: return "a number";
        case toml::node_type::boolean: return "a boolean";
        case toml::node_type::date: return "a date";
        case toml::node_type::time: return "a time";
        case toml::node_type::date_time: return "a date with time";
        case toml::node_type::array: return "an array";
        case toml::node_type::table: return "a table";
        case toml::node_type::none: break;
    }
    return "nothing";
}

// Returns " = 5" if the value is short enough to be printed, else "".
std::string value_of(const toml::node& node) {
    if (const auto* text = node.as_string()) return " = " + in_quotes(text->get());
    if (const auto* integer = node.as_integer()) return fmt::format(" = {}", integer->get());
    if (const auto* number = node.as_floating_point()) return fmt::format(" = {}", number->get());
    if (const auto* flag = node.as_boolean()) return flag->get() ? " = true" : " = false";
    return "";
}
}  // namespace

void Options::Node::missing(std::string_view key) const { problem(key, fmt::format("key \"{}\" is missing", key)); }

void Options::Node::wrong_kind(std::string_view name, const toml::node& found, std::string_view wanted) const {
    problem(line_of(found), fmt::format("{}{} is {}, should be {}", name, value_of(found), kind_of(found), wanted));
}

const toml::array* Options::Node::ask_array(std::string_view key, std::string_view wanted, Count count) {
    const toml::node* found = ask(key);
    if (!found) return nullptr;
    const auto* array = found->as_array();
    if (!array)
        wrong_kind(key, *found, wanted);
    else if (array->size() >= count.min && array->size() <= count.max)
        return array;
    else if (count.min == count.max)
        problem(key, fmt::format("{} has {} entries, should have {}", key, array->size(), count.min));
    else
        problem(key, fmt::format("{} has {} entries, should have {} .. {}", key, array->size(), count.min, count.max));
    return nullptr;
}

std::optional<double> Options::Node::number(std::string_view name, const toml::node& found, Range range) const {
    const auto value = found.is_number() ? found.value<double>() : std::nullopt;
    if (!value)
        wrong_kind(name, found, "a number");
    else if (!std::isfinite(*value))
        problem(line_of(found), fmt::format("{} = {} is not a finite number", name, *value));
    else if (!(*value >= range.min && *value <= range.max))
        problem(line_of(found), fmt::format("{} = {} is outside {} .. {}", name, *value, range.min, range.max));
    else
        return value;
    return std::nullopt;
}

std::vector<double> Options::Node::numbers(std::string_view name, const toml::array& array, Range range) const {
    std::vector<double> all;
    for (std::size_t i = 0; i < array.size(); ++i) {
        const auto value = number(fmt::format("{}[{}]", name, i), array[i], range);
        if (!value) return {};
        all.push_back(*value);
    }
    return all;
}

std::string Options::text(std::string_view key) {
    const toml::node* found = node_->ask(key);
    if (!found)
        node_->missing(key);
    else if (const auto* value = found->as_string(); !value)
        node_->wrong_kind(key, *found, "a string");
    else if (value->get().empty())
        node_->problem(key, fmt::format("{} is empty", key));
    else
        return value->get();
    return "";
}

std::string Options::text(std::string_view key, std::string_view fallback) {
    const toml::node* found = node_->ask(key);
    if (!found) return std::string(fallback);
    if (const auto* value = found->as_string()) return value->get();
    node_->wrong_kind(key, *found, "a string");
    return std::string(fallback);
}

double Options::number(std::string_view key, Range range) {
    const toml::node* found = node_->ask(key);
    if (!found) node_->missing(key);
    return found ? node_->number(key, *found, range).value_or(range.min) : range.min;
}

double Options::number(std::string_view key, Range range, double fallback) {
    const toml::node* found = node_->ask(key);
    return found ? node_->number(key, *found, range).value_or(fallback) : fallback;
}

std::int64_t Options::integer(std::string_view key, Range range) {
    if (!node_->ask(key)) node_->missing(key);
    return integer(key, range, static_cast<std::int64_t>(range.min));
}

std::int64_t Options::integer(std::string_view key, Range range, std::int64_t fallback) {
    const toml::node* found = node_->ask(key);
    if (!found) return fallback;
    const auto* integer = found->as_integer();
    const auto* number = found->as_floating_point();
    if (!integer && !(number && std::trunc(number->get()) == number->get() && std::abs(number->get()) <= kExactIntegers)) {
        node_->wrong_kind(key, *found, "an integer");
        return fallback;
    }
    const std::int64_t value = integer ? integer->get() : static_cast<std::int64_t>(number->get());
    const auto rounded = static_cast<double>(value);
    if (rounded >= range.min && rounded <= range.max) return value;
    node_->problem(key, fmt::format("{} = {} is outside {} .. {}", key, value, range.min, range.max));
    return fallback;
}

bool Options::flag(std::string_view key, bool fallback) { return optional_flag(key).value_or(fallback); }

std::optional<bool> Options::optional_flag(std::string_view key) {
    const toml::node* found = node_->ask(key);
    if (!found) return std::nullopt;
    if (const auto* value = found->as_boolean()) return value->get();
    node_->wrong_kind(key, *found, "true or false");
    return std::nullopt;
}

std::string Options::one_of(std::string_view key, const std::vector<std::string>& allowed) {
    if (!node_->ask(key)) node_->missing(key);
    return one_of(key, allowed, "");
}

std::string Options::one_of(std::string_view key, const std::vector<std::string>& allowed, std::string_view fallback) {
    const toml::node* found = node_->ask(key);
    if (!found) return std::string(fallback);
    const auto* value = found->as_string();
    if (!value) {
        node_->wrong_kind(key, *found, fmt::format("one of \"{}\"", fmt::join(allowed, "\", \"")));
        return std::string(fallback);
    }
    if (std::find(allowed.begin(), allowed.end(), value->get()) != allowed.end()) return value->get();
    node_->problem(key, fmt::format("{} = {} {}", key, in_quotes(value->get()), is_unknown(value->get(), allowed)));
    return std::string(fallback);
}

std::vector<std::string> Options::texts(std::string_view key, Count count) {
    std::vector<std::string> all;
    const toml::array* array = node_->ask_array(key, "an array of strings", count);
    for (std::size_t i = 0; array && i < array->size(); ++i) {
        const auto* value = (*array)[i].as_string();
        if (!value) {
            node_->wrong_kind(fmt::format("{}[{}]", key, i), (*array)[i], "a string");
            return {};
        }
        all.push_back(value->get());
    }
    return all;
}

std::vector<double> Options::numbers(std::string_view key, Range range, Count count) {
    const toml::array* array = node_->ask_array(key, "an array of numbers", count);
    return array ? node_->numbers(key, *array, range) : std::vector<double>{};
}

std::vector<std::vector<double>> Options::rows(std::string_view key) {
    constexpr Range kFinite{-1e300, 1e300};
    std::vector<std::vector<double>> all;
    const toml::array* array = node_->ask_array(key, "an array of arrays of numbers", {});
    for (std::size_t i = 0; array && i < array->size(); ++i) {
        const auto* row = (*array)[i].as_array();
        if (!row) {
            node_->wrong_kind(fmt::format("{}[{}]", key, i), (*array)[i], "an array of numbers");
            return {};
        }
        all.push_back(node_->numbers(fmt::format("{}[{}]", key, i), *row, kFinite));
        if (all.back().empty() && !row->empty()) return {};
    }
    return all;
}

std::optional<Options::TextFile> Options::text_file(std::string_view key, std::size_t max_bytes) {
    const std::string name = text(key);
    if (name.empty()) return std::nullopt;
    const std::string path = (std::filesystem::path(file()).parent_path() / name).string();  // an absolute path is unchanged
    Problems found;
    auto bytes = read_text_file(path, max_bytes, found);
    for (const auto& line : found.lines()) problem(key, line);
    if (!bytes) return std::nullopt;
    return TextFile{path, std::move(*bytes)};
}

}  // namespace tactiled
