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

#include "config/options.hpp"

namespace tactiled {

// The effect of a changed value when the daemon reads its configuration again (SIGHUP).
enum class Reload {
    restart,  // the reload is refused: the daemon must be restarted
    tune,     // takes effect without a lost sample; neither the measured value nor its zero changes
    epoch,    // takes effect without a lost sample; the sensor begins a new epoch without its tare
};

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

// One key of a table and the member of the settings that receives its value. The type of the member selects the
// constructor. Write the first two arguments with TACTILED_KEY: the key is then the name of the member, and two
// members cannot be swapped.
template <typename Settings>
struct Field : ConfigKey {
    template <typename T>
    using Same = std::type_identity_t<T>;  // not deduced: the type of the member decides

    std::function<void(Options&, Settings&, const std::string& node_name)> read;

    Field(const char* key, int Settings::*member, Default<int> d, Range r, const char* u, Reload l, const char* h)
        : ConfigKey{key, "integer", u, field::range_text(r), or_words(d, std::to_string(d.value)), l, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = static_cast<int>(table.integer(key, r, d.value));
          }) {}

    Field(const char* key, double Settings::*member, Default<double> d, Range r, const char* u, Reload l, const char* h)
        : ConfigKey{key, "number", u, field::range_text(r), or_words(d, field::number_text(d.value)), l, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.number(key, r, d.value);
          }) {}

    // All `N` numbers of the default if the key is missing or wrong.
    template <std::size_t N>
    Field(const char* key, std::array<double, N> Settings::*member, Same<Default<std::array<double, N>>> d, Range r,
          const char* u, Reload l, const char* h)
        : ConfigKey{key,
                    std::to_string(N) + " numbers",
                    u,
                    field::range_text(r),
                    or_words(d, field::list_text(d.value.data(), N)),
                    l,
                    h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = d.value;
              const auto values = table.numbers(key, r, {N, N});
              if (values.size() == N) std::copy(values.begin(), values.end(), (settings.*member).begin());
          }) {}

    // All NaN, which cannot be in a file, if the key is wrong or missing; the caller reports a missing one.
    template <std::size_t N>
    Field(const char* key, std::array<double, N> Settings::*member, NoDefault, Range r, const char* u, Reload l,
          const char* h)
        : Field(key, member, Default(not_numbers<N>()), r, u, l, h) {
        otherwise = "";
    }

    Field(const char* key, bool Settings::*member, Default<bool> d, Reload l, const char* h)
        : ConfigKey{key, "boolean", "", "", or_words(d, d.value ? "true" : "false"), l, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.flag(key, d.value);
          }) {}

    // Without a value if the key is missing or wrong.
    Field(const char* key, std::optional<bool> Settings::*member, const char* words, Reload l, const char* h)
        : ConfigKey{key, "boolean", "", "", words, l, h}, read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.optional_flag(key);
          }) {}

    Field(const char* key, std::string Settings::*member, NoDefault, Text t, Reload l, const char* h)
        : ConfigKey{key, "string", "", field::text_kind(t), "", l, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = field::read_text(table, key, nullptr, t);
          }) {}

    Field(const char* key, std::string Settings::*member, Default<const char*> d, Text t, Reload l, const char* h)
        : ConfigKey{key, "string", "", field::text_kind(t), or_words(d, field::quoted(d.value)), l, h},
          read([=](Options& table, Settings& settings, const std::string& node_name) {
              const std::string fallback = field::with_node_name(d.value, node_name);
              settings.*member = field::read_text(table, key, &fallback, t);
          }) {}

    Field(const char* key, std::string Settings::*member, const char* fallback, const Choices& choices, Reload l,
          const char* h)
        : ConfigKey{key, "string", "", field::choices_text(choices), field::quoted(fallback), l, h},
          read([=](Options& table, Settings& settings, const std::string&) {
              settings.*member = table.one_of(key, choices, fallback);
          }) {}

    // A missing or wrong list is empty.
    Field(const char* key, std::vector<std::string> Settings::*member, const char* words, Count c, Reload l, const char* h)
        : ConfigKey{key,   "strings",
                    "",    c.max == SIZE_MAX ? "" : field::range_text({double(c.min), double(c.max)}) + " of them",
                    words, l,
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
