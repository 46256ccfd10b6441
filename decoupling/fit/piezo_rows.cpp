// The contents of a recording of model "piezo": runs of rows in time, and the press in the windows of Cn's converter.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/piezo_fit.hpp"
#include "decoupling/piezo/charge.hpp"

namespace tactiled {
namespace {

// In units of the usual step: within a longer step the press cannot be assumed linear.
constexpr double kLongestStep = 5;
constexpr std::size_t kMinRun = 8;  // rows; fewer determine only the film's state at their start

}  // namespace

std::vector<PiezoRun> piezo_runs(const Rows& rows, std::size_t Vp, std::size_t Cn) {
    std::vector<double> steps_s;
    const auto step_s = [&](std::size_t i) { return double(std::int64_t(rows[i]->t_ns - rows[i - 1]->t_ns)) * 1e-9; };
    for (std::size_t i = 1; i < rows.size(); ++i)
        if (rows[i]->session == rows[i - 1]->session && step_s(i) > 0) steps_s.push_back(step_s(i));
    if (steps_s.size() < kMinRun)
        throw Undetermined("the rows have no time: a column t_s (seconds, rising, a row a frame) is needed");
    const double longest_s = kLongestStep * median(steps_s);
    std::vector<PiezoRun> runs;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const bool follows = i > 0 && rows[i]->session == rows[i - 1]->session && step_s(i) >= 0 && step_s(i) <= longest_s;
        if (!follows) {
            if (!runs.empty() && runs.back().t_s.size() < kMinRun) runs.pop_back();
            runs.emplace_back();
        }
        PiezoRun& run = runs.back();
        run.t_s.push_back(follows ? run.t_s.back() + step_s(i) : 0);
        run.press_N.push_back(0.0 - rows[i]->wrench_S[2]);
        run.Vp.push_back(rows[i]->channel[Vp]);
        run.Cn.push_back(rows[i]->channel[Cn]);
    }
    if (runs.back().t_s.size() < kMinRun) runs.pop_back();
    if (runs.empty())
        throw Undetermined(
            fmt::format("no {} rows follow each other in time without a gap: leave the rows in the order "
                        "in which they were recorded, a row a frame",
                        kMinRun));
    return runs;
}

FilmResponse film_response(std::span<const double> t_s, std::span<const double> q, double tau_s) {
    FilmResponse response{std::vector<double>(q.size()), std::vector<double>(q.size())};
    double last_T_s = 0;
    LeakStep step(0, tau_s);
    for (std::size_t i = 1; i < q.size(); ++i) {
        const double T_s = t_s[i] - t_s[i - 1];
        if (T_s != last_T_s) step = LeakStep(T_s, tau_s);
        last_T_s = T_s;
        const double last = response.v[i - 1], change = q[i] - q[i - 1];
        response.v[i] = step.voltage(last, change);
        // x = T/tau, decay = exp(-x), gain = (1 - exp(-x)) / x, dx/dlog tau = -x
        response.dv_dlog_tau[i] = step.decay * (response.dv_dlog_tau[i - 1] + std::max(T_s, 0.0) / tau_s * last) +
                                  (step.gain - step.decay) * change;
    }
    return response;
}

double conversion_interval_s(const std::vector<PiezoRun>& runs) {
    std::vector<double> intervals_s;
    for (const PiezoRun& run : runs) {
        std::size_t last = 0;  // row of the last new value; the first row's value may be old
        for (std::size_t i = 1; i < run.Cn.size(); ++i) {
            if (run.Cn[i] == run.Cn[i - 1]) continue;
            if (last > 0 && run.t_s[i] > run.t_s[last]) intervals_s.push_back(run.t_s[i] - run.t_s[last]);
            last = i;
        }
    }
    if (intervals_s.size() < kMinRun) throw Undetermined("Cn hardly changes: is it connected?");
    // A new value may equal the last one by chance, so long intervals carry little information.
    const auto quarter = intervals_s.begin() + std::ptrdiff_t(intervals_s.size() / 4);
    std::nth_element(intervals_s.begin(), quarter, intervals_s.end());
    const double limit_s = 1.5 * *quarter;
    double sum_s = 0;
    std::size_t n = 0;
    for (const double interval_s : intervals_s)
        if (interval_s <= limit_s) sum_s += interval_s, ++n;
    return sum_s / double(n);
}

double row_interval_s(const std::vector<PiezoRun>& runs) {
    double length_s = 0;
    std::size_t rows = 0;
    for (const PiezoRun& run : runs) {
        length_s += run.t_s.back() - run.t_s.front();
        rows += run.t_s.size() - 1;
    }
    return length_s / double(std::max<std::size_t>(rows, 1));
}

std::vector<CentreReading> centre_readings(const std::vector<PiezoRun>& runs, double window_s) {
    std::vector<CentreReading> readings;
    for (const PiezoRun& run : runs) {
        for (std::size_t i = 1; i < run.t_s.size(); ++i) {
            const double begin_s = run.t_s[i] - window_s;
            if (run.Cn[i] == run.Cn[i - 1] || begin_s < run.t_s.front()) continue;
            // The press is linear between rows; its square then has the mean (a^2 + a b + b^2) / 3.
            double area = 0, square = 0, width_s = 0;
            for (std::size_t j = i; j > 0 && run.t_s[j] > begin_s; --j) {
                const double T_s = run.t_s[j] - run.t_s[j - 1];
                if (!(T_s > 0)) continue;
                const double part_s = std::min(T_s, run.t_s[j] - begin_s), b = run.press_N[j];
                const double a = std::lerp(b, run.press_N[j - 1], part_s / T_s);
                area += part_s * (a + b) / 2;
                square += part_s * (a * a + a * b + b * b) / 3;
                width_s += part_s;
            }
            if (width_s > 0) readings.push_back({area / width_s, square / width_s, run.Cn[i]});
        }
    }
    return readings;
}

}  // namespace tactiled
