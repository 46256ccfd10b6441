// A table of the configuration as a list of fields. The parser, the rules of a reload, the reference page (KEYS.md)
// and the test of tactiled.toml read the same list, so that all facts about a key are in one entry.
#pragma once
#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "config/config.hpp"

namespace tactiled {

// The facts about a key, as text.
struct ConfigKey {
    std::string name, type, unit, range;
    std::string otherwise;  // the default, as TOML or in words; "" = the key is required
    Reload reload;
    std::string help;
};

// The value of a missing key. The words replace the value in the pages if it has a special meaning, such as 0 for
// "all".
template <typename T>
struct Default {
    T value;
    std::string words;
    Default(T v) : value(v) {}
    Default(T v, const char* w) : value(v), words(w) {}
};

struct NoDefault {};  // the key is required
inline constexpr NoDefault kRequired;

using Choices = std::vector<std::string>;
// a function, because nested braces would be hard to read
constexpr Range range(double min, double max) { return {min, max}; }

enum class Text {
    any,
    name,       // config/names.hpp
    full_path,  // starts with /
};

// Functions behind the constructors of Field. setup: never throws for bad input
namespace field {
std::string range_text(Range range);
std::string number_text(double value);
std::string list_text(const double* values, std::size_t n);
std::string text_kind(Text text);
std::string choices_text(const std::vector<std::string>& choices);
std::string quoted(const std::string& value);
// `fallback` nullptr: the key is required.
std::string read_text(Options& table, const std::string& key, const std::string* fallback, Text text);
// Returns `fallback` with the name of the node in the place of NAME.
std::string with_node_name(const std::string& fallback, const std::string& node_name);
}  // namespace field

// A structure of settings, or a part of it.
template <typename Owner, typename Settings>
concept PartOf = std::is_base_of_v<Owner, Settings>;

// One key of a table and the member of the settings that receives its value. The type of the member selects the constructor,
// and the structure of the member decides the effect of a change on a reload. Write the first two arguments with
// TACTILED_KEY: the key is then the name of the member, and two members cannot be swapped.
template <typename Settings>
struct Field : ConfigKey {
    template <typename T>
    using Same = std::type_identity_t<T>;  // not deduced: the type of the member decides

    std::function<void(Options&, Settings&, const std::string& node_name)> read;

    template <PartOf<Settings> Owner>
    Field(const char* key, int Owner::*member, Default<int> d, Range r, const char* u, const char* h)
        : ConfigKey{key, "integer", u, field::range_text(r), or_words(d, std::to_string(d.value)), Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = static_cast<int>(table.integer(key, r, d.value));
          }) {}

    template <PartOf<Settings> Owner>
    Field(const char* key, double Owner::*member, Default<double> d, Range r, const char* u, const char* h)
        : ConfigKey{key, "number", u, field::range_text(r), or_words(d, field::number_text(d.value)), Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.number(key, r, d.value);
          }) {}

    // All `N` numbers of the default if the key is missing or wrong.
    template <PartOf<Settings> Owner, std::size_t N>
    Field(const char* key, std::array<double, N> Owner::*member, Same<Default<std::array<double, N>>> d, Range r,
          const char* u, const char* h)
        : ConfigKey{key,
                    std::to_string(N) + " numbers",
                    u,
                    field::range_text(r),
                    or_words(d, field::list_text(d.value.data(), N)),
                    Owner::kReload,
                    h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = d.value;
              const auto values = table.numbers(key, r, {N, N});
              if (values.size() == N) std::copy(values.begin(), values.end(), (settings.*member).begin());
          }) {}

    // All NaN, which cannot be in a file, if the key is wrong or missing; the caller reports a missing one.
    template <PartOf<Settings> Owner, std::size_t N>
    Field(const char* key, std::array<double, N> Owner::*member, NoDefault, Range r, const char* u, const char* h)
        : Field(key, member, Default(not_numbers<N>()), r, u, h) {
        otherwise = "";
    }

    template <PartOf<Settings> Owner>
    Field(const char* key, bool Owner::*member, Default<bool> d, const char* h)
        : ConfigKey{key, "boolean", "", "", or_words(d, d.value ? "true" : "false"), Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.flag(key, d.value);
          }) {}

    // Without a value if the key is missing or wrong.
    template <PartOf<Settings> Owner>
    Field(const char* key, std::optional<bool> Owner::*member, const char* words, const char* h)
        : ConfigKey{key, "boolean", "", "", words, Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.optional_flag(key);
          }) {}

    template <PartOf<Settings> Owner>
    Field(const char* key, std::string Owner::*member, NoDefault, Text t, const char* h)
        : ConfigKey{key, "string", "", field::text_kind(t), "", Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = field::read_text(table, key, nullptr, t);
          }) {}

    template <PartOf<Settings> Owner>
    Field(const char* key, std::string Owner::*member, Default<const char*> d, Text t, const char* h)
        : ConfigKey{key, "string", "", field::text_kind(t), or_words(d, field::quoted(d.value)), Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string& node_name) {
              const std::string fallback = field::with_node_name(d.value, node_name);
              settings.*member = field::read_text(table, key, &fallback, t);
          }) {}

    template <PartOf<Settings> Owner>
    Field(const char* key, std::string Owner::*member, const char* fallback, const Choices& choices, const char* h)
        : ConfigKey{key, "string", "", field::choices_text(choices), field::quoted(fallback), Owner::kReload, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.one_of(key, choices, fallback);
          }) {}

    // A missing or wrong list is empty.
    template <PartOf<Settings> Owner>
    Field(const char* key, std::vector<std::string> Owner::*member, const char* words, Count c, const char* h)
        : ConfigKey{key,   "strings",
                    "",    c.max == SIZE_MAX ? "" : field::range_text({double(c.min), double(c.max)}) + " of them",
                    words, Owner::kReload,
                    h},
          read([=](Options& table, Settings& settings, const std::string&) { settings.*member = table.texts(key, c); }) {}

private:
    template <std::size_t N>
    static std::array<double, N> not_numbers() {
        std::array<double, N> all;
        all.fill(std::numeric_limits<double>::quiet_NaN());
        return all;
    }
    template <typename T>
    static std::string or_words(const Default<T>& d, const std::string& text) {
        return d.words.empty() ? text : d.words;
    }
};

#define TACTILED_KEY(Settings, member) #member, &Settings::member

template <typename Settings>
using Fields = std::vector<Field<Settings>>;

// Reads all fields in their order. `node_name` may be a member of `settings` that an earlier field fills.
// setup: never throws for bad input
template <typename Settings>
void read_fields(const Fields<Settings>& fields, Options& table, Settings& settings, const std::string& node_name = "") {
    for (const auto& one : fields) one.read(table, settings, node_name);
}

}  // namespace tactiled
