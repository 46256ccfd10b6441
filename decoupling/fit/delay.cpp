#include "decoupling/fit/delay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/domain.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

constexpr double kMost_s = 1;
constexpr int kMostShifts = 400, kSteps = 20;
constexpr std::size_t kCoarseRows = 5000, kLeastRows = 50, kParts = 10;
constexpr double kMoves = 0.3;     // of the rate that one row in a hundred exceeds; slower, a loop is half passed
constexpr double kOutlier_sd = 5;  // a spike says nothing of the delay
constexpr double kTold_sd = 3;

// A stretch of one session, in which the time goes on: what the calibration makes of its rows, and what was applied. In full
// scales; NaN where the one or the other is not there.
struct Stretch {
    std::vector<double> t_s;
    std::vector<Wrench> estimated, applied;
};

std::vector<Stretch> stretches_of(const Calibration& calibration, const Labelled& rows) {
    std::vector<std::size_t> columns;
    for (const auto& name : calibration.channels) {
        const auto at = std::find(rows.channels.begin(), rows.channels.end(), name);
        if (at == rows.channels.end())
            throw Undetermined(fmt::format("{} has no channel \"{}\", which the calibration needs", rows.name, name));
        columns.push_back(std::size_t(at - rows.channels.begin()));
    }
    Wrench full_scale = kUnseen;
    for (std::size_t i = 0; i < calibration.full_scale.size(); ++i)
        if (calibration.full_scale[i] > 0)
            full_scale[component_index(calibration.components[i])] = calibration.full_scale[i];
    Problems problems;
    Options none = Options::parse_text("", calibration.path, problems);
    const auto decoupler = make_decoupler(calibration, "", 0, none);
    problems.throw_if_any();

    std::vector<Stretch> all;
    std::vector<double> channel(columns.size());
    const LabelledRow* before = nullptr;
    for (const LabelledRow& row : rows.rows) {
        if (before == nullptr || row.session != before->session || row.t_ns <= before->t_ns) {
            all.emplace_back();
            decoupler->forget();
        }
        before = &row;
        Reading reading{.channel = channel, .missing = 0, .saturated = 0, .t_ns = row.t_ns};
        for (std::size_t k = 0; k < columns.size(); ++k) {
            channel[k] = row.channel[columns[k]];
            if (std::isnan(channel[k])) reading.missing |= 1u << k;
        }
        Wrench estimated = decoupler->decouple(reading).wrench_S, applied = row.wrench_S;
        for (std::size_t c = 0; c < applied.size(); ++c) {
            estimated[c] /= full_scale[c];
            applied[c] /= full_scale[c];
        }
        all.back().t_s.push_back(double(row.t_ns) * 1e-9);
        all.back().estimated.push_back(estimated);
        all.back().applied.push_back(applied);
    }
    return all;
}

// A component at a row, and what had been applied a delay before.
struct Pair {
    std::size_t component;
    double estimated, applied, rate_per_s;
};

// The rows in their order, every `every`th.
std::vector<Pair> pairs_at(const std::vector<Stretch>& stretches, double delay_s, std::size_t every = 1) {
    std::vector<Pair> pairs;
    for (const Stretch& stretch : stretches) {
        std::size_t after = 1;
        for (std::size_t i = 0; i < stretch.t_s.size(); i += every) {
            const double t_s = stretch.t_s[i] - delay_s;
            if (t_s < stretch.t_s.front() || t_s > stretch.t_s.back()) continue;
            while (after > 1 && stretch.t_s[after - 1] > t_s) --after;
            while (after < stretch.t_s.size() && stretch.t_s[after] < t_s) ++after;
            if (after == stretch.t_s.size()) break;
            const double step_s = stretch.t_s[after] - stretch.t_s[after - 1];
            for (std::size_t c = 0; c < kUnseen.size(); ++c) {
                const double from = stretch.applied[after - 1][c], to = stretch.applied[after][c];
                const double rate = (to - from) / step_s, applied = from + rate * (t_s - stretch.t_s[after - 1]);
                const double estimated = stretch.estimated[i][c];
                if (std::isfinite(applied) && std::isfinite(estimated)) pairs.push_back({c, estimated, applied, rate});
            }
        }
    }
    return pairs;
}

// What a straight line of each component leaves over, a pair.
double unexplained(const std::vector<Pair>& pairs) {
    double sum = 0;
    for (std::size_t c = 0; c < kUnseen.size(); ++c) {
        double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
        for (const Pair& p : pairs) {
            if (p.component != c) continue;
            ++n, x += p.applied, y += p.estimated, xx += p.applied * p.applied;
            xy += p.applied * p.estimated, yy += p.estimated * p.estimated;
        }
        if (n == 0) continue;
        const double sxx = xx - x * x / n, sxy = xy - x * y / n, syy = yy - y * y / n;
        sum += sxx > 0 ? syy - sxy * sxy / sxx : syy;
    }
    return pairs.empty() ? HUGE_VAL : sum / double(pairs.size());
}

// In steps of a row.
double nearest_shift(const std::vector<Stretch>& stretches) {
    std::vector<double> steps;
    std::size_t n = 0;
    for (const Stretch& s : stretches) {
        n += s.t_s.size();
        for (std::size_t i = 1; i < s.t_s.size(); ++i) steps.push_back(s.t_s[i] - s.t_s[i - 1]);
    }
    if (steps.empty()) throw Undetermined("has no two rows one after the other in time: it needs t_s");
    std::nth_element(steps.begin(), steps.begin() + std::ptrdiff_t(steps.size() / 2), steps.end());
    const double row_s = steps[steps.size() / 2];
    const int most = int(std::min(double(kMostShifts), kMost_s / row_s));
    const std::size_t every = std::max<std::size_t>(1, n / kCoarseRows);
    double best_s = 0, least = HUGE_VAL;
    for (int shift = -most / 10; shift <= most; ++shift) {
        const double left = unexplained(pairs_at(stretches, shift * row_s, every));
        if (left < least) least = left, best_s = shift * row_s;
    }
    return best_s;
}

// Those whose component changes.
std::vector<Pair> moving(std::vector<Pair> pairs) {
    std::array<double, 6> least{};
    for (std::size_t c = 0; c < least.size(); ++c) {
        std::vector<double> rates;
        for (const Pair& p : pairs)
            if (p.component == c) rates.push_back(std::abs(p.rate_per_s));
        if (rates.empty()) continue;
        const auto at = rates.begin() + std::ptrdiff_t(double(rates.size() - 1) * 0.99);
        std::nth_element(rates.begin(), at, rates.end());
        least[c] = kMoves * *at;
    }
    std::erase_if(pairs, [&](const Pair& p) { return !(std::abs(p.rate_per_s) > least[p.component]); });
    return pairs;
}

// How much later than `delay` they are, without the pairs `from` .. `to`.
double more_delay(const std::vector<Pair>& pairs, std::size_t from, std::size_t to) {
    constexpr Eigen::Index kOfComponent = 3;  // gain, width, zero
    std::array<Eigen::Index, 6> column;
    column.fill(-1);
    Eigen::Index columns = 1;
    for (const Pair& p : pairs)
        if (column[p.component] < 0) column[p.component] = std::exchange(columns, columns + kOfComponent);
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(Eigen::Index(pairs.size() - (to - from)), columns);
    Eigen::VectorXd y(a.rows());
    Eigen::Index row = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        if (i >= from && i < to) continue;
        const Pair& p = pairs[i];
        a(row, 0) = -p.rate_per_s;
        a.block(row, column[p.component], 1, kOfComponent) << p.applied, p.rate_per_s > 0 ? 1.0 : -1.0, 1.0;
        y(row++) = p.estimated - p.applied;
    }
    for (int pass = 0;; ++pass) {
        const LeastSquares solved = least_squares(a, y);
        if (!solved.dependent.empty())
            throw Undetermined("the force changes at one speed alone, where hysteresis looks like a delay: record several");
        if (pass == 1) return solved.coefficient(0);
        Eigen::VectorXd off = (y - a * solved.coefficient).cwiseAbs(), sorted = off;
        std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
        const double most = kOutlier_sd * 1.4826 * sorted(sorted.size() / 2);
        for (Eigen::Index i = 0; i < off.size(); ++i)
            if (off(i) > most) a.row(i).setZero(), y(i) = 0;
    }
}

}  // namespace

Delay measure_delay(const Calibration& calibration, const Labelled& rows) {
    const auto stretches = stretches_of(calibration, rows);
    Delay delay;
    delay.delay_s = nearest_shift(stretches);
    std::vector<Pair> pairs;
    for (int step = 0; step < kSteps; ++step) {
        pairs = moving(pairs_at(stretches, delay.delay_s));
        if (pairs.size() < kLeastRows)
            throw Undetermined(fmt::format("{} tells no delay: the force changes in {} rows, {} are needed", rows.name,
                                           pairs.size(), kLeastRows));
        const double more_s = more_delay(pairs, 0, 0);
        delay.delay_s += more_s;
        if (std::abs(more_s) < 1e-8) break;
    }
    delay.rows = pairs.size();
    double sum = 0, squares = 0;
    for (std::size_t part = 0; part < kParts; ++part) {
        const double more_s = more_delay(pairs, part * pairs.size() / kParts, (part + 1) * pairs.size() / kParts);
        sum += more_s, squares += more_s * more_s;
    }
    constexpr double n = kParts;
    delay.sd_s = std::sqrt((n - 1) / n * std::max(0.0, squares - sum * sum / n));
    if (delay.delay_s < -kTold_sd * delay.sd_s)
        throw Undetermined(
            fmt::format("{}: the labels are {:.3g} ms later than the readings: the reference's filter, or another "
                        "clock",
                        rows.name, -delay.delay_s * 1e3));
    if (!(delay.delay_s < kMost_s))
        throw Undetermined(fmt::format("{}: no delay within {} s explains it", rows.name, kMost_s));
    if (delay.delay_s < kTold_sd * delay.sd_s) delay.delay_s = 0;
    return delay;
}

}  // namespace tactiled
