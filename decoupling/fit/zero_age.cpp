#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "decoupling/fit/recording_checks.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr double kHour_s = 3600;
constexpr std::size_t kParts = 20;  // of a session: their means depend little on each other
constexpr std::size_t kFewestParts = 10;
constexpr double kSure = 4;             // standard errors of a slope: once in 1000 by chance
constexpr std::size_t kSessions = 5;    // fewer do not show a standard deviation
constexpr std::size_t kOfSession = 50;  // rows for the scatter of the zeros

// The errors of a calibration on the rows of one session.
struct Point {
    double t_h;
    bool rests;
    Wrench error;
};
using Sessions = std::map<std::size_t, std::vector<Point>>;

Sessions errors_of(const Calibration& calibration, const Rows& rows) {
    const auto decoupler = make_decoupler(calibration);
    Sessions sessions;
    for (const auto* row : rows)
        if (row->t_ns != 0)
            sessions[row->session].push_back({double(row->t_ns) * 1e-9 / kHour_s,
                                              load_of(row->wrench_S, calibration) < LoadPeak::kRest,
                                              error_of(*decoupler, *row)});
    return sessions;
}

// Returns the slope of component `c` over the time, in N or Nm per hour: 0 if it is not sure, nullopt if the session is too
// short for one. Rows at rest count alone, where they occur throughout.
std::optional<double> slope_of(const std::vector<Point>& points, std::size_t c, bool at_rest) {
    const auto [first, last] =
        std::minmax_element(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.t_h < b.t_h; });
    std::array<double, kParts> n{}, t{}, e{};
    for (const Point& point : points) {
        if ((at_rest && !point.rests) || !std::isfinite(point.error[c])) continue;
        const double place = (point.t_h - first->t_h) / (last->t_h - first->t_h) * double(kParts);
        const std::size_t part = std::min(std::size_t(place), kParts - 1);
        ++n[part];
        t[part] += point.t_h - first->t_h;
        e[part] += point.error[c];
    }
    double parts = 0, t_mean = 0, e_mean = 0;
    for (std::size_t i = 0; i < kParts; ++i) {
        if (n[i] == 0) continue;
        t_mean += t[i] /= n[i];
        e_mean += e[i] /= n[i];
        ++parts;
    }
    if (parts < double(kFewestParts)) return at_rest ? slope_of(points, c, false) : std::nullopt;
    double tt = 0, te = 0, ee = 0;
    for (std::size_t i = 0; i < kParts; ++i) {
        if (n[i] == 0) continue;
        const double dt = t[i] - t_mean / parts, de = e[i] - e_mean / parts;
        tt += dt * dt;
        te += dt * de;
        ee += de * de;
    }
    if (!(tt > 0)) return std::nullopt;
    const double slope = te / tt, error = std::sqrt(std::max(0.0, ee - te * slope) / (parts - 2) / tt);
    return std::abs(slope) > kSure * error ? slope : 0;
}

// Returns the standard deviation of each component that the scatter of the sessions' zeros causes, of a new session.
std::vector<double> shift_of(const Calibration& calibration, const Rows& rows, const SessionZeros& zeros) {
    std::map<std::size_t, Rows> of_session;
    for (const auto* row : rows)
        if (row->session < zeros.offset.size() && !zeros.offset[row->session].empty())
            of_session[row->session].push_back(row);
    if (zeros.sd.empty() || of_session.size() < kSessions) return {};
    const auto decoupler = make_decoupler(calibration);
    Wrench squares{};
    for (const auto& [session, all] : of_session) {
        Wrench sum{};
        double n = 0;
        for (std::size_t i = 0; i < all.size(); i += 1 + all.size() / kOfSession, ++n) {
            LabelledRow shifted = *all[i];
            for (std::size_t k = 0; k < shifted.channel.size(); ++k) shifted.channel[k] += zeros.offset[session][k];
            const Wrench with = error_of(*decoupler, shifted), without = error_of(*decoupler, *all[i]);
            for (std::size_t c = 0; c < sum.size(); ++c) sum[c] += with[c] - without[c];
        }
        for (std::size_t c = 0; c < sum.size(); ++c) squares[c] += sum[c] * sum[c] / (n * n);
    }
    const auto n = double(of_session.size());
    std::vector<double> shift;
    for (const std::string& component : calibration.components)
        shift.push_back(std::sqrt(squares[component_index(component)] / (n - 1) * (1 + 1 / n)));
    if (std::any_of(shift.begin(), shift.end(), [](double x) { return !std::isfinite(x); })) shift.clear();
    return shift;
}

}  // namespace

void set_zero_age(const Rows& rows, const SessionZeros& zeros, Calibration& calibration,
                  std::vector<std::string>& warnings) {
    calibration.zero_shift = shift_of(calibration, rows, zeros);
    if (calibration.sd.empty()) return;
    std::vector<double> rate = calibration.sd;
    const Sessions sessions = errors_of(calibration, rows);
    for (std::size_t i = 0; i < rate.size(); ++i) {
        double squares = 0, n = 0;
        for (const auto& [session, points] : sessions)
            if (const auto slope = slope_of(points, component_index(calibration.components[i]), true)) {
                squares += *slope * *slope;
                ++n;
            }
        const double seen = n > 0 ? std::sqrt(squares / n) : 0;
        if (!(seen > rate[i])) continue;
        rate[i] = seen;
        calibration.zero_rate_per_h = rate;
        const bool is_force = component_index(calibration.components[i]) < 3;
        warnings.push_back(
            fmt::format("{}: the zero drifted by {:.2g} {} per hour (zero_rate_per_h); the daemon's standard "
                        "deviation grows as fast: tare or unload the sensor often",
                        calibration.components[i], seen, is_force ? "N" : "Nm"));
    }
    if (!calibration.zero_rate_per_h.empty()) calibration.zero_rate_per_h = rate;
}

}  // namespace tactiled
