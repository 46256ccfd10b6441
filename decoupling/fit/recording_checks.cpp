#include "decoupling/fit/recording_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "decoupling/fit/labels.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

// A mark for a missing value, such as -999: at least two rows have exactly this value, and its distance from all others
// exceeds their range, which has many different values.
constexpr std::size_t kDifferent = 20;
constexpr double kFollows = 0.5;                       // relative to the range of the other rows' labels
constexpr double kCutOff = 0.01, kCutOffTimes = 3;     // share of the rows at the end; times the next most frequent value
constexpr double kUnderLoad = 0.2;                     // relative to full scale
constexpr double kMoves = 0.5;                         // sd of the channels in rows with labels of 0 over that of all rows
constexpr Eigen::Index kMaxLag = 10;                   // rows
constexpr Eigen::Index kMaxRows = 30'000;              // rows from the start that show a lag
constexpr double kLagGains = 0.6, kLagMatters = 0.01;  // error with over without; relative to full scale
constexpr std::size_t kManyRows = 100;                 // more rows are not applied by hand
constexpr double kFarApart_s = 5;                      // rows of an instrument are not so far apart

double spread(const std::vector<double>& values) {
    double sum = 0, squares = 0;
    for (const double value : values) sum += value / double(values.size());
    for (const double value : values) squares += (value - sum) * (value - sum) / double(values.size());
    return std::sqrt(squares);
}

// Returns the labels' extent among some rows, relative to full scale; the greatest component counts.
double extent(const Rows& rows, const Wrench& full_scale) {
    double result = 0;
    for (std::size_t c = 0; c < full_scale.size(); ++c) {
        double min = std::numeric_limits<double>::infinity(), max = -min;
        for (const auto* row : rows) {
            if (std::isnan(row->wrench_S[c])) continue;
            min = std::min(min, row->wrench_S[c]);
            max = std::max(max, row->wrench_S[c]);
        }
        if (max > min && full_scale[c] > 0) result = std::max(result, (max - min) / full_scale[c]);
    }
    return result;
}

// Returns true if in each row with this value of a channel a label is far from those of all other rows, so that the load
// explains the readings.
bool labels_follow(const Rows& rows, std::size_t k, double value) {
    Wrench min, max;
    min.fill(std::numeric_limits<double>::infinity());
    max.fill(-std::numeric_limits<double>::infinity());
    for (const auto* row : rows) {
        if (row->channel[k] == value) continue;
        for (std::size_t c = 0; c < 6; ++c) {
            min[c] = std::fmin(min[c], row->wrench_S[c]);
            max[c] = std::fmax(max[c], row->wrench_S[c]);
        }
    }
    return std::all_of(rows.begin(), rows.end(), [&](const LabelledRow* row) {
        bool follows = row->channel[k] != value;
        for (std::size_t c = 0; c < 6; ++c)
            follows =
                follows || std::max(row->wrench_S[c] - max[c], min[c] - row->wrench_S[c]) > kFollows * (max[c] - min[c]);
        return follows;
    });
}

void check_channel(const Labelled& labelled, const Rows& rows, std::size_t k, std::vector<std::string>& warnings) {
    const std::string& name = labelled.channels[k];
    bool rises = true;
    std::vector<double> values;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        values.push_back(rows[i]->channel[k]);
        rises = rises && (i == 0 || rows[i]->channel[k] > rows[i - 1]->channel[k]);
    }
    std::sort(values.begin(), values.end());
    std::vector<std::pair<double, std::size_t>> count;  // sorted values with their counts
    for (const double value : values) {
        if (count.empty() || count.back().first != value) count.emplace_back(value, 0);
        ++count.back().second;
    }
    if (rises)
        warnings.push_back(
            fmt::format("channel {} rises in every row: is it a time or a row number? Choose with --channels", name));
    if (count.size() < kDifferent) return;
    const Wrench full_scale = full_scales(rows);
    const auto rows_at = [&](double value) {
        Rows result;
        for (const auto* row : rows)
            if (row->channel[k] == value) result.push_back(row);
        return result;
    };
    for (const bool at_top : {false, true}) {
        const auto end = at_top ? std::prev(count.end()) : count.begin();
        const auto next = at_top ? std::prev(end) : std::next(end);
        const auto other = at_top ? count.begin() : std::prev(count.end());
        const double gap = std::abs(end->first - next->first), width = std::abs(other->first - next->first);
        if (end->second >= 2 && gap > width && !labels_follow(rows, k, end->first)) {
            const Rows there = rows_at(end->first);
            throw Undetermined(fmt::format(
                "{}:{}: channel {} is {:.5g} there and in {} other rows, elsewhere {:.5g} to {:.5g}: a mark for a missing "
                "value? "
                "Leave such cells empty, or leave these rows out with --saturates-{} {:.5g}",
                labelled.name, there.front()->line, name, end->first, end->second - 1, std::min(next->first, other->first),
                std::max(next->first, other->first), at_top ? "above" : "below", end->first));
        }
        std::size_t most = 0;
        for (auto at = std::next(count.begin()); at != std::prev(count.end()); ++at) most = std::max(most, at->second);
        if (double(end->second) < std::max(10.0, kCutOff * double(rows.size())) ||
            double(end->second) < kCutOffTimes * double(most) || extent(rows_at(end->first), full_scale) < kUnderLoad)
            continue;
        warnings.push_back(fmt::format(
            "channel {} is exactly {:.5g}, its {} value, in {} rows with different loads: is it at its saturation "
            "limit? --saturates-{} {:.5g} leaves these rows out",
            name, end->first, at_top ? "greatest" : "least", end->second, at_top ? "above" : "below", end->first));
    }
}

// Warns of labels of exactly 0 in rows without a reference reading.
void check_zeros(const Rows& rows, std::vector<std::string>& warnings) {
    Rows zero;
    for (const auto* row : rows)
        if (std::all_of(row->wrench_S.begin(), row->wrench_S.end(), [](double v) { return std::isnan(v) || v == 0; }))
            zero.push_back(row);
    if (zero.size() < kFewestRows || zero.size() == rows.size()) return;
    std::size_t moving = 0;
    const std::size_t n = rows.front()->channel.size();
    for (std::size_t k = 0; k < n; ++k) {
        std::vector<double> all, at_zero;
        for (const auto* row : rows) all.push_back(row->channel[k]);
        for (const auto* row : zero) at_zero.push_back(row->channel[k]);
        moving += spread(at_zero) > kMoves * spread(all) ? 1 : 0;
    }
    if (2 * moving <= n) return;
    warnings.push_back(fmt::format(
        "all labels are exactly 0 in {} rows (first: line {}) in which {} of {} channels move as under load: leave a "
        "label empty where there was no reading",
        zero.size(), zero.front()->line, moving, n));
}

// Warns of labels that are late or early: a straight line through the channels some rows away fits far better.
void check_lag(const Rows& rows, std::vector<std::string>& warnings) {
    const auto n = std::min(kMaxRows, Eigen::Index(rows.size())), m = Eigen::Index(rows.front()->channel.size()) + 1;
    const Wrench full_scale = full_scales(rows);
    if (n < 10 * (m + 2 * kMaxLag)) return;
    Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(m), width = Eigen::RowVectorXd::Ones(m);
    Eigen::MatrixXd x(n, m);
    for (Eigen::Index i = 0; i < n; ++i)
        x.row(i) << Eigen::Map<const Eigen::RowVectorXd>(rows[std::size_t(i)]->channel.data(), m - 1), 1;
    mean.head(m - 1) = x.leftCols(m - 1).colwise().mean();
    x.rowwise() -= mean;
    width.head(m - 1) = (x.leftCols(m - 1).colwise().squaredNorm() / double(n)).cwiseSqrt().cwiseMax(1e-300);
    x.array().rowwise() /= width.array();
    for (std::size_t c = 0; c < 6; ++c) {
        double none = 0, min = std::numeric_limits<double>::infinity();
        Eigen::Index best = 0;
        for (Eigen::Index lag = -kMaxLag; full_scale[c] > 0 && lag <= kMaxLag; ++lag) {
            Eigen::MatrixXd gram = 1e-9 * double(n) * Eigen::MatrixXd::Identity(m, m);
            Eigen::VectorXd xy = Eigen::VectorXd::Zero(m);
            double yy = 0, count = 0;
            for (Eigen::Index i = kMaxLag; i < n - kMaxLag; ++i) {
                const double y = rows[std::size_t(i)]->wrench_S[c];
                if (std::isnan(y) || rows[std::size_t(i)]->session != rows[std::size_t(i - lag)]->session) continue;
                gram.selfadjointView<Eigen::Lower>().rankUpdate(x.row(i - lag).transpose());
                xy += y * x.row(i - lag).transpose();
                yy += y * y;
                ++count;
            }
            if (count < 3 * double(m)) continue;
            const double error = std::sqrt(std::max(0.0, yy - xy.dot(dense::solve_by_ldlt(gram, xy).col(0))) / count);
            if (lag == 0) none = error;
            if (error < min) min = error, best = lag;
        }
        if (best == 0 || !(min < kLagGains * none) || !(none > kLagMatters * full_scale[c])) continue;
        warnings.push_back(fmt::format(
            "{} fits the channels of {} rows {} far better (straight line: {:.2g} instead of {:.2g} % of full scale): "
            "{} by about this time?",
            label_column(c), std::abs(best), best > 0 ? "earlier" : "later", 100 * min / full_scale[c],
            100 * none / full_scale[c], best > 0 ? "is the reference late" : "are the channels late"));
        return;
    }
}

// Warns of times that go backwards in a session, and of times in milliseconds.
void check_times(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    std::map<std::size_t, std::uint64_t> latest_ns;  // by session
    const LabelledRow* first = nullptr;
    std::size_t backwards = 0;
    for (const auto* row : rows) {
        if (row->t_ns == 0) continue;
        std::uint64_t& before_ns = latest_ns[row->session];
        if (row->t_ns < before_ns && backwards++ == 0) first = row;
        before_ns = row->t_ns;
    }
    if (first != nullptr) {
        warnings.push_back(fmt::format(
            "t_s goes backwards at {}:{}{}: if the rows of one recording are not in the order of time, sort them "
            "by t_s; if another recording begins there, name both in a column \"session\"",
            labelled.name, first->line, backwards > 1 ? fmt::format(" and in {} rows after that", backwards - 1) : ""));
        return;  // intervals of rows out of order do not show the unit
    }
    std::vector<double> interval_s;
    for (std::size_t i = 1; i < rows.size(); ++i)
        if (rows[i - 1]->t_ns > 0 && rows[i]->t_ns > rows[i - 1]->t_ns)
            interval_s.push_back(double(rows[i]->t_ns - rows[i - 1]->t_ns) * 1e-9);
    if (interval_s.size() < kManyRows) return;
    const double median_s = median(std::move(interval_s));
    if (median_s < kFarApart_s) return;
    warnings.push_back(
        fmt::format("the rows are {:.3g} s apart by t_s, which is in seconds: are these times in milliseconds?", median_s));
}

// A recording in which a load is never reduced, except to 0, cannot show hysteresis.
void check_unloading(const Rows& rows, std::vector<std::string>& warnings) {
    const Wrench full_scale = full_scales(rows);
    const auto load_of_row = [&](const LabelledRow& row) {
        double load = 0;
        for (std::size_t c = 0; c < 6; ++c)
            if (full_scale[c] > 0 && std::isfinite(row.wrench_S[c]))
                load = std::max(load, std::abs(row.wrench_S[c]) / full_scale[c]);
        return load;
    };
    double peak = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (i > 0 && rows[i]->session != rows[i - 1]->session) peak = 0;
        const double load = load_of_row(*rows[i]);
        if (load < 0.02) peak = 0;
        if (load < peak - 0.1) return;
        peak = std::max(peak, load);
    }
    warnings.emplace_back(
        "every load is applied upwards from nothing: hysteresis is not in the error; record loads downwards, too");
}

}  // namespace

void check_recording(const Labelled& labelled, const Rows& rows, std::vector<std::string>& warnings) {
    if (rows.size() < kFewestRows) return;
    for (std::size_t k = 0; k < labelled.channels.size(); ++k) check_channel(labelled, rows, k, warnings);
    check_zeros(rows, warnings);
    check_sessions(labelled, rows, warnings);
    check_lag(rows, warnings);
    check_times(labelled, rows, warnings);
    check_unloading(rows, warnings);
}

}  // namespace tactiled
