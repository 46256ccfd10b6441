#include "decoupling/fit/columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>

#include "config/calibration.hpp"
#include "config/names.hpp"
#include "decoupling/column_name.hpp"
#include "decoupling/csv_time.hpp"

namespace tactiled {
namespace {

// The classes, in the order of the list.
struct ColumnClass {
    ColumnKind kind;
    const char* name;
};
constexpr ColumnClass kClasses[] = {
    {ColumnKind::time, "time"},        {ColumnKind::label, "label"},
    {ColumnKind::session, "session"},  {ColumnKind::temperature, "temperature"},
    {ColumnKind::channel, "channel"},  {ColumnKind::place, "place"},
    {ColumnKind::count, "row number"}, {ColumnKind::constant, "constant"},
    {ColumnKind::text, "text"},        {ColumnKind::unknown, "unknown"},
};

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
    return std::find(words.begin(), words.end(), word) != words.end();
}

template <class Predicate>
bool any_word(const ColumnName& name, Predicate predicate) {
    return std::any_of(name.words.begin(), name.words.end(), predicate);
}

// Returns the component that the words name, 6 if none: fx, force x, torque_x, wrench.force.x, ref_fz.
std::size_t component_of(const ColumnName& name) {
    std::string quantity, axis;
    for (const std::string& word : name.words) {
        if (is_one_of(word, {"ref", "reference", "label", "ati", "ft", "gt", "truth", "true", "ground", "measured", "wrench",
                             "kraft", "forza", "fuerza"}))
            continue;
        const bool is_axis = is_one_of(word, {"x", "y", "z"});
        if (is_axis && axis.empty())
            axis = word;
        else if (!is_axis && quantity.empty())
            quantity = word;
        else
            return 6;
    }
    if (axis.empty() && quantity.size() > 1) {  // fx
        axis = quantity.substr(quantity.size() - 1);
        quantity.pop_back();
    }
    const bool is_force = is_one_of(quantity, {"f", "force"});
    const bool is_moment = is_one_of(quantity, {"m", "t", "tau", "moment", "torque"});
    if (!is_one_of(axis, {"x", "y", "z"}) || (!is_force && !is_moment)) return 6;
    return std::size_t(axis[0] - 'x') + (is_moment ? 3 : 0);
}

// A name with the word of a force that is not that of a component: grip_force, fz_cmd, weight_g.
bool resembles_label(const ColumnName& name) {
    if (name.unit != nullptr && (name.unit->quantity == Quantity::force || name.unit->quantity == Quantity::moment))
        return true;
    return any_word(name, [](const std::string& word) {
        return is_one_of(word, {"fx", "fy", "fz", "force", "forces", "torque", "moment", "weight", "load", "label", "target",
                                "reference", "truth", "wrench"});
    });
}

bool is_place(const ColumnName& name) {
    const Quantity quantity = name.unit == nullptr ? Quantity::none : name.unit->quantity;
    if (quantity == Quantity::length || quantity == Quantity::angle || quantity == Quantity::motion) return true;
    if (name.words.size() == 1 && is_one_of(name.words[0], {"x", "y", "z"})) return true;
    return any_word(name, [](const std::string& word) {
        return is_one_of(
            word, {"robot",  "pose",       "position",    "pos",          "tcp",    "ee",       "joint", "joints", "arm",
                   "quat",   "quaternion", "orientation", "rotation",     "rot",    "roll",     "pitch", "yaw",    "depth",
                   "height", "indent",     "indentation", "displacement", "travel", "velocity", "vel",   "speed",  "angle",
                   "qx",     "qy",         "qz",          "qw",           "rx",     "ry",       "rz"});
    });
}

bool is_count(const ColumnName& name) {
    return any_word(name, [](const std::string& word) {
        return is_one_of(word, {"index", "idx", "row", "line", "sample", "seq", "sequence", "frame", "counter", "unnamed"});
    });
}

bool is_temperature(const ColumnName& name) {
    const bool is_unit = name.unit != nullptr && name.unit->quantity == Quantity::temperature;
    const bool is_one_letter = is_unit && name.unit->text.size() == 1;  // C, K and F are other things, too
    return any_word(name,
                    [](const std::string& word) {
                        return is_one_of(word, {"temp", "temps", "temperature", "ntc"});
                    }) ||
           (is_unit && (!is_one_letter || (!name.words.empty() && name.words[0] == "t")));
}

// English, German, French, Spanish, Italian, Portuguese, Chinese and Japanese; others are asked for.
bool is_session(std::string_view word) {
    return is_one_of(word, {"session", "mounting", "sitzung", "s\u00e9ance", "seance", "sesi\u00f3n", "sesion", "sessione",
                            "sess\u00e3o", "sessao", "\u6279\u6b21", "\u4f1a\u8bdd", "\u30bb\u30c3\u30b7\u30e7\u30f3"});
}

// Sets a label or its fault.
void class_label(Column& column, const ColumnName& name, std::vector<std::string>& unitless) {
    column.kind = ColumnKind::label;
    if (name.unit == nullptr) {
        unitless.push_back(column.name);
        return;
    }
    column.is_used = true;
    column.factor = name.unit->factor;
    if (column.factor != 1)
        column.note =
            fmt::format("{} in {}: times {:.6g}", kComponentNames[column.component], name.unit->text, column.factor);
}

// The class that the words and the unit state; channels are found afterwards.
Column class_by_words(const ColumnName& name, KnownNames known, std::vector<std::string>& unitless) {
    Column column{.name = name.text, .note = {}};
    column.component = component_of(name);
    const Quantity expected = column.component < 3 ? Quantity::force : Quantity::moment;
    if (known != nullptr && known(name.text)) {
        column.kind = ColumnKind::channel;
    } else if (column.component < 6 && (name.unit == nullptr || name.unit->quantity == expected)) {
        class_label(column, name, unitless);
    } else if (names_time(name)) {
        column.kind = ColumnKind::time;
    } else if (!name.words.empty() && is_session(name.words[0]) && name.words.size() <= 2) {
        column.kind = ColumnKind::session;
    } else if (is_temperature(name)) {
        column.kind = ColumnKind::temperature;
        if (name.unit != nullptr && name.unit->quantity == Quantity::temperature)
            column.factor = name.unit->factor, column.offset = name.unit->offset;
        else
            column.note = "no unit of temperature: name it temperature_C";
    } else if (is_count(name)) {
        column.kind = ColumnKind::count;
    } else if (is_place(name)) {
        column.kind = ColumnKind::place;
    } else if (resembles_label(name)) {
        column.note = "resembles a label";
    }
    return column;
}

void check_chosen(std::vector<Column>& columns, const std::vector<std::string>& chosen, std::vector<std::string>& faults) {
    std::vector<std::string> unknown, twice;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
        const std::string& name = chosen[i];
        const auto at =
            std::find_if(columns.begin(), columns.end(), [&](const Column& column) { return column.name == name; });
        if (std::find(chosen.begin(), chosen.begin() + std::ptrdiff_t(i), name) != chosen.begin() + std::ptrdiff_t(i)) {
            faults.push_back(fmt::format("channel \"{}\" was chosen twice", name));
        } else if (at == columns.end()) {
            unknown.push_back(name);
        } else if (((at->kind == ColumnKind::label || at->kind == ColumnKind::time) && at->is_used) ||
                   at->kind == ColumnKind::session) {
            faults.push_back(fmt::format("column \"{}\" is no channel: it is a time, a session or a label", name));
        } else {
            at->kind = ColumnKind::channel;
            at->note.clear();
        }
    }
    std::vector<std::string> names;
    for (const Column& column : columns) names.push_back(column.name);
    for (const std::string& name : unknown)
        faults.push_back(fmt::format("has no channel \"{}\"; its columns are {}", name, fmt::join(names, " ")));
}

}  // namespace

std::vector<Column> class_columns(const std::vector<std::string>& names, const std::vector<std::string>& chosen,
                                  KnownNames known, std::vector<std::string>& faults) {
    std::vector<Column> columns;
    std::vector<std::string> unitless;
    for (const ColumnName& name : column_names(names)) columns.push_back(class_by_words(name, known, unitless));
    for (const std::size_t k : TimeColumn(names).columns()) columns[k].is_used = columns[k].kind == ColumnKind::time;
    check_chosen(columns, chosen, faults);
    std::erase_if(unitless, [&](const auto& name) { return std::find(chosen.begin(), chosen.end(), name) != chosen.end(); });
    if (!unitless.empty())
        faults.push_back(fmt::format("no unit: {}; a label's name ends with its unit, as in fz_N, fz_mN, \"Fz [g]\", mx_Nmm",
                                     fmt::join(unitless, " ")));
    for (std::size_t c = 0; c < 6; ++c) {
        std::vector<std::string> same;
        for (const Column& column : columns)
            if (column.kind == ColumnKind::label && column.is_used && column.component == c) same.push_back(column.name);
        if (same.size() > 1)
            faults.push_back(fmt::format("{} are the same label; delete all but one", fmt::join(same, " and ")));
    }
    Column* session = nullptr;
    Column* temperature = nullptr;
    std::size_t thermometers = 0;
    for (Column& column : columns) {
        if (column.kind == ColumnKind::session && (session == nullptr || column.name == "session")) session = &column;
        if (column.kind != ColumnKind::temperature || !column.note.empty()) continue;
        ++thermometers;
        if (temperature == nullptr || column.name == "temperature_C") temperature = &column;
    }
    if (session != nullptr) session->is_used = true;
    if (temperature != nullptr && (thermometers == 1 || temperature->name == "temperature_C")) temperature->is_used = true;
    for (Column& column : columns) {
        if (column.kind == ColumnKind::channel) column.is_used = true;
        if (column.kind == ColumnKind::temperature && !column.is_used && column.note.empty())
            column.note = thermometers > 1 ? "one of several: name the sensor's own temperature_C" : "";
    }
    return columns;
}

std::string short_list(const std::vector<std::string>& names) {
    if (names.size() <= 6) return fmt::format("{}", fmt::join(names, " "));
    return fmt::format("{} {} {} .. {} ({})", names[0], names[1], names[2], names.back(), names.size());
}

std::string list_of_columns(const std::string& title, const std::vector<Column>& columns) {
    std::string text = title + "\n";
    for (const ColumnClass& row : kClasses) {
        std::vector<std::string> used, left;
        std::vector<std::pair<std::string, std::vector<std::string>>> notes;
        for (const Column& column : columns) {
            if (column.kind != row.kind) continue;
            (column.is_used ? used : left).push_back(column.name);
            if (column.note.empty()) continue;
            const auto at =
                std::find_if(notes.begin(), notes.end(), [&](const auto& note) { return note.first == column.note; });
            if (at == notes.end())
                notes.emplace_back(column.note, std::vector{column.name});
            else
                at->second.push_back(column.name);
        }
        std::vector<std::string> parts;
        if (!used.empty()) parts.push_back(short_list(used));
        if (!left.empty()) parts.push_back((row.kind == ColumnKind::unknown ? "" : "not used: ") + short_list(left));
        for (const auto& [note, of] : notes)
            parts.push_back(of.size() == used.size() + left.size() ? note : fmt::format("{}: {}", short_list(of), note));
        if (!parts.empty()) text += fmt::format("  {:<12} {}\n", row.name, fmt::join(parts, "; "));
    }
    return text;
}

}  // namespace tactiled
