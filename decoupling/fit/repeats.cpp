#include "decoupling/fit/recording_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kHeldRows = 20, kRowsNeeded = 200;
// If a run of at least this many readings fills half of the time of a load, the end of the run was not observed.
constexpr int kEndlessRun = 10;

// Returns 0 if there is no interval.
double median_s(const std::vector<double>& intervals_ns) { return intervals_ns.empty() ? 0 : median(intervals_ns) * 1e-9; }

// The noise of the channels: their successive differences in the quieter stretches without a load, as in
// node/quiet_check.hpp.
class Rests {
public:
    explicit Rests(const Rows& rows)
        : rows_(rows), full_scale_(full_scales(rows)), channels_(rows.front()->channel.size()) {}

    // Takes the rows from `begin` to before `end`, which have one load.
    void add(std::size_t begin, std::size_t end) {
        if (end - begin < kRestRows || rows_[begin]->t_ns == 0) return;
        for (std::size_t c = 0; c < full_scale_.size(); ++c)
            if (std::abs(rows_[begin]->wrench_S[c]) > LoadPeak::kRest * full_scale_[c]) return;
        for (std::size_t k = 0; k < channels_.size(); ++k) {
            std::vector<double> steps;
            double squares = 0;
            for (std::size_t i = begin + 1; i < end; ++i) {
                steps.push_back(std::abs(rows_[i]->channel[k] - rows_[i - 1]->channel[k]));
                squares += steps.back() * steps.back();
            }
            const double sd = std::sqrt(squares / (2 * double(steps.size())));
            if (sd > 0) channels_[k].sd.push_back(sd);
            channels_[k].has_fine_steps |= std::any_of(
                steps.begin(), steps.end(), [&](double step) { return step > kRounding * sd && step <= kFineStep * sd; });
        }
    }
    // 0 for a channel whose steps are too large to show its noise; empty without a stretch.
    [[nodiscard]] std::vector<double> noise() const {
        std::vector<double> noise;
        for (Channel each : channels_) {
            if (each.sd.empty()) return {};
            const auto quarter = each.sd.begin() + std::ptrdiff_t(each.sd.size() / 4);
            std::nth_element(each.sd.begin(), quarter, each.sd.end());
            noise.push_back(each.has_fine_steps ? *quarter : 0);
        }
        return noise;
    }

private:
    static constexpr std::size_t kRestRows = 10;
    // Relative to the noise: the largest step of a channel that shows it, and that of a number which text or a float has
    // rounded.
    static constexpr double kFineStep = 0.5, kRounding = 0.01;
    struct Channel {
        std::vector<double> sd;  // for each stretch in which the channel changed
        bool has_fine_steps = false;
    };
    const Rows& rows_;
    Wrench full_scale_;
    std::vector<Channel> channels_;
};

}  // namespace

Repeats repeats_of(const Rows& rows) {
    if (rows.empty()) return {};
    const std::size_t n = rows.front()->channel.size();
    const std::vector<std::size_t> load = loads_of(rows);
    Repeats repeats{.readings = std::vector<int>(n, 1), .interval_s = 0};
    std::vector<bool> endless(n);
    std::vector<double> intervals_ns, all_intervals_ns;
    std::size_t looked_at = 0;
    Rests rests(rows);
    const auto follows = [&](std::size_t i) {
        return load[i] == load[i - 1] && rows[i]->session == rows[i - 1]->session && rows[i]->line == rows[i - 1]->line + 1;
    };
    for (std::size_t begin = 0, end; begin < rows.size(); begin = end) {
        for (end = begin + 1; end < rows.size() && follows(end); ++end)
            if (rows[end]->t_ns > rows[end - 1]->t_ns)
                all_intervals_ns.push_back(double(rows[end]->t_ns - rows[end - 1]->t_ns));
        rests.add(begin, end);
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
    if (looked_at < kRowsNeeded) return {.readings = {}, .interval_s = median_s(all_intervals_ns), .noise = rests.noise()};
    for (std::size_t k = 0; k < n; ++k)
        if (endless[k]) repeats.readings[k] = 0;
    repeats.interval_s = median_s(intervals_ns);
    repeats.noise = rests.noise();
    return repeats;
}

}  // namespace tactiled
