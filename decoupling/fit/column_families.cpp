// The channels among unknown columns, by the shape of their names.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <optional>

#include "decoupling/column_name.hpp"
#include "decoupling/fit/columns.hpp"

namespace tactiled {
namespace {

// The text before the index of a channel: "R" of R1, "B" of Bx1 and of By, "ch" of ch_A. No
// value without an index. `needs_others`: an axis or a letter is an index only beside another one of the same stem.
struct Shape {
    std::string stem;
    bool needs_others;
};
std::optional<Shape> shape_of(const std::string& stem) {
    const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
    const auto digit = std::find_if(stem.begin(), stem.end(), is_digit);
    std::string before(stem.begin(), digit);
    while (!before.empty() && std::string_view(" _-.#([").find(before.back()) != std::string_view::npos) before.pop_back();
    const auto cut_axis = [&] {
        const char last = before.empty() ? char(0) : before.back();
        const bool is_axis = std::string_view("xyzXYZ").find(last) != std::string_view::npos && last != 0;
        if (is_axis) before.pop_back();
        return is_axis;
    };
    if (digit != stem.end()) {
        cut_axis();
        return Shape{before, false};
    }
    if (cut_axis()) {
        while (!before.empty() && std::string_view(" _-.").find(before.back()) != std::string_view::npos) before.pop_back();
        return Shape{before, true};
    }
    const bool is_letter =
        before.size() == 1 ||
        (before.size() > 1 && std::string_view(" _-.").find(before[before.size() - 2]) != std::string_view::npos);
    const bool is_upper = !before.empty() && before.back() >= 'A' && before.back() <= 'Z';
    const bool in_sequence = before.size() > 1 && !before.empty() && before.back() >= 'a' && before.back() <= 'h';
    if (!is_letter || !(is_upper || in_sequence)) return std::nullopt;
    before.pop_back();
    return Shape{before, true};
}

// "ch#" of ch12, "m@#" of mz3, "S#_@" of S1_x: numbers and axes are the same for all channels.
std::string pattern_of(const std::string& stem) {
    const auto is = [](char c, std::string_view set) { return set.find(c) != set.npos; };
    constexpr std::string_view kDigits = "0123456789", kAxes = "xyzXYZ", kMarks = " _-.[]()";
    std::string pattern;
    for (std::size_t i = 0; i < stem.size(); ++i) {
        const bool is_last = i + 1 == stem.size();
        const bool before_index = is_last || is(stem[i + 1], kDigits) || is(stem[i + 1], kMarks);
        if (is(stem[i], kDigits)) {
            if (!pattern.ends_with('#')) pattern += '#';
        } else {
            pattern += is(stem[i], kAxes) && before_index ? '@' : stem[i];
        }
    }
    return pattern;
}

// Leaves out a name that is written otherwise than several others of its stem: B5_cmd beside B1 B2 B3.
void mark_others(std::vector<Column>& columns, const std::vector<ColumnName>& names, std::vector<std::size_t>& members) {
    std::map<std::string, std::size_t> patterns;
    const bool are_letters = std::none_of(members.begin(), members.end(), [&](std::size_t k) {
        return pattern_of(names[k].stem).find_first_of("#@") != std::string::npos;
    });
    if (are_letters) return;
    for (const std::size_t k : members) ++patterns[pattern_of(names[k].stem)];
    const bool has_several = std::any_of(patterns.begin(), patterns.end(), [](const auto& each) { return each.second > 1; });
    std::erase_if(members, [&](std::size_t k) {
        const bool is_other = has_several && patterns[pattern_of(names[k].stem)] == 1;
        if (is_other) columns[k].note = "written otherwise than the channels";
        return is_other;
    });
}

}  // namespace

// Names of one stem are the channels of one sensor, and so is the only column that is left. The file does not say which of
// several stems is the sensor.
void find_channels(std::vector<Column>& columns, std::vector<std::string>& faults) {
    std::vector<std::string> texts;
    for (const Column& column : columns) texts.push_back(column.name);
    const std::vector<ColumnName> names = column_names(texts);
    std::map<std::string, std::vector<std::size_t>> families;
    std::map<std::string, bool> is_alone;
    for (std::size_t k = 0; k < columns.size(); ++k) {
        if (columns[k].kind != ColumnKind::unknown || !columns[k].note.empty() || !columns[k].has_name) continue;
        const auto shape = shape_of(names[k].stem);
        if (!shape) continue;
        families[shape->stem].push_back(k);
        const auto at = is_alone.try_emplace(shape->stem, true).first;
        at->second = at->second && shape->needs_others;
    }
    std::vector<std::string> stems;
    for (const auto& [stem, members] : families)
        if (members.size() > 1 || !is_alone[stem]) stems.push_back(stem);
    const bool has_known =
        std::any_of(columns.begin(), columns.end(), [](const Column& column) { return column.kind == ColumnKind::channel; });
    if (stems.size() == 1 && !has_known) {
        mark_others(columns, names, families[stems[0]]);
        for (const std::size_t k : families[stems[0]]) columns[k].kind = ColumnKind::channel, columns[k].is_used = true;
    } else if (!has_known && stems.size() > 1) {
        std::vector<std::string> lists;
        for (const std::string& stem : stems) {
            std::vector<std::string> members;
            for (const std::size_t k : families[stem]) {
                members.push_back(columns[k].name);
                columns[k].note = "one of several families";
            }
            lists.push_back(short_list(members));
        }
        faults.push_back(fmt::format("the channels may be {}: choose with --channels", fmt::join(lists, ", or ")));
    } else if (!has_known) {  // a sensor of one channel has no stem
        std::vector<Column*> open;
        for (Column& column : columns)
            if (column.kind == ColumnKind::unknown) open.push_back(&column);
        if (open.size() == 1 && open[0]->note.empty() && open[0]->has_name)
            open[0]->kind = ColumnKind::channel, open[0]->is_used = true;
    }
}

}  // namespace tactiled
