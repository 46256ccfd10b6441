#include "decoupling/fit/align_search.hpp"

#include <cmath>
#include <optional>

#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMaxOffsets = 20'000;
constexpr double kGap = 5;  // median intervals of the labels without one
// Channels that explain more leave less than the rounding of the labels, 1e-6 of their norm.
constexpr double kMinRest = 1e-12;

// Subtracts the mean of each session from the rows that are there; sets the others to 0.
void centre(Eigen::MatrixXd& values, const std::vector<std::size_t>& session, const std::vector<char>& is_there) {
    const std::size_t sessions = session.empty() ? 0 : 1 + *std::max_element(session.begin(), session.end());
    Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(Eigen::Index(sessions), values.cols());
    Eigen::VectorXd n = Eigen::VectorXd::Zero(Eigen::Index(sessions));
    for (std::size_t i = 0; i < session.size(); ++i)
        if (is_there[i]) mean.row(Eigen::Index(session[i])) += values.row(Eigen::Index(i)), ++n[Eigen::Index(session[i])];
    for (std::size_t i = 0; i < session.size(); ++i) {
        const auto s = Eigen::Index(session[i]);
        if (is_there[i])
            values.row(Eigen::Index(i)) -= mean.row(s) / n[s];
        else
            values.row(Eigen::Index(i)).setZero();
    }
}

// Returns the part of the labels' variance that is in `residual`, of the forces or of the moments, whichever is smaller. An
// axis without a load has noise only: it counts by its size, and not as a label that the channels do not explain. `weight`:
// 1 / |residual|^2 of these labels, 0 for the others.
double unexplained(const LabelSeries& series, const Eigen::RowVectorXd& residual, const Eigen::RowVectorXd& total,
                   Eigen::RowVectorXd* weight = nullptr) {
    double smallest = 1;
    for (const bool is_moment : {false, true}) {
        Eigen::RowVectorXd chosen(total.size());
        for (Eigen::Index c = 0; c < total.size(); ++c) chosen[c] = (series.component[std::size_t(c)] >= 3) == is_moment;
        const double all = chosen.dot(total);
        const double rest = all > 0 ? std::max(chosen.dot(residual) / all, kMinRest) : 1;
        if (rest >= smallest) continue;
        smallest = rest;
        if (weight != nullptr) *weight = chosen / (rest * all);
    }
    return smallest;
}

bool is_enough(std::size_t rows, Eigen::Index channels) { return rows >= 3 * std::size_t(channels) + 3; }

// The channels without a mean and orthogonal to each other, in the rows that have labels at an offset. These rows are the
// same at most offsets, so that the last result serves the next one.
class OverlapBasis {
public:
    explicit OverlapBasis(const TimedReadings& readings) : readings_(readings) {}

    // Returns the squared norm of the part of each label that the channels explain; nothing if the rows are too few.
    std::optional<Eigen::RowVectorXd> explained(const Eigen::MatrixXd& label, const std::vector<char>& is_there) {
        if (is_there != is_there_) set(is_there);
        if (!is_enough_) return std::nullopt;
        return (basis_.transpose() * label).colwise().squaredNorm();
    }

private:
    void set(const std::vector<char>& is_there) {
        is_there_ = is_there;
        Eigen::MatrixXd channel = readings_.channel;
        is_enough_ = is_enough(std::size_t(std::count(is_there.begin(), is_there.end(), 1)), channel.cols());
        if (!is_enough_) return;
        centre(channel, readings_.session, is_there);
        for (Eigen::Index k = 0; k < channel.cols(); ++k)
            if (const double norm = channel.col(k).norm(); norm > 0) channel.col(k) /= norm;
        const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(channel);
        basis_ = qr.householderQ() * Eigen::MatrixXd::Identity(channel.rows(), std::min(channel.rows(), qr.rank()));
    }

    const TimedReadings& readings_;
    std::vector<char> is_there_;
    bool is_enough_ = false;
    Eigen::MatrixXd basis_;
};

}  // namespace

double median_step(const std::vector<double>& t) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < t.size(); ++i)
        if (t[i] > t[i - 1]) steps.push_back(t[i] - t[i - 1]);
    return median(steps);
}

LabelSeries::LabelSeries(const LabelledTable& labels, std::int64_t origin_ns) {
    for (std::size_t k = 0; k < labels.columns.size(); ++k)
        if (labels.columns[k].kind == ColumnKind::label && labels.columns[k].is_used) {
            column_.push_back(k);
            component.push_back(labels.columns[k].component);
        }
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < labels.rows(); ++i) {
        const bool is_whole =
            std::all_of(column_.begin(), column_.end(), [&](std::size_t k) { return std::isfinite(labels.values[k][i]); });
        if (labels.t_ns[i] && is_whole) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return *labels.t_ns[a] < *labels.t_ns[b]; });
    value_.resize(Eigen::Index(order.size()), Eigen::Index(column_.size()));
    for (std::size_t i = 0; i < order.size(); ++i) {
        t_s.push_back(double(*labels.t_ns[order[i]] - origin_ns) * 1e-9);
        for (std::size_t c = 0; c < column_.size(); ++c)
            value_(Eigen::Index(i), Eigen::Index(c)) = labels.values[column_[c]][order[i]];
    }
    longest_s_ = kGap * median_step(t_s);
}

TimedReadings::TimedReadings(const LabelledTable& table, const Labelled& labelled, std::int64_t origin_ns, std::size_t max) {
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < table.rows(); ++i)
        if (table.t_ns[i] && std::all_of(labelled.rows[i].channel.begin(), labelled.rows[i].channel.end(),
                                         [](double x) { return std::isfinite(x); }))
            rows.push_back(i);
    const std::size_t n = std::min(rows.size(), max);
    channel.resize(Eigen::Index(n), Eigen::Index(labelled.channels.size()));
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t row = rows[i * rows.size() / n];
        t_s.push_back(double(*table.t_ns[row] - origin_ns) * 1e-9);
        session.push_back(labelled.rows[row].session);
        for (std::size_t k = 0; k < labelled.channels.size(); ++k)
            channel(Eigen::Index(i), Eigen::Index(k)) = labelled.rows[row].channel[k];
    }
}

OffsetFit fit_at(const TimedReadings& readings, const LabelSeries& series, double offset_s) {
    OffsetFit fitted;
    fitted.label.resize(readings.channel.rows(), series.components());
    fitted.is_there.assign(readings.t_s.size(), 0);
    for (std::size_t i = 0; i < readings.t_s.size(); ++i) {
        fitted.is_there[i] = series.at(readings.t_s[i] + offset_s, fitted.label.row(Eigen::Index(i))) ? 1 : 0;
        fitted.rows += fitted.is_there[i] ? 1 : 0;
    }
    Eigen::MatrixXd channel = readings.channel;
    centre(fitted.label, readings.session, fitted.is_there);
    centre(channel, readings.session, fitted.is_there);
    if (!is_enough(fitted.rows, channel.cols())) return fitted;
    fitted.coefficients = channel.colPivHouseholderQr().solve(fitted.label);
    fitted.residual = fitted.label - channel * fitted.coefficients;
    fitted.rest =
        unexplained(series, fitted.residual.colwise().squaredNorm(), fitted.label.colwise().squaredNorm(), &fitted.weight);
    return fitted;
}

OffsetGrid coarse_search(const TimedReadings& readings, const LabelSeries& series) {
    OffsetGrid coarse;
    const double length_s = readings.t_s.back() - readings.t_s.front(), labels_s = series.t_s.back() - series.t_s.front();
    const double overlap_s = kMinOverlap * std::min(length_s, labels_s);
    coarse.first_s = series.t_s.front() - readings.t_s.back() + overlap_s;
    const double last_s = series.t_s.back() - readings.t_s.front() - overlap_s;
    coarse.step_s = std::max(median_step(series.t_s), (last_s - coarse.first_s) / double(kMaxOffsets));
    OverlapBasis basis(readings);
    Eigen::MatrixXd label(readings.channel.rows(), series.components());
    std::vector<char> is_there(readings.t_s.size());
    for (double offset_s = coarse.first_s; offset_s <= last_s; offset_s += coarse.step_s) {
        std::size_t n = 0;
        for (std::size_t i = 0; i < readings.t_s.size(); ++i) {
            is_there[i] = series.at(readings.t_s[i] + offset_s, label.row(Eigen::Index(i))) ? 1 : 0;
            n += is_there[i] ? 1 : 0;
        }
        centre(label, readings.session, is_there);
        const Eigen::RowVectorXd total = label.colwise().squaredNorm();
        const auto explained = basis.explained(label, is_there);
        const double rest = explained ? unexplained(series, (total - *explained).cwiseMax(0), total) : 1;
        coarse.rest.push_back(std::pow(rest, double(n) / double(readings.t_s.size())));
    }
    return coarse;
}

OffsetPeak peak_of(const OffsetGrid& coarse, double length_s) {
    const std::size_t best = coarse.best();
    const double half = (coarse.rest[best] + median(coarse.rest)) / 2;
    std::size_t begin = best, end = best;
    while (begin > 0 && coarse.rest[begin] < half) --begin;
    while (end + 1 < coarse.rest.size() && coarse.rest[end] < half) ++end;
    const std::size_t width = std::max<std::size_t>(1, end - begin);
    OffsetPeak peak;
    peak.typical_rest = median(coarse.rest);
    peak.pieces = std::max(1.0, length_s / (double(width) * coarse.step_s));
    for (std::size_t i = 0; i < coarse.rest.size(); ++i)
        if ((i + width < begin || i > end + width) && coarse.rest[i] < peak.other_rest)
            peak.other_rest = coarse.rest[i], peak.other_s = coarse.offset_s(i);
    return peak;
}

std::vector<double> offsets_of_parts(const TimedReadings& readings, const LabelSeries& series, const OffsetFit& all,
                                     double offset_s, double width_s) {
    std::vector<double> result;
    const std::size_t n = readings.t_s.size();
    Eigen::MatrixXd channel = readings.channel;
    centre(channel, readings.session, all.is_there);
    const Eigen::MatrixXd predicted = channel * all.coefficients;
    for (std::size_t part = 0; part < kParts; ++part) {
        const std::size_t begin = part * n / kParts, end = (part + 1) * n / kParts;
        const auto error = [&](double d) {
            Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(series.components()), label = sum, mean = sum;
            std::vector<Eigen::RowVectorXd> rest;
            for (std::size_t i = begin; i < end; ++i)
                if (all.is_there[i] && series.at(readings.t_s[i] + d, label)) {
                    rest.emplace_back(label - predicted.row(Eigen::Index(i)));
                    mean += rest.back();
                }
            for (const auto& each : rest) sum += (each - mean / double(rest.size())).array().square().matrix();
            return sum.dot(all.weight);
        };
        const double best = minimum(error, offset_s, width_s, 1e-4 * width_s);
        if (std::abs(best - offset_s) < 0.98 * width_s) result.push_back(best);
    }
    return result;
}

double growth_per_s(const TimedReadings& readings, const LabelSeries& series, const OffsetFit& all, double offset_s) {
    const double h = median_step(series.t_s);
    Eigen::RowVectorXd before(series.components()), after = before, square = Eigen::RowVectorXd::Zero(series.components());
    for (std::size_t i = 0; i < readings.t_s.size(); ++i)
        if (series.at(readings.t_s[i] + offset_s - h, before) && series.at(readings.t_s[i] + offset_s + h, after))
            square += ((after - before) / (2 * h)).array().square().matrix();
    return std::sqrt(square.dot(all.weight));
}

}  // namespace tactiled
