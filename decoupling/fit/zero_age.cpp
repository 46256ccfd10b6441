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

constexpr double kHour_s = 3600;
constexpr std::size_t kParts = 20;  // of a session: their means depend little on each other
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

// Returns the standard deviation of each component if each channel moves by its own, independently of the others.
std::vector<double> moved_by(const std::vector<double>& channel_sd, const Calibration& calibration, const Rows& rows) {
    const auto decoupler = make_decoupler(calibration);
    Wrench squares{};
    double tried = 0;
    for (std::size_t i = 0; i < rows.size(); i += 1 + rows.size() / kTried, ++tried) {
        const Wrench before = error_of(*decoupler, *rows[i]);
        for (std::size_t k = 0; k < channel_sd.size(); ++k) {
            LabelledRow moved = *rows[i];
            moved.channel[k] += channel_sd[k];
            const Wrench after = error_of(*decoupler, moved);
            for (std::size_t c = 0; c < after.size(); ++c) squares[c] += (after[c] - before[c]) * (after[c] - before[c]);
        }
    }
    std::vector<double> sd;
    for (const std::string& component : calibration.components)
        sd.push_back(std::sqrt(squares[component_index(component)] / tried));
    if (std::any_of(sd.begin(), sd.end(), [](double x) { return !std::isfinite(x); })) sd.clear();
    return sd;
}

}  // namespace

void set_zero_age(const Rows& rows, const SessionZeros& zeros, Calibration& calibration,
                  std::vector<std::string>& warnings) {
    const auto sessions = std::size_t(
        std::count_if(zeros.offset.begin(), zeros.offset.end(), [](const auto& offset) { return !offset.empty(); }));
    if (!zeros.sd.empty() && sessions >= kSessions) {
        std::vector<double> scatter = zeros.sd;  // of a new session around the mean of these
        for (double& each : scatter) each *= std::sqrt(1 + 1 / double(sessions));
        calibration.zero_shift = moved_by(scatter, calibration, rows);
    }
    if (calibration.sd.empty()) return;
    std::vector<double> drift(calibration.channels.size());
    const std::vector<Unloaded> of_session = unloaded(calibration, rows);
    for (std::size_t k = 0; k < drift.size(); ++k) {
        double squares = 0, n = 0;
        for (const Unloaded& session : of_session)
            if (const auto slope = slope_of(session, k, true)) squares += *slope * *slope, ++n;
        if (n > 0) drift[k] = std::sqrt(squares / n);
    }
    const std::vector<double> seen = moved_by(drift, calibration, rows);
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
