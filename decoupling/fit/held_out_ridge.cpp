#include "decoupling/fit/corrections.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "decoupling/fit/groups.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kParts = 5, kBlocksPerPart = 5;
constexpr double kWorth = 0.95, kStandardErrors = 2;
constexpr double kTiny = 1e-13;  // keeps the Gram matrix of the channels definite

// Returns the part in which each row is left out, 0 .. kParts - 1: as in the validation, in fewer parts. Copies of a row
// with random zeros stay together.
std::vector<std::size_t> parts_of(const Rows& rows) {
    Labelled sessions;
    Rows once;
    for (const auto* row : rows) {
        if (row->session >= sessions.sessions.size()) sessions.sessions.resize(row->session + 1);
        if (once.empty() || row->line != once.back()->line) once.push_back(row);
    }
    const std::vector<std::size_t> group = ways_to_hold_out(sessions, once, false).front().of_row;
    std::vector<std::size_t> known, part;
    std::size_t at = 0;
    for (const auto* row : rows) {
        if (row->line != once[at]->line) ++at;
        const auto found = std::find(known.begin(), known.end(), group[at]);
        part.push_back(std::size_t(found - known.begin()) % kParts);
        if (found == known.end()) known.push_back(group[at]);
    }
    if (known.size() < 2)  // rows without line numbers
        for (std::size_t i = 0; i < rows.size(); ++i) part[i] = i * kParts / rows.size();
    return part;
}

// The rows in the order of their parts.
struct Sorted {
    Eigen::MatrixXd u, y, known;  // `known`: 1 for a label, 0 for none
    std::vector<Eigen::Index> begin;
};

Sorted sorted_by_part(const Rows& rows, const Scaled& scaled) {
    const std::vector<std::size_t> part = parts_of(rows);
    std::vector<std::size_t> order(rows.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return part[a] < part[b]; });
    const Eigen::MatrixXd y = units_left(scaled);
    Eigen::MatrixXd known = Eigen::MatrixXd::Zero(y.rows(), y.cols());
    for (std::size_t c = 0; c < scaled.component.size(); ++c)
        for (const Eigen::Index i : scaled.component[c].rows) known(i, Eigen::Index(c)) = 1;
    Sorted sorted{.u = Eigen::MatrixXd(scaled.u.rows(), scaled.u.cols()),
                  .y = Eigen::MatrixXd(y.rows(), y.cols()),
                  .known = Eigen::MatrixXd(y.rows(), y.cols()),
                  .begin = {0}};
    for (std::size_t i = 0; i < order.size(); ++i) {
        if (i > 0 && part[order[i]] != part[order[i - 1]]) sorted.begin.push_back(Eigen::Index(i));
        sorted.u.row(Eigen::Index(i)) = scaled.u.row(Eigen::Index(order[i]));
        sorted.y.row(Eigen::Index(i)) = y.row(Eigen::Index(order[i]));
        sorted.known.row(Eigen::Index(i)) = known.row(Eigen::Index(order[i]));
    }
    sorted.begin.push_back(Eigen::Index(order.size()));
    return sorted;
}

struct Normal {
    Eigen::MatrixXd gram, feature_y;
};

struct Solutions {
    Eigen::MatrixXd linear;                   // features (1, u): the matrix
    std::vector<Eigen::MatrixXd> correction;  // all features, one for each ridge
};

Solutions solutions(const Normal& normal, Eigen::Index n_linear, double n_rows, std::span<const double> ridges) {
    Solutions result;
    Eigen::MatrixXd of_linear = normal.gram.topLeftCorner(n_linear, n_linear);
    of_linear.diagonal().array() += kTiny * n_rows;
    result.linear = dense::solve_by_llt(of_linear, normal.feature_y.topRows(n_linear));
    Eigen::MatrixXd linear = Eigen::MatrixXd::Zero(normal.gram.rows(), normal.feature_y.cols());
    linear.topRows(n_linear) = result.linear;
    const Eigen::MatrixXd left = normal.feature_y - normal.gram.selfadjointView<Eigen::Lower>() * linear;
    for (const double ridge : ridges) {
        Eigen::MatrixXd regular = normal.gram;
        regular.diagonal().array() += ridge * n_rows;
        result.correction.push_back(dense::solve_by_llt(regular, left));
    }
    return result;
}

// Returns the rows begin .. end at the nearest point of the domain of the other rows, as the loop reads them there: a
// combination of channels that shows nothing inside is large where one channel alone is cut off.
Eigen::MatrixXd clamped(const Eigen::MatrixXd& u, Eigen::Index begin, Eigen::Index end) {
    Eigen::RowVectorXd min = Eigen::RowVectorXd::Constant(u.cols(), std::numeric_limits<double>::infinity()), max = -min;
    for (const auto& others : {u.topRows(begin), u.bottomRows(u.rows() - end)}) {
        if (others.rows() == 0) continue;
        min = min.cwiseMin(others.colwise().minCoeff());
        max = max.cwiseMax(others.colwise().maxCoeff());
    }
    Eigen::MatrixXd result = u.middleRows(begin, end - begin);
    for (Eigen::Index i = 0; i < result.rows(); ++i) result.row(i) = result.row(i).cwiseMax(min).cwiseMin(max);
    return result;
}

}  // namespace

std::vector<HeldOutErrors> held_out_errors(const Rows& rows, const Scaled& scaled, const FeaturesOf& features_of,
                                           std::span<const double> ridges) {
    const Sorted sorted = sorted_by_part(rows, scaled);
    const std::size_t parts = sorted.begin.size() - 1;
    const Eigen::Index n_features = features_of(sorted.u.topRows(1)).cols(), n_y = sorted.y.cols();
    const Normal none{Eigen::MatrixXd::Zero(n_features, n_features), Eigen::MatrixXd::Zero(n_features, n_y)};
    std::vector<Normal> of_part(parts, none);
    Normal all = none;
    for (std::size_t part = 0; part < parts; ++part) {
        for_each_chunk(sorted.u, sorted.begin[part], sorted.begin[part + 1], features_of,
                       [&](Eigen::Index at, const Eigen::MatrixXd& features) {
                           of_part[part].gram.selfadjointView<Eigen::Lower>().rankUpdate(features.transpose());
                           of_part[part].feature_y += features.transpose() * sorted.y.middleRows(at, features.rows());
                       });
        all.gram += of_part[part].gram;
        all.feature_y += of_part[part].feature_y;
    }
    const auto columns = Eigen::Index(ridges.size()) + 1;
    const BlockErrors zero = BlockErrors::Zero(Eigen::Index(parts * kBlocksPerPart), columns);
    std::vector<HeldOutErrors> errors(std::size_t(n_y), HeldOutErrors{zero, zero});
    for (std::size_t part = 0; part < parts; ++part) {
        const Eigen::Index begin = sorted.begin[part], end = sorted.begin[part + 1];
        const Normal others{all.gram - of_part[part].gram, all.feature_y - of_part[part].feature_y};
        const Solutions solved = solutions(others, 1 + sorted.u.cols(), double(sorted.u.rows() - (end - begin)), ridges);
        const Eigen::MatrixXd left = ((sorted.y.middleRows(begin, end - begin) -
                                       sorted.u.middleRows(begin, end - begin) * solved.linear.bottomRows(sorted.u.cols()))
                                          .rowwise() -
                                      solved.linear.row(0));
        const auto sum_up = [&](const Eigen::MatrixXd& u, BlockErrors HeldOutErrors::*kind) {
            for_each_chunk(u, 0, end - begin, features_of, [&](Eigen::Index at, const Eigen::MatrixXd& features) {
                for (Eigen::Index r = 0; r < columns; ++r) {
                    Eigen::MatrixXd error = left.middleRows(at, features.rows());
                    if (r + 1 < columns) error -= features * solved.correction[std::size_t(r)];
                    const Eigen::MatrixXd squares =
                        error.cwiseProduct(sorted.known.middleRows(begin + at, features.rows())).cwiseAbs2();
                    for (Eigen::Index i = 0; i < squares.rows(); ++i) {
                        const Eigen::Index block =
                            (at + i) * Eigen::Index(kBlocksPerPart) / (end - begin) + Eigen::Index(part * kBlocksPerPart);
                        for (Eigen::Index c = 0; c < n_y; ++c) (errors[std::size_t(c)].*kind)(block, r) += squares(i, c);
                    }
                }
            });
        };
        sum_up(clamped(sorted.u, begin, end), &HeldOutErrors::as_read);
        sum_up(sorted.u.middleRows(begin, end - begin), &HeldOutErrors::smooth);
    }
    return errors;
}

bool gains(const BlockErrors& errors, Eigen::Index column) {
    // Differences, or else ratios: one block with loads beyond all others hides the differences of the rest.
    const auto by_more_than_chance = [](const Eigen::ArrayXd& gain) {
        const double n = double(gain.size()), sum = gain.sum();
        return sum > kStandardErrors * std::sqrt(n / (n - 1) * (gain - sum / n).square().sum());
    };
    const Eigen::ArrayXd with = errors.col(column), without = errors.rightCols(1);
    constexpr double kNothing = 1e-300;
    return with.sum() < kWorth * kWorth * without.sum() &&
           (by_more_than_chance(without - with) ||
            by_more_than_chance((without + kNothing).log() - (with + kNothing).log()));
}

bool gains(const HeldOutErrors& errors, Eigen::Index column) {
    const Eigen::Index none = errors.as_read.cols() - 1;
    return gains(errors.as_read, column) ||
           (gains(errors.smooth, column) && errors.as_read.col(column).sum() < errors.as_read.col(none).sum());
}

std::size_t best_ridge(const HeldOutErrors& errors) {
    const Eigen::Index none = errors.as_read.cols() - 1;
    const Eigen::RowVectorXd as_read = errors.as_read.colwise().sum(), smooth = errors.smooth.colwise().sum();
    Eigen::Index best = none;
    for (Eigen::Index r = 0; r < none; ++r)
        if (as_read[r] < as_read[none] && smooth[r] < smooth[best]) best = r;
    if (best < none && gains(errors, best)) return std::size_t(best);
    as_read.head(none).minCoeff(&best);
    return std::size_t(gains(errors, best) ? best : none);
}

bool has_no_correction(const Calibration& calibration, const char* table, std::size_t i) {
    const auto found = calibration.tables.find(table);
    return found != calibration.tables.end() && found->second.size() == calibration.components.size() &&
           std::all_of(found->second[i].begin(), found->second[i].end(), [](double value) { return value == 0; });
}

}  // namespace tactiled
