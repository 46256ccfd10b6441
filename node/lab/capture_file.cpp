#include "node/lab/capture_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include "config/text_file.hpp"
#include "decoupling/csv.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/labelled.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kMinLevels = 3;  // two loads do not show whether a sensor is linear
constexpr double kPauseBetween_s = 1;  // pause in t_s between two captures, also if the clock restarted

std::string cell(double value) { return std::isfinite(value) ? fmt::format("{}", value) : std::string(); }

std::size_t component_of(const std::string& column) {
    std::size_t c = 0;
    while (c < 6 && label_column(c) != column) ++c;
    return c;
}

constexpr double kSameLoad = 0.02;  // relative to the largest load: a reference never measures the same load twice

// Merges levels that differ by less than kSameLoad.
std::vector<double> distinct(const std::map<double, std::size_t>& levels) {
    std::vector<double> out;
    if (levels.empty()) return out;
    const double scale = std::max(std::abs(levels.begin()->first), std::abs(levels.rbegin()->first));
    for (const auto& [value, rows] : levels)
        if (out.empty() || value - out.back() > kSameLoad * scale) out.push_back(value);
    return out;
}

}  // namespace

CaptureFile::CaptureFile(std::string path, std::vector<std::string> channels)
    : path_(std::move(path)), channels_(std::move(channels)) {
    std::error_code none;
    if (!std::filesystem::exists(path_, none) || std::filesystem::file_size(path_, none) == 0) return;
    CsvReader csv(path_);
    if (const std::string about = csv.about(); !about.empty())
        csv.refuse(fmt::format("is no plain CSV ({}): name another file with --append", about));
    columns_ = csv.columns();
    std::vector<std::string> there;
    std::vector<std::size_t> at, channel_at;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
        const std::size_t c = component_of(columns_[k]);
        if (c < 6) {
            label_.push_back(c);
            at.push_back(k);
        } else if (columns_[k] != "t_s" && columns_[k] != "session") {
            there.push_back(columns_[k]);
            channel_at.push_back(k);
        }
    }
    if (std::ifstream last(path_, std::ios::binary | std::ios::ate); last) {
        last.seekg(-1, std::ios::end);
        ends_with_a_line_ = last.get() == '\n';
    }
    const auto time = csv.find("t_s"), session = csv.find("session");
    if (label_.empty() || !session || !time)
        csv.refuse("has no t_s, no session or no label: name another file with --append");
    if (there.size() != channels_.size())
        csv.refuse(fmt::format("has {} channels ({}), the link sends {}: name another file with --append", there.size(),
                               fmt::join(there, " "), channels_.size()));
    if (!channels_.empty() && !channels_[0].empty() && there != channels_)
        csv.refuse(
            fmt::format("has the channels {}, --channels names {}", fmt::join(there, " "), fmt::join(channels_, " ")));
    channels_ = there;
    while (csv.next()) {
        Load load;
        load.fill(std::nan(""));
        for (std::size_t i = 0; i < at.size(); ++i) load[label_[i]] = csv.number(at[i]);
        last_session_ = std::string(csv.text(*session));
        last_t_s_ = std::max(last_t_s_, csv.number(*time));
        note(load, last_session_);
        for (std::size_t k = 0; k < channel_at.size(); ++k) note_channel(k, csv.number(channel_at[k]));
    }
}

void CaptureFile::note(const Load& load, const std::string& session) {
    ++rows_of_session_[session];
    const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
    if (loads_ == 0 || !std::equal(load.begin(), load.end(), last_load_.begin(), same)) ++loads_;
    last_load_ = load;
    double largest = 0;
    for (std::size_t c = 0; c < load.size(); ++c)
        if (std::isfinite(load[c])) {
            ++levels_[c][load[c]];
            largest = std::max(largest, std::abs(load[c]));
        }
    const auto [at, is_first] = smallest_of_session_.try_emplace(session, largest);
    if (!is_first) at->second = std::min(at->second, largest);
}

void CaptureFile::note_channel(std::size_t k, double value) {
    if (!std::isfinite(value)) return;
    while (extremes_.size() <= k)
        extremes_.emplace_back(std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity());
    extremes_[k].first = std::min(extremes_[k].first, value);
    extremes_[k].second = std::max(extremes_[k].second, value);
}

double CaptureFile::range(std::size_t k) const {
    return k < extremes_.size() ? std::max(0.0, extremes_[k].second - extremes_[k].first) : 0;
}

void CaptureFile::check(const Load& load) const {
    if (std::none_of(load.begin(), load.end(), [](double v) { return std::isfinite(v); }))
        throw SetupError("no load is given: --label fz_N=-5, --reference or --scale");
    for (std::size_t c = 0; c < load.size() && !label_.empty(); ++c) {
        const bool in_file = std::find(label_.begin(), label_.end(), c) != label_.end();
        const bool given = std::isfinite(load[c]);
        if (in_file && !given)
            throw SetupError(
                fmt::format("{0}: its rows have {1}; add {1}=0, or its value, to the load", path_, label_column(c)));
        if (!in_file && given)
            throw SetupError(
                fmt::format("{}: its rows have no {}; leave it out, or begin a new file", path_, label_column(c)));
    }
}

void CaptureFile::append(const std::vector<CapturedRow>& rows, const std::string& session) {
    if (rows.empty()) return;
    check(rows.front().load);
    const bool is_new = label_.empty();
    for (std::size_t c = 0; c < 6 && is_new; ++c)
        if (std::isfinite(rows.front().load[c])) label_.push_back(c);
    std::string text;
    if (is_new) {
        columns_ = {"t_s"};
        columns_.insert(columns_.end(), channels_.begin(), channels_.end());
        for (const std::size_t c : label_) columns_.push_back(label_column(c));
        columns_.emplace_back("session");
        text = fmt::format("{}\n", fmt::join(columns_, ","));
    }
    if (!is_new && !ends_with_a_line_) text += '\n';  // an editor has removed the last line feed
    ends_with_a_line_ = true;
    const double begin_s = double(rows.front().t_ns) / 1e9;
    const double shift_s = begin_s > last_t_s_ ? 0 : last_t_s_ + kPauseBetween_s - begin_s;
    for (const CapturedRow& row : rows) {
        const double t_s = double(row.t_ns) / 1e9 + shift_s;
        std::size_t channel = 0;
        for (std::size_t k = 0; k < columns_.size(); ++k) {
            const std::size_t c = component_of(columns_[k]);
            text += k == 0 ? "" : ",";
            text += columns_[k] == "t_s"       ? fmt::format("{:.6f}", t_s)
                    : columns_[k] == "session" ? session
                    : c < 6                    ? cell(row.load[c])
                                               : cell(row.channel[channel++]);
        }
        text += '\n';
        last_t_s_ = t_s;
        note(row.load, session);
        for (std::size_t k = 0; k < row.channel.size(); ++k) note_channel(k, row.channel[k]);
    }
    File file(std::fopen(path_.c_str(), "ae"));
    if (file == nullptr || std::fwrite(text.data(), 1, text.size(), file.get()) != text.size() ||
        std::fflush(file.get()) != 0 || ::fsync(::fileno(file.get())) != 0)
        throw SaveError(fmt::format("{}: {}", path_, std::strerror(errno)));
    last_session_ = session;
}

std::vector<std::string> CaptureFile::coverage() const {
    std::vector<std::string> lines;
    for (const std::size_t c : label_) {
        const auto levels = distinct(levels_[c]);
        if (!levels.empty())
            lines.push_back(fmt::format("{}: {:g} .. {:g} in {} loads", label_column(c), levels_[c].begin()->first,
                                        levels_[c].rbegin()->first, levels.size()));
    }
    return lines;
}

std::vector<std::string> CaptureFile::missing() const {
    std::vector<std::string> lines;
    bool at_rest = true;
    for (const std::size_t c : label_) {
        double smallest = std::numeric_limits<double>::infinity(), largest = 0;
        for (const auto& [value, rows] : levels_[c]) {
            smallest = std::min(smallest, std::abs(value));
            largest = std::max(largest, std::abs(value));
        }
        at_rest = at_rest && smallest <= kSameLoad * largest;
    }
    if (!at_rest) lines.emplace_back("no row without a load: capture one with every label 0");
    double largest = 0;
    for (const std::size_t c : label_)
        for (const auto& [value, rows] : levels_[c]) largest = std::max(largest, std::abs(value));
    for (const auto& [session, smallest] : smallest_of_session_)
        if (at_rest && smallest > kSameLoad * largest)
            lines.push_back(fmt::format(
                "session {0} has no row without a load: capture one with every label 0 and --session {0}", session));
    for (std::size_t c = 0; c < 6; ++c) {
        const std::string name = label_column(c);
        if (std::find(label_.begin(), label_.end(), c) == label_.end()) {
            if (c < 3 && label_.size() < channels_.size())
                lines.push_back(fmt::format("{} is not labelled: the calibration will not measure it", name));
            continue;
        }
        const auto levels = distinct(levels_[c]);
        if (levels.empty()) continue;
        const double low = levels_[c].begin()->first, high = levels_[c].rbegin()->first;
        if (low == 0 && high == 0)
            lines.push_back(fmt::format("{} was always 0: load this axis, too", name));
        else if (c != 2 && (low >= 0 || high <= 0))
            lines.push_back(fmt::format("{} was loaded to one side only ({:g} .. {:g}): add the mirrored load {:g}", name,
                                        low, high, low >= 0 ? -high : -low));
        else if (levels.size() < kMinLevels)
            lines.push_back(
                fmt::format("{} has {} loads: {} show whether the sensor is linear", name, levels.size(), kMinLevels));
    }
    if (const std::size_t needed = kRowsPerCoefficient * (channels_.size() + 1); loads_ < needed)
        lines.push_back(fmt::format("{} loads: {} channels need at least {}, those of all sessions together", loads_,
                                    channels_.size(), needed));
    if (rows_of_session_.size() < 2)
        lines.emplace_back(
            "one session: take the sensor off, mount it again, and capture with --session 2, so that calibrate can "
            "hold one out");
    return lines;
}

}  // namespace tactiled::ctl
