// Model "generic", method "matrix": each component is an independent affine function of the channels. With the
// parameter `forget`, row i of N has the weight forget^(N - i).
#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/recursive.hpp"
#include "decoupling/generic/methods.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

std::string names_of(const std::vector<std::size_t>& columns, const std::vector<std::string>& channels) {
    std::string text;
    for (const std::size_t k : columns) text += (text.empty() ? "" : " ") + channels[k];
    return text;
}

// The calibration's form is M (r - zero), the fit is M r + b, so M zero = -b. Many zeros fulfil that; the one nearest
// to `at_rest`, in widths of the channels, is taken: with fewer forces than channels b alone does not determine the
// readings at rest.
Eigen::VectorXd fold_constant(const Eigen::MatrixXd& m, const Eigen::VectorXd& b, const Eigen::VectorXd& at_rest,
                              const Eigen::VectorXd& width) {
    const Eigen::MatrixXd scaled = m * width.asDiagonal();
    const Eigen::VectorXd wanted = -b - m * at_rest;
    // Rows are scaled, too, because N and Nm differ by a lever arm of about 1e-3 m.
    const Eigen::VectorXd length = scaled.rowwise().norm();
    const Eigen::MatrixXd unit_rows = scaled.array().colwise() / length.array();
    const Eigen::VectorXd unit_wanted = wanted.array() / length.array();
    const Eigen::VectorXd step = dense::least_norm_of_one(unit_rows, unit_wanted);
    if (!step.allFinite() ||
        (unit_rows * step - unit_wanted).cwiseAbs().maxCoeff() > 1e-9 * (1 + unit_wanted.cwiseAbs().maxCoeff()))
        throw Undetermined("no zero of the channels makes all forces 0 together: fit fewer components, or more channels");
    return at_rest + width.asDiagonal() * step;
}

// Fits with the highest weight on the newest rows, starting from the fit of all rows.
void forget_old_rows(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, double forget, Affine& affine) {
    const Eigen::Index n = x.cols();
    const Eigen::MatrixXd centred = x.rowwise() - affine.centre;
    const Eigen::RowVectorXd width = (centred.colwise().squaredNorm() / double(x.rows())).cwiseSqrt();
    const double y_centre = affine.constant + affine.centre.dot(affine.slope.coefficient);
    Eigen::VectorXd start(n + 1), row(n + 1);
    start << affine.slope.coefficient.cwiseProduct(width.transpose()), 0;
    RecursiveLeastSquares recursive(start, forget);
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
        row << centred.row(i).transpose().cwiseQuotient(width.transpose()), 1;
        recursive.update(row, y[i] - y_centre);
    }
    const Eigen::VectorXd newest = recursive.coefficient();
    affine.slope.coefficient = newest.head(n).cwiseQuotient(width.transpose());
    affine.constant = y_centre + newest[n] - affine.centre.dot(affine.slope.coefficient);
}

}  // namespace

void fit_affine(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings,
                std::optional<double> forget) {
    const auto n_channels = Eigen::Index(calibration.channels.size());
    const auto n_components = Eigen::Index(calibration.components.size());
    if (n_components > n_channels)
        throw Undetermined(fmt::format("{} components from {} channels: at most one a channel", n_components, n_channels));
    Eigen::MatrixXd m(n_components, n_channels);
    Eigen::VectorXd b(n_components);
    calibration.condition = 0;
    std::optional<AffineOf> of_all;
    for (Eigen::Index i = 0; i < n_components; ++i) {
        const std::size_t c = component_index(calibration.components[std::size_t(i)]);
        const Rows known = rows_with(rows, {c});
        if (Eigen::Index(known.size()) <= n_channels)
            throw Undetermined(fmt::format("{} rows with {} are too few", known.size(), label_column(c)));
        const Eigen::VectorXd y = labels_of(known, {c});
        if (!(y.minCoeff() < y.maxCoeff())) throw Undetermined(fmt::format("{} is always {} there", label_column(c), y[0]));
        // Components with a label in every row share the decomposition.
        if (known.size() == rows.size() && !of_all) of_all.emplace(channels_of(rows));
        Affine affine = known.size() == rows.size() ? of_all->fit(y) : affine_fit(channels_of(known), y);
        if (!affine.slope.dependent.empty())
            throw Undetermined(
                fmt::format("the channels {} are a combination of each other (or constant) in the rows with {}: "
                            "leave one of them out with --channels",
                            names_of(affine.slope.dependent, calibration.channels), label_column(c)));
        if (forget) forget_old_rows(channels_of(known), y, *forget, affine);
        m.row(i) = affine.slope.coefficient.transpose();
        b[i] = affine.constant;
        calibration.condition = std::max(calibration.condition, affine.slope.condition);
    }

    // Returns the readings at rest: rows in which every present label is within 2 % of its full scale; 0 if there are
    // none.
    const Wrench full_scale = full_scales(rows);
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(n_channels), min, max;
    int resting = 0;
    for (const auto* row : rows) {
        const Eigen::Map<const Eigen::VectorXd> r(row->channel.data(), n_channels);
        min = min.size() == 0 ? Eigen::VectorXd(r) : Eigen::VectorXd(min.cwiseMin(r));
        max = max.size() == 0 ? Eigen::VectorXd(r) : Eigen::VectorXd(max.cwiseMax(r));
        bool rests = true;
        for (std::size_t c = 0; c < full_scale.size(); ++c)
            rests = rests && !(std::abs(row->wrench_S[c]) > 0.02 * full_scale[c]);
        if (!rests) continue;
        sum += r;
        ++resting;
    }
    const Eigen::VectorXd at_rest = resting > 0 ? Eigen::VectorXd(sum / resting) : sum;
    const Eigen::VectorXd width = max - min;
    const Eigen::VectorXd zero = fold_constant(m, b, at_rest, width);
    if (resting == 0)
        warnings.emplace_back(
            "no row is unloaded (every label within 2 % of its full scale): the zero is extrapolated; tare before use");
    for (Eigen::Index k = 0; k < n_channels; ++k)
        if (resting > 0 && std::abs(zero[k] - at_rest[k]) > 0.1 * width[k])
            warnings.push_back(fmt::format(
                "zero of {} is {:.2g}, {:.0f} % of its width from its mean at rest {:.2g}: not a straight line",
                calibration.channels[std::size_t(k)], zero[k], 100 * std::abs(zero[k] - at_rest[k]) / width[k], at_rest[k]));
    calibration.zero.assign(zero.data(), zero.data() + n_channels);
    calibration.matrix = rows_in(m);
    calibration.parameters.clear();
}

std::vector<std::vector<double>> rows_in(const Eigen::MatrixXd& matrix) {
    std::vector<std::vector<double>> rows;
    for (const auto& row : matrix.rowwise()) rows.emplace_back(row.begin(), row.end());
    return rows;
}

namespace {

constexpr std::array<Parameter, 1> kBeforehand{kForget};

void fit_matrix(const Rows& rows, Calibration& calibration, std::vector<std::string>& warnings) {
    const CalibrationData known = known_beforehand(calibration, kBeforehand);
    if (!known.has("forget")) return fit_affine(rows, calibration, warnings);
    const double forget = known["forget"];
    fit_affine(rows, calibration, warnings, forget);
    calibration.parameters = {{"forget", forget}};
}

const FitEntry entry{.model = "generic", .method = "matrix", .fit = fit_matrix, .takes_zero_drift = true};

}  // namespace
}  // namespace tactiled
