// A column's name in parts: words and unit. "Fz [mN]", "force_z_mN" and "forceZ (mN)" are the same quantity.
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

enum class Quantity { none, force, moment, time, temperature, length, angle, motion, reading };

struct ColumnUnit {
    std::string_view text;
    Quantity quantity = Quantity::none;
    double factor = 1, offset = 0;  // SI = factor * value + offset; degC for temperatures
};

struct ColumnName {
    std::vector<std::string> words;    // lower case: "force", "z"; digits are words of their own
    const ColumnUnit* unit = nullptr;  // nullptr: the name has none that is known
    std::string stem;                  // the name without its unit
    std::string text;                  // the whole name
};

// setup
ColumnName column_name(std::string_view name);

// The names of one table: the C of ch_A ch_B ch_C is a letter, no unit. A letter of a force stays a unit, because a label
// must not become a channel. setup
std::vector<ColumnName> column_names(const std::vector<std::string>& names);

// Returns the unit of this text, nullptr if it is none. The case of the first letter counts (mN, MN). setup
const ColumnUnit* find_unit(std::string_view text);

}  // namespace tactiled
