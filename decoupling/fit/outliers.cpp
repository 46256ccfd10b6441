#include "decoupling/fit/outliers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "decoupling/fit/robust.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kFarOff = 10;         // robust standard deviations
constexpr double kOfFullScale = 0.05;  // and this much, at least
constexpr std::size_t kMaxRows = 2;    // may be outliers, or
constexpr double kMaxShare = 0.01;

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(values.size() / 2), values.end());
    return values[values.size() / 2];
}

std::vector<double> sizes_of(const Eigen::VectorXd& errors) {
    std::vector<double> sizes;
    for (const double error : errors) sizes.push_back(std::abs(error));
    return sizes;
}

// Errors of the affine map that fits most rows best: least squares, reweighted by Cauchy's loss.
Eigen::VectorXd robust_errors(const Eigen::MatrixXd& x, const Eigen::VectorXd& y) {
    Eigen::VectorXd weight = Eigen::VectorXd::Ones(y.size()), error = Eigen::VectorXd::Zero(y.size());
    for (int round = 0; round < 30; ++round) {
        const double sum = weight.sum();
        const Eigen::RowVectorXd centre = (weight.transpose() * x) / sum;
        const double y_centre = weight.dot(y) / sum;
        const Eigen::VectorXd root = weight.cwiseSqrt();
        const auto fit = least_squares(root.asDiagonal() * (x.rowwise() - centre),
                                       Eigen::VectorXd(root.cwiseProduct(Eigen::VectorXd(y.array() - y_centre))));
        if (!fit.dependent.empty()) return Eigen::VectorXd::Zero(y.size());  // the fit itself will say so
        const Eigen::VectorXd now = (y.array() - y_centre).matrix() - (x.rowwise() - centre) * fit.coefficient;
        const bool settled = round > 0 && (now - error).norm() <= 1e-6 * now.norm();
        error = now;
        const double sd = kRobustSd * median(sizes_of(error));
        if (settled || !(sd > 0)) break;
        weight = 1 / (1 + (error.array() / (kCauchyEfficient * sd)).square());
    }
    return error;
}

std::string unit_of(std::size_t c) { return c < 3 ? "N" : "Nm"; }

}  // namespace

Rows without_outliers(const Labelled& labelled, const Rows& rows, FitReport& report) {
    std::set<const LabelledRow*> out;
    for (const auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        Rows with_label;
        for (const auto* row : rows)
            if (std::isfinite(row->wrench_S[c])) with_label.push_back(row);
        const auto n = Eigen::Index(with_label.size());
        Eigen::MatrixXd x(n, Eigen::Index(labelled.channels.size()));
        Eigen::VectorXd y(n);
        for (Eigen::Index i = 0; i < n; ++i) {
            x.row(i) = Eigen::Map<const Eigen::RowVectorXd>(with_label[std::size_t(i)]->channel.data(), x.cols());
            y[i] = with_label[std::size_t(i)]->wrench_S[c];
        }
        const Eigen::VectorXd error = robust_errors(x, y);
        const std::vector<double> sizes = sizes_of(error);
        const double far_off = kFarOff * kRobustSd * median(sizes);
        double full_scale = 0;  // without those in doubt: a label with its decimal point lost would hide all others
        for (std::size_t i = 0; i < sizes.size(); ++i)
            if (sizes[i] <= far_off) full_scale = std::max(full_scale, std::abs(y[Eigen::Index(i)]));
        const double limit = std::max(far_off, kOfFullScale * full_scale);
        std::vector<std::pair<double, const LabelledRow*>> far;
        for (std::size_t i = 0; i < sizes.size(); ++i)
            if (sizes[i] > limit) far.emplace_back(sizes[i], with_label[i]);
        if (far.empty() || far.size() > std::max(kMaxRows, std::size_t(kMaxShare * double(n)))) continue;
        const auto worst = std::max_element(far.begin(), far.end());
        report.warnings.push_back(fmt::format(
            "{} of {} rows disagree with the rest in {} (worst {}:{}, by {:.3g} {}): left out; are their labels right?",
            far.size(), n, label_column(c), labelled.name, worst->second->line, worst->first, unit_of(c)));
        for (const auto& [size, row] : far) {
            if (far.size() > 1)
                report.warnings.push_back(
                    fmt::format("  left out: {}:{}, {:.3g} {}", labelled.name, row->line, size, unit_of(c)));
            out.insert(row);
        }
    }
    Rows kept;
    for (const auto* row : rows)
        if (out.count(row) == 0) kept.push_back(row);
    return kept;
}

void report_disagreement(const Labelled& labelled, const Rows& rows, FitReport& report) {
    const auto decoupler = make_decoupler(report.calibration);
    for (const auto& component : report.components) {
        const std::size_t c = component_index(component.name);
        std::vector<std::pair<double, std::int64_t>> errors;  // size, line
        for (const auto* row : rows)
            if (const double error = error_of(*decoupler, *row)[c]; std::isfinite(error))
                errors.emplace_back(std::abs(error), row->line);
        if (errors.empty()) continue;
        std::sort(errors.begin(), errors.end());
        // A fifth of full scale: bends and hysteresis stay below that.
        const double limit = std::max(kFarOff * kRobustSd * errors[errors.size() / 2].first, 0.2 * component.full_scale);
        const auto first = std::upper_bound(errors.begin(), errors.end(), std::pair(limit, std::int64_t{0}));
        if (first != errors.end())
            report.warnings.push_back(
                fmt::format("{} of {} rows disagree with the calibration in {} (worst {}:{}, by {:.3g} {}), but are part of "
                            "it: are their "
                            "labels right?",
                            errors.end() - first, errors.size(), label_column(c), labelled.name, errors.back().second,
                            errors.back().first, unit_of(c)));
    }
}

}  // namespace tactiled
