#include "decoupling/fit/recording_checks.hpp"

#include <algorithm>
#include <cstdint>

#include "decoupling/fit/groups.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kHeldRows = 20, kRowsNeeded = 200;
// If a run of at least this many readings fills half of the time of a load, the end of the run was not observed.
constexpr int kEndlessRun = 10;

// Returns 0 if there is no interval.
double median_s(const std::vector<double>& intervals_ns) { return intervals_ns.empty() ? 0 : median(intervals_ns) * 1e-9; }

}  // namespace

Repeats repeats_of(const Rows& rows) {
    if (rows.empty()) return {};
    const std::size_t n = rows.front()->channel.size();
    const std::vector<std::size_t> load = loads_of(rows);
    Repeats repeats{.readings = std::vector<int>(n, 1), .interval_s = 0};
    std::vector<bool> endless(n);
    std::vector<double> intervals_ns, all_intervals_ns;
    std::size_t looked_at = 0;
    const auto follows = [&](std::size_t i) {
        return load[i] == load[i - 1] && rows[i]->session == rows[i - 1]->session && rows[i]->line == rows[i - 1]->line + 1;
    };
    for (std::size_t begin = 0, end; begin < rows.size(); begin = end) {
        for (end = begin + 1; end < rows.size() && follows(end); ++end)
            if (rows[end]->t_ns > rows[end - 1]->t_ns)
                all_intervals_ns.push_back(double(rows[end]->t_ns - rows[end - 1]->t_ns));
        if (end - begin < kHeldRows) continue;
        looked_at += end - begin;
        for (std::size_t i = begin + 1; i < end; ++i)
            if (rows[i]->t_ns > rows[i - 1]->t_ns) intervals_ns.push_back(double(rows[i]->t_ns - rows[i - 1]->t_ns));
        for (std::size_t k = 0; k < n; ++k) {
            int run = 1;
            for (std::size_t i = begin + 1; i < end; ++i) {
                run = rows[i]->channel[k] == rows[i - 1]->channel[k] ? run + 1 : 1;
                repeats.readings[k] = std::max(repeats.readings[k], run);
                if (run >= kEndlessRun && 2 * std::size_t(run) > end - begin) endless[k] = true;
            }
        }
    }
    if (looked_at < kRowsNeeded) return {.readings = {}, .interval_s = median_s(all_intervals_ns)};
    for (std::size_t k = 0; k < n; ++k)
        if (endless[k]) repeats.readings[k] = 0;
    repeats.interval_s = median_s(intervals_ns);
    return repeats;
}

}  // namespace tactiled
