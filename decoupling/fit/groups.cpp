#include "decoupling/fit/groups.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "decoupling/fit/labels.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kStretches = 5;  // stretches of time, if there are no sessions to leave out
constexpr std::size_t kMaxPoseGroups = 10, kMaxLoadGroups = 100;
constexpr std::size_t kRowsPerPose = 5;  // minimum mean number of rows per pose for repeated poses
// Relative to the largest load; a smaller range in the rest would mean extrapolation. A new session may well exceed
// the range of the others.
constexpr double kSpanned = 0.3, kSpannedBySessions = 0.1;

Groups groups_of_sessions(const Labelled& labelled, const Rows& rows) {
    std::vector<bool> occurs(std::max<std::size_t>(labelled.sessions.size(), 1));
    for (const auto* row : rows) occurs[row->session] = true;
    const auto sessions = std::count(occurs.begin(), occurs.end(), true);
    Groups groups;
    if (sessions < 2) return groups;
    groups.are_sessions = true;
    for (const auto* row : rows) groups.of_row.push_back(row->session);
    for (const auto& name : labelled.sessions) groups.names.push_back("session " + name);
    groups.validation = fmt::format("leave one session out ({} sessions)", sessions);
    return groups;
}

// Returns poses in groups of neighbours; empty if the rows do not repeat poses. Each rest is a pose of its own: without any
// rest the zero is that of loads with their hysteresis.
Groups groups_of_poses(const Rows& rows) {
    Groups groups;
    std::map<std::pair<Wrench, std::size_t>, std::size_t> poses;  // with the number of the rest, 0 under load
    std::vector<std::size_t> pose_of_row;
    std::size_t rests = 0;
    bool rested = false;
    for (const auto* row : rows) {
        Wrench key = row->wrench_S;
        const bool is_rest = std::none_of(key.begin(), key.end(), [](double value) { return value < 0 || value > 0; });
        if (is_rest && !rested) ++rests;
        rested = is_rest;
        for (double& value : key)
            if (std::isnan(value)) value = 1e300;  // NaN has no order
        pose_of_row.push_back(poses.try_emplace({key, is_rest ? rests : 0}, poses.size()).first->second);
    }
    if (poses.size() < 4 || poses.size() * kRowsPerPose > rows.size()) return groups;
    const std::size_t n = std::min(kMaxPoseGroups, poses.size());
    for (const std::size_t pose : pose_of_row) groups.of_row.push_back(pose * n / poses.size());
    for (std::size_t i = 0; i < n; ++i) groups.names.push_back(fmt::format("the poses' group number {} of {}", i + 1, n));
    groups.validation = fmt::format("leave poses out ({} poses in {} groups)", poses.size(), n);
    return groups;
}

// Returns the indices of the rows by their times, or as in the file where these are equal.
std::vector<std::size_t> in_time(const Rows& rows) {
    std::vector<std::size_t> by_time(rows.size());
    std::iota(by_time.begin(), by_time.end(), std::size_t{0});
    std::stable_sort(by_time.begin(), by_time.end(),
                     [&](std::size_t a, std::size_t b) { return rows[a]->t_ns < rows[b]->t_ns; });
    return by_time;
}

// Uses the times of the rows, if the file has them: rows that were shuffled would amount to random rows.
Groups groups_of_stretches(const Rows& rows) {
    Groups groups;
    const std::vector<std::size_t> by_time = in_time(rows);
    groups.of_row.resize(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) groups.of_row[by_time[i]] = i * kStretches / rows.size();
    for (std::size_t i = 0; i < kStretches; ++i)
        groups.names.push_back(fmt::format("the stretch of time number {} of {}", i + 1, kStretches));
    groups.validation = fmt::format("leave one of {} stretches of time out", kStretches);
    return groups;
}

// Returns the sessions that occur, in the order of the file.
std::vector<std::size_t> sessions_of(const Rows& rows) {
    std::vector<std::size_t> sessions;
    for (const auto* row : rows)
        if (std::find(sessions.begin(), sessions.end(), row->session) == sessions.end()) sessions.push_back(row->session);
    return sessions;
}

// The last third of the rows in time, or of three sessions and more. No row in use comes before the calibration, and what
// drifts is farther off then than between the rows.
Groups groups_in_time(const Rows& rows, const std::vector<std::size_t>& sessions) {
    const auto first_of = [](std::size_t n) { return n - (n + 2) / 3; };
    Groups groups;
    groups.of_row.resize(rows.size());
    groups.are_in_time = true;
    if (sessions.size() > 2) {
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const auto at = std::find(sessions.begin(), sessions.end(), rows[i]->session) - sessions.begin();
            groups.of_row[i] = std::size_t(at) >= first_of(sessions.size()) ? 1 : 0;
        }
        groups.are_sessions = true;
        groups.names = {"", "the last third of the sessions"};
    } else {
        const std::vector<std::size_t> by_time = in_time(rows);
        for (std::size_t i = first_of(rows.size()); i < rows.size(); ++i) groups.of_row[by_time[i]] = 1;
        const bool has_times = rows[by_time.front()]->t_ns != rows[by_time.back()]->t_ns;
        groups.names = {"", has_times ? "the last third of the time" : "the last third of the rows"};
    }
    groups.validation = fmt::format("leave {} out", groups.names[1]);
    return groups;
}

// Returns one load each; if there are many loads, groups of loads that are far apart in the recording.
Groups groups_of_loads(const Rows& rows) {
    Groups groups;
    groups.of_row = loads_of(rows);
    const std::size_t loads = rows.empty() ? 0 : groups.of_row.back() + 1, n = std::min(loads, kMaxLoadGroups);
    if (loads < 4) return {};
    for (std::size_t& load : groups.of_row) load %= n;
    for (std::size_t i = 0; i < n; ++i) groups.names.push_back(fmt::format("load number {}", i + 1));
    groups.validation = n == loads ? fmt::format("leave one load out ({} loads)", loads)
                                   : fmt::format("leave loads out ({} loads in {} groups)", loads, n);
    groups.are_loads = true;
    return groups;
}

}  // namespace

std::vector<std::size_t> loads_of(const Rows& rows) {
    const Wrench full_scale = full_scales(rows);
    std::vector<std::size_t> load;
    const LabelledRow* first = nullptr;
    std::size_t n = 0;
    for (const auto* row : rows) {
        bool same = first != nullptr && row->session == first->session;
        for (std::size_t c = 0; same && c < full_scale.size(); ++c) {
            const double a = row->wrench_S[c], b = first->wrench_S[c];
            same = std::isnan(a) ? std::isnan(b) : std::abs(a - b) <= kSameLoad * full_scale[c];
        }
        if (!same) {
            if (first != nullptr) ++n;
            first = row;
        }
        load.push_back(n);
    }
    return load;
}

std::string not_spanned_without(const Rows& rows, const Groups& groups, std::size_t group) {
    const Wrench full_scale = full_scales(rows);
    Wrench rest{};
    for (std::size_t i = 0; i < rows.size(); ++i)
        for (std::size_t c = 0; groups.fits(i, group) && c < rest.size(); ++c)
            if (std::abs(rows[i]->wrench_S[c]) > rest[c]) rest[c] = std::abs(rows[i]->wrench_S[c]);
    for (std::size_t c = 0; c < rest.size(); ++c)
        if (rest[c] < (groups.are_sessions ? kSpannedBySessions : kSpanned) * full_scale[c]) return kComponentNames[c];
    return "";
}

std::vector<Groups> ways_to_hold_out(const Labelled& labelled, const Rows& rows, bool remembers) {
    std::vector<Groups> ways;
    if (Groups sessions = groups_of_sessions(labelled, rows); !sessions.names.empty()) {
        ways.push_back(std::move(sessions));
    } else {
        if (!remembers)
            if (Groups poses = groups_of_poses(rows); !poses.names.empty()) ways.push_back(std::move(poses));
        ways.push_back(groups_of_stretches(rows));
    }
    const std::vector<std::size_t> sessions = sessions_of(rows);  // two of them, left out in turn, are in time already
    if (!rows.empty() && sessions.size() != 2) ways.push_back(groups_in_time(rows, sessions));
    if (remembers) return ways;
    if (Groups loads = groups_of_loads(rows); !loads.names.empty()) ways.push_back(std::move(loads));
    return ways;
}

}  // namespace tactiled
