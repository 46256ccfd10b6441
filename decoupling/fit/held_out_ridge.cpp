#include "decoupling/fit/corrections.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "decoupling/fit/parallel.hpp"
#include "decoupling/fit/row_sums.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

constexpr Eigen::Index kBlocksPerPart = 5;
constexpr double kWorth = 0.95, kStandardErrors = 2;
constexpr double kTiny = 1e-13;  // keeps the Gram matrix of the channels definite

struct Solutions {
    Eigen::MatrixXd linear;      // features (1, u): the matrix
    Eigen::MatrixXd correction;  // all features; the components with the first ridge, with the second ...
};

Solutions solutions(const Normal& normal, Eigen::Index n_linear, std::span<const double> ridges) {
    Solutions result;
    Eigen::MatrixXd of_linear = normal.gram.topLeftCorner(n_linear, n_linear);
    of_linear.diagonal().array() += kTiny * normal.rows;
    result.linear = dense::solve_by_llt(of_linear, normal.feature_y.topRows(n_linear));
    Eigen::MatrixXd linear = Eigen::MatrixXd::Zero(normal.gram.rows(), normal.feature_y.cols());
    linear.topRows(n_linear) = result.linear;
    const Eigen::MatrixXd left = normal.feature_y - normal.gram.selfadjointView<Eigen::Lower>() * linear;
    result.correction.resize(left.rows(), left.cols() * Eigen::Index(ridges.size()));
    for (std::size_t r = 0; r < ridges.size(); ++r)
        result.correction.middleCols(Eigen::Index(r) * left.cols(), left.cols()) = normal.solve(left, ridges[r]);
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

// One part that is left out, with the solutions of the other rows.
class Unseen {
public:
    Unseen(const RowSums& sums, const Eigen::MatrixXd& all_u, const Normal& others, std::size_t part,
           std::span<const double> ridges)
        : sums_(sums),
          begin_(sums.begin()[part]),
          end_(sums.begin()[part + 1]),
          u_(all_u.middleRows(begin_, end_ - begin_)),
          clamped_(clamped(all_u, begin_, end_)),
          solved_(solutions(others, 1 + all_u.cols(), ridges)),
          known_(sums.known_of(begin_, end_)),
          left_((sums.y_of(begin_, end_) - u_ * solved_.linear.bottomRows(u_.cols())).rowwise() - solved_.linear.row(0)) {}

    // Sets the errors of this part, kBlocksPerPart rows from `block` on, of each component.
    void judge(Eigen::Index block, std::vector<HeldOutErrors>& errors) const {
        for (Eigen::Index at = 0; at < left_.rows(); at += kChunk) {
            const Eigen::Index n = std::min(kChunk, left_.rows() - at);
            const Eigen::MatrixXd smooth = squares(u_, at, n);
            const bool is_inside = u_.middleRows(at, n) == clamped_.middleRows(at, n);
            const Eigen::MatrixXd as_read = is_inside ? smooth : squares(clamped_, at, n);
            for (Eigen::Index i = 0; i < n; ++i) {
                const Eigen::Index to = block + (at + i) * kBlocksPerPart / left_.rows();
                for (Eigen::Index k = 0; k < smooth.cols(); ++k) {
                    HeldOutErrors& of = errors[std::size_t(k % left_.cols())];
                    of.smooth(to, k / left_.cols()) += smooth(i, k);
                    of.as_read(to, k / left_.cols()) += as_read(i, k);
                }
            }
        }
    }

private:
    static constexpr Eigen::Index kChunk = 256;

    // Returns the squared errors of the rows from `at` on: the components with each ridge, then without a correction.
    [[nodiscard]] Eigen::MatrixXd squares(const Eigen::MatrixXd& u, Eigen::Index at, Eigen::Index n) const {
        const Eigen::Index ridges = solved_.correction.cols() / left_.cols();
        const Eigen::MatrixXd known = known_.middleRows(at, n), left = left_.middleRows(at, n);
        Eigen::MatrixXd error = left.replicate(1, ridges + 1);
        error.leftCols(solved_.correction.cols()) -= sums_.features_of(u.middleRows(at, n)) * solved_.correction;
        return error.cwiseProduct(known.replicate(1, ridges + 1)).cwiseAbs2();
    }

    const RowSums& sums_;
    Eigen::Index begin_, end_;
    Eigen::MatrixXd u_, clamped_;
    Solutions solved_;
    Eigen::MatrixXd known_, left_;
};

}  // namespace

std::vector<HeldOutErrors> held_out_errors(const RowSums& sums, std::span<const double> ridges) {
    const std::size_t parts = sums.begin().size() - 1;
    std::vector<Normal> of_part;
    for (std::size_t part = 0; part < parts; ++part) of_part.push_back(sums.of_part(part));
    Normal all = of_part.front();
    for (std::size_t part = 1; part < parts; ++part) all.add(of_part[part]);
    const BlockErrors zero = BlockErrors::Zero(Eigen::Index(parts) * kBlocksPerPart, Eigen::Index(ridges.size()) + 1);
    std::vector<HeldOutErrors> errors(std::size_t(all.feature_y.cols()), HeldOutErrors{zero, zero});
    const Eigen::MatrixXd u = sums.u_of(0, sums.begin().back());
    in_parallel(parts, [&](std::size_t part) {
        Normal others = all;
        others.add(of_part[part], -1);
        Unseen(sums, u, others, part, ridges).judge(Eigen::Index(part) * kBlocksPerPart, errors);
    });
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
