#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "decoupling/fit/labels.hpp"
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
constexpr std::size_t kFewestParts = 10;
constexpr double kSure = 4;           // standard errors of a slope: once in 1000 by chance
constexpr std::size_t kSessions = 5;  // fewer do not show a standard deviation
constexpr std::size_t kTried = 50;    // rows on which a change of a channel is tried

// The readings of a session minus what the loads explain: one row per reading, one column per channel.
struct Unloaded {
    std::vector<double> t_h;
    std::vector<bool> rests;
    Eigen::MatrixXd channel;
};

// One gain for each label and channel, and one zero for each session and channel, by least squares. In the channels and not
// in the forces, because a fit with spare channels explains the drift of its own recording away.
std::vector<Unloaded> unloaded(const Calibration& calibration, const Rows& rows) {
    std::vector<std::size_t> components;
    for (const std::string& name : calibration.components) components.push_back(component_index(name));
    std::map<std::size_t, Rows> of_session;
    for (const auto* row : rows_with(rows, components))
        if (row->t_ns != 0) of_session[row->session].push_back(row);
    std::vector<Eigen::MatrixXd> label, channel;
    Eigen::Index n = 0;
    for (const auto& [session, all] : of_session) {
        label.push_back(labels_of(all, components));
        channel.push_back(channels_of(all));
        label.back().rowwise() -= Eigen::RowVectorXd(label.back().colwise().mean());
        channel.back().rowwise() -= Eigen::RowVectorXd(channel.back().colwise().mean());
        n += label.back().rows();
    }
    std::vector<Unloaded> result;
    if (n <= Eigen::Index(components.size() + of_session.size())) return result;
    Eigen::MatrixXd all_labels(n, label.front().cols()), all_channels(n, channel.front().cols());
    Eigen::Index at = 0;
    for (std::size_t s = 0; s < label.size(); at += label[s].rows(), ++s) {
        all_labels.middleRows(at, label[s].rows()) = label[s];
        all_channels.middleRows(at, label[s].rows()) = channel[s];
    }
    const Eigen::MatrixXd gain = dense::least_norm(all_labels, all_channels);
    std::size_t s = 0;
    for (const auto& [session, all] : of_session) {
        Unloaded& one = result.emplace_back();
        one.channel = channel[s] - label[s] * gain;
        for (const auto* row : all) {
            one.t_h.push_back(double(row->t_ns) * 1e-9 / kHour_s);
            one.rests.push_back(load_of(row->wrench_S, calibration) < LoadPeak::kRest);
        }
        ++s;
    }
    return result;
}

// Returns the slope of channel `k` over the time, in channel_unit per hour: 0 if it is not sure, nullopt if the session is
// too short for one. Rows at rest count alone, where they occur throughout.
std::optional<double> slope_of(const Unloaded& session, std::size_t k, bool at_rest) {
    const auto [first, last] = std::minmax_element(session.t_h.begin(), session.t_h.end());
    const double begin_h = *first, length_h = *last - *first;
    if (length_h < kShortest_s / kHour_s) return std::nullopt;
    std::array<double, kParts> n{}, t{}, e{};
    for (std::size_t i = 0; i < session.t_h.size() && length_h > 0; ++i) {
        if (at_rest && !session.rests[i]) continue;
        const double t_h = session.t_h[i] - begin_h;
        const std::size_t part = std::min(std::size_t(t_h / length_h * double(kParts)), kParts - 1);
        ++n[part];
        t[part] += t_h;
        e[part] += session.channel(Eigen::Index(i), Eigen::Index(k));
    }
    double parts = 0, t_mean = 0, e_mean = 0;
    for (std::size_t i = 0; i < kParts; ++i) {
        if (n[i] == 0) continue;
        t_mean += t[i] /= n[i];
        e_mean += e[i] /= n[i];
        ++parts;
    }
    if (parts < double(kFewestParts)) return at_rest ? slope_of(session, k, false) : std::nullopt;
    double tt = 0, te = 0, ee = 0;
    for (std::size_t i = 0; i < kParts; ++i) {
        if (n[i] == 0) continue;
        const double dt = t[i] - t_mean / parts, de = e[i] - e_mean / parts;
        tt += dt * dt;
        te += dt * de;
        ee += de * de;
    }
    const double slope = te / tt, error = std::sqrt(std::max(0.0, ee - te * slope) / (parts - 2) / tt);
    return std::abs(slope) > kSure * error ? slope : 0;
}

// Returns what these changes of the channels do to each component: the root of the sum of their squared effects, which are
// means over some of the rows.
std::vector<double> effect_of(const std::vector<std::vector<double>>& changes, const Calibration& calibration,
                              const Rows& rows) {
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
std::vector<double> moved_like(const std::vector<std::vector<double>>& sessions, const Calibration& calibration,
                               const Rows& rows) {
    if (sessions.empty()) return std::vector<double>(calibration.components.size());
    const double n = double(sessions.size());
    std::vector<double> together = effect_of(sessions, calibration, rows);
    std::vector<std::vector<double>> alone;
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

void set_zero_age(const Rows& rows, const SessionZeros& zeros, Calibration& calibration,
                  std::vector<std::string>& warnings) {
    std::vector<std::vector<double>> offsets;
    for (const std::vector<double>& offset : zeros.offset)
        if (!offset.empty()) offsets.push_back(offset);
    if (const auto n = double(offsets.size()); !zeros.sd.empty() && offsets.size() >= kSessions) {
        // a new session is as far from the mean of these
        calibration.zero_shift = moved_like(offsets, calibration, rows);
        for (double& each : calibration.zero_shift) each *= std::sqrt(n / (n - 1) * (1 + 1 / n));
    }
    if (calibration.sd.empty()) return;
    std::vector<std::vector<double>> drifts;  // one for each session in which it is sure
    for (const Unloaded& session : unloaded(calibration, rows)) {
        std::vector<double> drift;
        for (std::size_t k = 0; k < calibration.channels.size(); ++k)
            drift.push_back(slope_of(session, k, true).value_or(0));
        if (std::any_of(drift.begin(), drift.end(), [](double x) { return x != 0; })) drifts.push_back(std::move(drift));
    }
    const std::vector<double> seen = moved_like(drifts, calibration, rows);
    for (std::size_t i = 0; i < seen.size(); ++i) {
        if (!(seen[i] > calibration.sd[i])) continue;
        if (calibration.zero_rate_per_h.empty()) calibration.zero_rate_per_h = calibration.sd;
        calibration.zero_rate_per_h[i] = seen[i];
        const bool is_force = component_index(calibration.components[i]) < 3;
        warnings.push_back(
            fmt::format("{}: the zero drifted by {:.2g} {} per hour (zero_rate_per_h); the daemon's standard "
                        "deviation grows as fast: tare or unload the sensor often",
                        calibration.components[i], seen[i], is_force ? "N" : "Nm"));
    }
}

}  // namespace tactiled
