#include "decoupling/fit/labelled.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>

#include "decoupling/csv.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxSessions = 1000, kSessionsOfFewRows = 20;
constexpr double kLatest_s = 9e9;  // the year 2255, and below 2^64 in nanoseconds; the same before 0

// Returns the component that a column seems to contain, 6 if none: "fz", "Fz_mN", "mx_Nmm". A label that was used as
// a channel would predict itself, and the calibration would seem perfect.
std::size_t meant_component(std::string_view column) {
    std::string name(column.substr(0, 2));
    std::transform(name.begin(), name.end(), name.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
    if (column.size() > 2 && column[2] != '_' && column[2] != ' ' && column[2] != '(' && column[2] != '[') return 6;
    return std::size_t(std::find(kComponentNames.begin(), kComponentNames.end(), name) - kComponentNames.begin());
}

// Returns the kind of a column that is not a channel, "" if it may be a channel. A time or a row number that was used as a
// channel would fit this recording only.
std::string no_channel(std::string_view column) {
    std::string name(column);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
    const auto is = [&](std::initializer_list<std::string_view> words) {
        return std::any_of(words.begin(), words.end(), [&](std::string_view word) {
            return name == word ||
                   (name.starts_with(word) && std::string_view("_ .-/[(").find(name[word.size()]) != name.npos);
        });
    };
    if (is({"time", "timestamp", "date", "datetime", "t_ms", "t_us", "t_ns", "seconds", "stamp"}) || name == "t")
        return "a time is called \"t_s\" and is in seconds";
    if (is({"row", "index", "line", "sample", "seq", "sequence", "frame", "id"}) || name.starts_with("unnamed:"))
        return "a row number is no reading";
    if (is({"reference", "ground_truth", "label", "target"})) return "a reference would predict itself";
    if (is({"temp", "temperature"})) return "the temperature of the sensor is called \"temperature_C\"";
    if (is({"trial", "step", "phase", "contact", "run", "experiment"})) return "the course of an experiment is no reading";
    if (is({"robot", "pose", "position", "pos", "depth", "cmd", "command", "joint", "roll", "pitch", "yaw", "x", "y", "z"}))
        return "the place of a robot or of a press is no reading";
    if (is({"force", "weight", "torque", "moment"})) return "a label is called fx_N fy_N fz_N mx_Nm my_Nm or mz_Nm";
    return "";
}

std::string list(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, " ")); }

}  // namespace

std::string label_column(std::size_t c) { return fmt::format("{}_{}", kComponentNames[c], c < 3 ? "N" : "Nm"); }

Labelled read_labelled(const std::string& path, const Selection& selection) {
    CsvReader csv(path);
    Labelled labelled;
    labelled.name = csv.name();
    std::array<std::optional<std::size_t>, 6> label{};
    bool any_label = false;
    for (std::size_t c = 0; c < label.size(); ++c) {
        label[c] = csv.find(label_column(c));
        any_label = any_label || label[c].has_value();
    }
    const auto session = csv.find("session"), time = csv.find("t_s"), temperature = csv.find("temperature_C");
    std::vector<std::size_t> channel;  // index of the column
    for (std::size_t k = 0; k < csv.columns().size(); ++k) {
        const std::string& name = csv.columns()[k];
        if (name == "t_s" || name == "session" || name == "temperature_C" ||
            std::find(label.begin(), label.end(), k) != label.end())
            continue;
        if (const std::size_t c = meant_component(name); c < label.size())
            csv.refuse(fmt::format("column \"{}\": a label is called \"{}\" and is in {}", name, label_column(c),
                                   c < 3 ? "N" : "Nm"));
        if (!selection.channels.empty()) continue;
        if (const std::string why = no_channel(name); !why.empty())
            csv.refuse(
                fmt::format("column \"{}\" would be a channel, but {}; delete it, or choose with --channels", name, why));
        labelled.channels.push_back(name);
        channel.push_back(k);
    }
    if (!any_label) csv.refuse("no label; name at least one column fx_N fy_N fz_N mx_Nm my_Nm or mz_Nm");
    for (const auto& name : selection.channels) {
        const auto column = csv.find(name);
        if (!column) csv.refuse(fmt::format("has no channel \"{}\"; its columns are {}", name, list(csv.columns())));
        if (column == time || column == session || std::find(label.begin(), label.end(), column) != label.end())
            csv.refuse(fmt::format("column \"{}\" is no channel: it is a time, a session or a label", name));
        if (std::find(channel.begin(), channel.end(), *column) != channel.end())
            csv.refuse(fmt::format("channel \"{}\" was chosen twice", name));
        labelled.channels.push_back(name);
        channel.push_back(*column);
    }
    if (channel.empty()) csv.refuse("no channel beside t_s, session and the labels");
    if (channel.size() > 32)
        csv.refuse(fmt::format("{} channels; a sensor has at most 32: choose with --channels", channel.size()));
    if (!selection.sessions.empty() && !session) csv.refuse("has no column \"session\" to choose from");

    std::vector<double> t_s;  // time of each row kept
    double earliest_s = 0;
    std::vector<std::string> seen_sessions;  // chosen or not, for the message below
    while (csv.next()) {
        LabelledRow row{.line = csv.line(), .channel = {}, .wrench_S = kUnseen, .session = 0, .t_ns = 0};
        if (session) {
            const std::string name(csv.text(*session));
            if (name.empty()) csv.refuse("column session is empty; which session is this row of?");
            if (std::find(seen_sessions.begin(), seen_sessions.end(), name) == seen_sessions.end())
                seen_sessions.push_back(name);
            if (seen_sessions.size() > kMaxSessions)
                csv.refuse(fmt::format("more than {} sessions; a session is one mounting or one recording, not one row",
                                       kMaxSessions));
            const auto& wanted = selection.sessions;
            if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
            const auto at = std::find(labelled.sessions.begin(), labelled.sessions.end(), name);
            row.session = std::size_t(at - labelled.sessions.begin());
            if (at == labelled.sessions.end()) labelled.sessions.push_back(name);
        }
        for (const std::size_t k : channel) row.channel.push_back(csv.number(k));
        for (std::size_t c = 0; c < label.size(); ++c)
            if (label[c]) row.wrench_S[c] = csv.number(*label[c]);
        if (temperature) row.temperature_C = csv.number(*temperature);
        labelled.rows.push_back(std::move(row));
        t_s.push_back(time ? csv.number(*time) : kNaN);
        if (std::abs(t_s.back()) > kLatest_s)
            csv.refuse(fmt::format("t_s is {:.4g} s, which is no time of these centuries: is it in ms, us or ns? Divide it",
                                   t_s.back()));
        if (t_s.back() < earliest_s) earliest_s = t_s.back();
    }
    // Negative times are all moved by the same amount, because 0 means unknown.
    const double origin_s = earliest_s < 0 ? std::floor(earliest_s) - 1 : 0;
    for (std::size_t i = 0; i < labelled.rows.size(); ++i)
        if (t_s[i] - origin_s > 0) labelled.rows[i].t_ns = std::uint64_t((t_s[i] - origin_s) * 1e9);
    for (const auto& name : selection.sessions)
        if (std::find(seen_sessions.begin(), seen_sessions.end(), name) == seen_sessions.end())
            throw SetupError(
                fmt::format("{}: has no session \"{}\"; its sessions are {}", csv.name(), name, list(seen_sessions)));
    if (labelled.rows.empty()) throw SetupError(csv.name() + ": has no rows");
    if (labelled.sessions.size() > kSessionsOfFewRows && labelled.rows.size() < 2 * labelled.sessions.size())
        throw SetupError(fmt::format("{}: {} sessions in {} rows; a session is one mounting or one recording, not one row",
                                     csv.name(), labelled.sessions.size(), labelled.rows.size()));
    return labelled;
}

}  // namespace tactiled
