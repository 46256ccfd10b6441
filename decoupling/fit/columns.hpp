// The class of each column of a labelled file: a channel only if its name has the shape of one; never by default. A time, a
// place or a command that became a channel would fit its recording only.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

enum class ColumnKind { time, label, session, temperature, channel, place, count, constant, text, unknown };

struct Column {
    std::string name;
    ColumnKind kind = ColumnKind::unknown;
    bool is_used = false, has_name = true;
    std::size_t component = 6;      // the label
    double factor = 1, offset = 0;  // value in SI, or degC = factor * cell + offset
    std::string note;               // for the list: "in mN, times 0.001"; of an unknown one: the reason
};

// Names that a model knows as those of its channels; nullptr: none.
using KnownNames = bool (*)(std::string_view name);

// Classes columns by their names. `chosen`: the channels that the user names; else channels are found by find_channels().
// Adds a sentence to `faults` for each kind of fault. setup
std::vector<Column> class_columns(const std::vector<std::string>& names, const std::vector<std::string>& chosen,
                                  KnownNames known, std::vector<std::string>& faults);

// Makes unknown columns with the shape of a channel to channels: names with a common stem and a number, an axis or a letter.
// Adds a fault if there are several stems, because the names do not say which of them is the sensor. setup
void find_channels(std::vector<Column>& columns, std::vector<std::string>& faults);

// Returns the list of the classes, a line for each. setup
std::string list_of_columns(const std::string& title, const std::vector<Column>& columns);

// "B1 B2 B3 .. B15 (15)"
std::string short_list(const std::vector<std::string>& names);

}  // namespace tactiled
