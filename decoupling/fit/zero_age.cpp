#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/mixed_effects.hpp"
#include "decoupling/fit/recording_checks.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr double kHour_s = 3600, kShortest_s = 60;  // creep after a touch is no drift; a minute outlasts most of it
constexpr std::size_t kParts = 20;                  // in a session: their means depend little on each other
constexpr std::size_t kSessions = 5;                // fewer do not show a standard deviation
constexpr std::size_t kTried = 50;                  // rows on which a change of a channel is tried

// The readings of a session minus what the loads explain: one row per reading, one column per channel.
struct Unloaded {
    std::vector<double> t_h;
    std::vector<bool> rests;  // after a load: the first one leaves a memory that is no drift
    bool was_loaded = false;
    Eigen::MatrixXd channel;
};

// By the gains of all sessions: in the channels and not in the forces, because a fit with spare channels explains the drift
// of its own recording away.
std::vector<Unloaded> unloaded(const Calibration& calibration, const MixedEffects& effects) {
    std::vector<Unloaded> result(effects.index.size());
    std::vector<std::vector<Eigen::Index>> chosen(result.size());
    for (std::size_t i = 0; i < effects.rows.size(); ++i) {
        const LabelledRow& row = *effects.rows[i];
        if (row.t_ns == 0) continue;
        Unloaded& one = result[effects.session[i]];
        one.t_h.push_back(double(row.t_ns) * 1e-9 / kHour_s);
        const bool is_low = load_of(row.wrench_S, calibration) < LoadPeak::kRest;
        one.was_loaded = one.was_loaded || !is_low;
        one.rests.push_back(is_low && one.was_loaded);
        chosen[effects.session[i]].push_back(Eigen::Index(i));
    }
    for (std::size_t s = 0; s < result.size(); ++s) result[s].channel = effects.unloaded(chosen[s], Eigen::all);
    std::erase_if(result, [](const Unloaded& one) { return one.t_h.empty(); });
    return result;
}

// The mean of each channel in each part of a session; NaN in a part without rows.
using Means = std::vector<Eigen::VectorXd>;

Means means_of_parts(const Unloaded& session, bool at_rest) {
    const auto [first, last] = std::minmax_element(session.t_h.begin(), session.t_h.end());
    const double begin_h = *first, length_h = *last - *first;
    if (length_h < kShortest_s / kHour_s) return {};
    Means mean(kParts, Eigen::VectorXd::Zero(session.channel.cols()));
    std::array<double, kParts> n{};
    for (std::size_t i = 0; i < session.t_h.size(); ++i) {
        if (at_rest && !session.rests[i]) continue;
        const auto part = std::min(std::size_t((session.t_h[i] - begin_h) / length_h * double(kParts)), kParts - 1);
        ++n[part];
        mean[part] += session.channel.row(Eigen::Index(i)).transpose();
    }
    for (std::size_t i = 0; i < kParts; ++i) mean[i] /= n[i];
    return mean;
}

// The number of parts between changes: half of those from the first to the last with a mean.
std::size_t half_of(const Means& mean) {
    std::size_t first = mean.size(), last = 0;
    for (std::size_t i = 0; i < mean.size(); ++i)
        if (mean[i].allFinite()) first = std::min(first, i), last = i;
    return first < last ? (last - first + 1) / 2 : 0;
}

// Changes of the channels over a time, each scaled to an hour.
using Changes = std::vector<std::vector<double>>;

Changes changes_of(const Means& mean, std::size_t lag, double hours) {
    Changes changes;
    for (std::size_t i = 0; i + lag < mean.size(); ++i) {
        const Eigen::VectorXd change = (mean[i + lag] - mean[i]) / hours;
        if (change.allFinite()) changes.emplace_back(change.begin(), change.end());
    }
    return changes;
}

// Changes over half of the time, and between neighbouring parts, which scatter by noise and loads.
struct Drift {
    Changes far, near;
};

// From the rows at rest alone, where they last long enough, because loads leave hysteresis and curvature.
Drift drift_of(const std::vector<Unloaded>& sessions) {
    Drift all;
    for (const Unloaded& session : sessions) {
        const auto [first, last] = std::minmax_element(session.t_h.begin(), session.t_h.end());
        for (const bool at_rest : {true, false}) {
            const Means mean = means_of_parts(session, at_rest);
            const std::size_t half = half_of(mean);
            const double hours = double(half) / double(kParts) * (*last - *first);
            if (hours < kShortest_s / 2 / kHour_s) continue;
            const Changes far = changes_of(mean, half, hours), near = changes_of(mean, 1, hours);
            if (far.empty() || near.empty()) continue;
            all.far.insert(all.far.end(), far.begin(), far.end());
            all.near.insert(all.near.end(), near.begin(), near.end());
            break;
        }
    }
    return all;
}

// Returns the factor by which a mean of n squares exceeds that of all once in 1000 by chance: Wilson and Hilferty's quantile
// of the chi-square distribution over n.
double by_chance(double n) {
    constexpr double kOnceIn1000 = 3.09;  // standard deviations
    return std::pow(1 - 2 / (9 * n) + kOnceIn1000 * std::sqrt(2 / (9 * n)), 3);
}

// Returns what these changes of the channels do to each component: the root of the sum of their squared effects, which are
// means over some of the rows.
std::vector<double> effect_of(const Changes& changes, const Calibration& calibration, const Rows& rows) {
    const auto decoupler = make_decoupler(calibration);
    const auto force_of = [&](const std::vector<double>& channel) {
        decoupler->forget();
        return decoupler->decouple({.channel = channel}).wrench_S;
    };
    std::vector<double> squares(calibration.components.size()), tried(squares.size());
    for (std::size_t i = 0; i < rows.size(); i += 1 + rows.size() / kTried) {
        const Wrench before = force_of(rows[i]->channel);
        for (const std::vector<double>& change : changes) {
            std::vector<double> channel = rows[i]->channel;
            for (std::size_t k = 0; k < channel.size(); ++k) channel[k] += change[k];
            const Wrench after = force_of(channel);
            for (std::size_t c = 0; c < squares.size(); ++c) {
                const std::size_t at = component_index(calibration.components[c]);
                if (!std::isfinite(after[at] - before[at])) continue;
                squares[c] += (after[at] - before[at]) * (after[at] - before[at]);
                tried[c] += 1 / double(changes.size());
            }
        }
    }
    for (std::size_t c = 0; c < squares.size(); ++c) squares[c] = tried[c] > 0 ? std::sqrt(squares[c] / tried[c]) : 0;
    return squares;
}

// Returns the standard deviation of each component for zeros that move like those of the sessions, or with each channel by
// as much independently of the others, whichever is more: spare channels hide the one or the other from a fit.
std::vector<double> moved_like(const Changes& sessions, const Calibration& calibration, const Rows& rows) {
    if (sessions.empty()) return std::vector<double>(calibration.components.size());
    const double n = double(sessions.size());
    std::vector<double> together = effect_of(sessions, calibration, rows);
    Changes alone;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        double squares = 0;
        for (const std::vector<double>& session : sessions) squares += session[k] * session[k];
        alone.emplace_back(calibration.channels.size())[k] = std::sqrt(squares / n);
    }
    const std::vector<double> independent = effect_of(alone, calibration, rows);
    for (std::size_t c = 0; c < together.size(); ++c) together[c] = std::max(together[c] / std::sqrt(n), independent[c]);
    return together;
}

}  // namespace

bool set_zero_age(const Labelled& labelled, const Rows& rows, const SessionZeros& zeros, Calibration& calibration,
                  std::vector<std::string>& warnings) {
    Changes offsets;
    for (const std::vector<double>& offset : zeros.offset)
        if (!offset.empty()) offsets.push_back(offset);
    if (const auto n = double(offsets.size()); !zeros.sd.empty() && offsets.size() >= kSessions) {
        // a new session is as far from the mean of these
        calibration.zero_shift = moved_like(offsets, calibration, rows);
        for (double& each : calibration.zero_shift) each *= std::sqrt(n / (n - 1) * (1 + 1 / n));
    }
    if (calibration.sd.empty()) return false;
    if (std::all_of(rows.begin(), rows.end(), [](const auto* row) { return row->t_ns == 0; })) return false;
    const Drift drift = drift_of(unloaded(calibration, mixed_effects(labelled, rows)));
    if (drift.far.empty()) return false;
    const double chance = by_chance(double(drift.far.size()));
    const std::vector<double> far = moved_like(drift.far, calibration, rows),
                              near = moved_like(drift.near, calibration, rows);
    std::string drifts;
    for (std::size_t i = 0; i < far.size(); ++i) {
        const double seen = std::sqrt(std::max(0.0, far[i] * far[i] - near[i] * near[i]));
        if (!(far[i] * far[i] > chance * near[i] * near[i]) || !(seen > calibration.sd[i])) continue;
        if (calibration.zero_rate_per_h.empty()) calibration.zero_rate_per_h = calibration.zero_growth_per_h();
        calibration.zero_rate_per_h[i] = seen;
        const bool is_force = component_index(calibration.components[i]) < 3;
        drifts += fmt::format("{} {} by {:.2g} {}", drifts.empty() ? "" : ",", calibration.components[i], seen,
                              is_force ? "N" : "Nm");
    }
    if (!drifts.empty())
        warnings.insert(warnings.begin(),
                        fmt::format("the zero drifted in an hour (zero_rate_per_h):{}; the daemon's standard "
                                    "deviation grows as fast: tare or unload the sensor often",
                                    drifts));
    return true;
}

}  // namespace tactiled
