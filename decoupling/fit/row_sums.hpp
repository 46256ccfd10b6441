// Sums over rows from which ridge regressions on any part of the rows follow: one pass over the rows serves all ridges, all
// parts that are held out, and the fits without suspected rows.
#pragma once
#include <optional>
#include <vector>

#include "decoupling/fit/corrections.hpp"

namespace tactiled {

// The normal equations of some rows: feature' feature, whose lower triangle is used, and feature' y.
struct Normal {
    Normal(Eigen::Index n_features, Eigen::Index n_y)
        : gram(Eigen::MatrixXd::Zero(n_features, n_features)), feature_y(Eigen::MatrixXd::Zero(n_features, n_y)) {}

    // Adds rows; sign -1: takes them out.
    void add(const Eigen::MatrixXd& features, const Eigen::MatrixXd& y, double sign = 1);
    void add(const Normal& other, double sign = 1);
    // Returns (feature' feature + ridge rows I)^-1 right. The ridge bounds the condition number of the features, whose mean
    // square is about 1, by 1 / ridge, so that the normal equations lose no significant digit.
    [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right, double ridge) const;

    Eigen::MatrixXd gram, feature_y;
    double rows = 0;
};

// Returns the features of some rows of Scaled::u; the first 1 + channels are (1, u).
using FeaturesOf = std::function<Eigen::MatrixXd(const Eigen::MatrixXd& u)>;

// The rows of a recording in the parts in which held_out_errors() leaves them out, and the normal equations of each part,
// before the last third of the time and in it. Their right side is the residual of the matrix in units of its root mean
// square (units_left()).
class RowSums {
public:
    using Places = std::vector<Eigen::Index>;  // indices of rows of the recording

    RowSums(const Rows& rows, const Scaled& scaled, FeaturesOf features_of);

    // Returns the places of `some`, which are in the order of the recording; nothing if one of them is not in it, or has
    // another label than there.
    [[nodiscard]] std::optional<Places> places_of(const Rows& some) const;
    // Returns the normal equations of the rows at `places`, which are in order. A block that is in use with more than half
    // of its rows costs the time of the others alone.
    [[nodiscard]] Normal of(const Places& places) const;
    void take_out(const Places& places, Normal& normal) const;

    // The rows by their parts: part p is begin()[p] .. begin()[p + 1].
    [[nodiscard]] const std::vector<Eigen::Index>& begin() const noexcept { return begin_; }
    [[nodiscard]] Normal of_part(std::size_t part) const;
    [[nodiscard]] Eigen::MatrixXd u_of(Eigen::Index begin, Eigen::Index end) const;
    [[nodiscard]] Eigen::MatrixXd y_of(Eigen::Index begin, Eigen::Index end) const;
    [[nodiscard]] Eigen::MatrixXd known_of(Eigen::Index begin, Eigen::Index end) const;  // 1 for a label, 0 for none
    [[nodiscard]] Eigen::MatrixXd features_of(const Eigen::MatrixXd& u) const { return features_of_(u); }
    [[nodiscard]] const Eigen::RowVectorXd& unit() const noexcept { return unit_; }  // N or Nm, of each component

private:
    struct Block {
        std::size_t part;
        Places places;
        Normal normal;
    };
    [[nodiscard]] Normal none() const { return {n_features_, y_.cols()}; }
    void add(const Places& places, Normal& normal, double sign) const;

    std::vector<LabelledRow> rows_;
    Eigen::MatrixXd u_, y_, known_;
    Eigen::RowVectorXd unit_;
    FeaturesOf features_of_;
    Eigen::Index n_features_;
    std::vector<Block> blocks_;
    Places sorted_;  // by part
    std::vector<Eigen::Index> begin_;
};

}  // namespace tactiled
