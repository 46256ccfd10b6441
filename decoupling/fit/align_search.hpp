// The search for the offset between the clocks of channels and labels (align.hpp).
#pragma once
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "decoupling/fit/labelled_table.hpp"

namespace tactiled {

inline constexpr double kMinOverlap = 0.5;  // part of the shorter recording
inline constexpr int kParts = 5;            // stretches whose offsets are compared

double median_step(const std::vector<double>& t);

// The labels over their own time, in its order.
class LabelSeries {
public:
    LabelSeries(const LabelledTable& labels, std::int64_t origin_ns);
    // Sets the labels at a time; false outside, and in a gap.
    template <class Row>
    bool at(double time_s, Row&& row) const {
        const auto after = std::upper_bound(t_s.begin(), t_s.end(), time_s);
        if (after == t_s.begin() || (after == t_s.end() && time_s > t_s.back())) return false;
        const auto j = Eigen::Index(std::min(std::size_t(after - t_s.begin()), t_s.size() - 1));
        const double begin = t_s[std::size_t(j - 1)], width = t_s[std::size_t(j)] - begin;
        if (width > longest_s_) return false;
        const double part = width > 0 ? (time_s - begin) / width : 0;
        row = (1 - part) * value_.row(j - 1) + part * value_.row(j);
        return true;
    }
    [[nodiscard]] Eigen::Index components() const { return value_.cols(); }

    std::vector<double> t_s;
    std::vector<std::size_t> component;

private:
    std::vector<std::size_t> column_;
    Eigen::MatrixXd value_;
    double longest_s_ = 0;
};

// Rows of channels with their times and sessions; at most n of them, evenly.
struct TimedReadings {
    std::vector<double> t_s;
    std::vector<std::size_t> session;
    Eigen::MatrixXd channel;

    TimedReadings(const LabelledTable& table, const Labelled& labelled, std::int64_t origin_ns, std::size_t max);
};

struct OffsetFit {
    double rest = std::numeric_limits<double>::quiet_NaN();  // unexplained part of the variance, of forces or of moments
    std::size_t rows = 0;
    Eigen::MatrixXd coefficients, residual, label;  // centred; residual in N and Nm
    // Per label: 1 / |residual|^2 of the forces or of the moments, whichever the channels explain better; 0 for the others.
    Eigen::RowVectorXd weight;
    std::vector<char> is_there;
};

// The labels at an offset as a function of the channels, exactly.
OffsetFit fit_at(const TimedReadings& readings, const LabelSeries& series, double offset_s);

// Returns the place of the minimum of f within +- width by golden sections.
template <class F>
double minimum(F f, double middle, double width, double until) {
    const double ratio = (std::sqrt(5.0) - 1) / 2;
    double a = middle - width, b = middle + width, x = b - ratio * (b - a), y = a + ratio * (b - a), fx = f(x), fy = f(y);
    while (b - a > until) {
        if (fx < fy) {
            b = y, y = x, fy = fx, x = b - ratio * (b - a), fx = f(x);
        } else {
            a = x, x = y, fx = fy, y = a + ratio * (b - a), fy = f(y);
        }
    }
    return (a + b) / 2;
}

// The likelihood of offsets on a grid: its logarithm is -rows / 2 log(rest), where `rest` is the unexplained part of the
// labels, to the power of the part of the rows that have labels. A row without a label says nothing about the offset.
struct OffsetGrid {
    double first_s = 0, step_s = 0;
    std::vector<double> rest;

    [[nodiscard]] double offset_s(std::size_t i) const { return first_s + double(i) * step_s; }
    [[nodiscard]] std::size_t best() const { return std::size_t(std::min_element(rest.begin(), rest.end()) - rest.begin()); }
};

OffsetGrid coarse_search(const TimedReadings& readings, const LabelSeries& series);

// The number of independent pieces of the recording, and the best offset outside the peak.
struct OffsetPeak {
    double pieces = 0, other_rest = 1, other_s = 0, typical_rest = 1;
};
OffsetPeak peak_of(const OffsetGrid& coarse, double length_s);

// The offset in each fifth of the rows, with the coefficients of all.
std::vector<double> offsets_of_parts(const TimedReadings& readings, const LabelSeries& series, const OffsetFit& all,
                                     double offset_s, double width_s);

// Returns the growth of the labels' error with an error of the offset, relative to the residual of `all`.
double growth_per_s(const TimedReadings& readings, const LabelSeries& series, const OffsetFit& all, double offset_s);

}  // namespace tactiled
