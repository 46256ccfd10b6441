#include "node/lab/capture_steadiness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tactiled::ctl {
namespace {

// A channel of few bits repeats itself for some rows at rest; fewer rows than this show nothing.
constexpr std::size_t kStuckRows = 10;
// The drift of noise, in standard errors, of which the noise is known from a few rows only.
constexpr double kBeyondNoise = 5;
// A creeping skin moves less within some seconds, and a changing load more.
constexpr double kMoved = 0.05;

Steadiness steadiness_of(const std::vector<CapturedRow>& rows, std::size_t k, const std::string& name) {
    Steadiness s;
    s.name = name;
    std::vector<double> values;
    for (const auto& row : rows)
        if (std::isfinite(row.channel[k]))
            values.push_back(row.channel[k]);
        else
            ++s.missing;
    if (values.empty()) return s;
    const auto mean = [&](std::size_t from, std::size_t to) {
        double sum = 0;
        for (std::size_t i = from; i < to; ++i) sum += values[i] - values[0];
        return values[0] + sum / double(std::max<std::size_t>(1, to - from));
    };
    const std::size_t n = values.size(), quarter = std::max<std::size_t>(1, n / 4);
    s.mean = mean(0, n);
    s.min = *std::min_element(values.begin(), values.end());
    s.max = *std::max_element(values.begin(), values.end());
    for (const double value : values) s.sd += (value - s.mean) * (value - s.mean);
    s.sd = n < 2 ? 0 : std::sqrt(s.sd / double(n - 1));
    s.drift = mean(n - quarter, n) - mean(0, quarter);
    double steps = 0;  // a ramp has small ones, noise has not
    for (std::size_t i = 1; i < n; ++i) steps += (values[i] - values[i - 1]) * (values[i] - values[i - 1]);
    const double noise = n < 2 ? 0 : std::sqrt(steps / double(n - 1) / 2);
    s.moves = std::abs(s.drift) > 2 * s.sd && std::abs(s.drift) > kBeyondNoise * noise * std::sqrt(2 / double(quarter));
    s.stuck = n >= kStuckRows && s.min == s.max;  // until the others are known
    return s;
}

}  // namespace

std::vector<std::string> moving_channels(const std::vector<Steadiness>& channels, const CaptureFile& file) {
    std::vector<std::string> names;
    for (std::size_t k = 0; k < channels.size(); ++k)
        if (channels[k].moves && file.range(k) > 0 && std::abs(channels[k].drift) > kMoved * file.range(k))
            names.push_back(channels[k].name);
    return names;
}

std::vector<Steadiness> steadiness(const std::vector<CapturedRow>& rows, const std::vector<std::string>& names) {
    std::vector<Steadiness> all;
    for (std::size_t k = 0; k < names.size(); ++k) all.push_back(steadiness_of(rows, k, names[k]));
    const bool any_changed = std::any_of(all.begin(), all.end(), [](const Steadiness& s) { return s.min < s.max; });
    for (Steadiness& s : all) s.stuck = s.stuck && any_changed;
    return all;
}

std::vector<std::string> stuck_channels(const std::vector<Steadiness>& channels) {
    std::vector<std::string> lines;
    for (std::size_t k = 0; k < channels.size(); ++k)
        if (channels[k].stuck)
            lines.push_back(fmt::format("channel {} ({}) did not change while the others did: check its wire and its input",
                                        k + 1, channels[k].name));
    return lines;
}

void print_load(const std::vector<CapturedRow>& rows, const std::vector<Steadiness>& channels) {
    const double seconds = double(rows.back().t_ns - rows.front().t_ns) / 1e9;
    fmt::print("{}: {} rows in {:.1f} s\n{:>10} {:>12} {:>10} {:>12} {:>12} {:>10}\n", load_text(rows.front().load),
               rows.size(), seconds, "channel", "mean", "sd", "lowest", "highest", "drift");
    for (const Steadiness& s : channels) {
        fmt::print("{:>10} {:>12.6g} {:>10.3g} {:>12.6g} {:>12.6g} {:>10.3g}{}{}\n", s.name, s.mean, s.sd, s.min, s.max,
                   s.drift, s.moves ? "  still moves: wait longer, --settle" : "",
                   s.missing != 0 ? fmt::format("  {} missing", s.missing) : "");
    }
    for (const auto& line : stuck_channels(channels)) fmt::print("warning: {}\n", line);
}

nlohmann::json load_json(const std::vector<CapturedRow>& rows, const std::vector<Steadiness>& all) {
    nlohmann::json channels = nlohmann::json::array();
    for (const auto& s : all)
        channels.push_back({{"name", s.name},
                            {"mean", s.mean},
                            {"sd", s.sd},
                            {"min", s.min},
                            {"max", s.max},
                            {"drift", s.drift},
                            {"missing", s.missing},
                            {"stuck", s.stuck}});
    return {{"label", load_text(rows.front().load)},
            {"rows", rows.size()},
            {"channels", channels},
            {"warnings", stuck_channels(all)}};
}

}  // namespace tactiled::ctl
