#include "decoupling/fit/recording_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "decoupling/fit/labels.hpp"
#include "decoupling/solve/dense.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/temperature.hpp"

namespace tactiled {
namespace {

constexpr double kMinRange_K = 2;
constexpr std::size_t kStretches = 5;
// A channel whose error falls below this part follows the temperature.
constexpr double kWorth = 0.9;

// 1, the loads, their squares and products; scaled by full scale.
Eigen::MatrixXd loads_of_rows(const Rows& rows, const Calibration& calibration) {
    const auto m = Eigen::Index(calibration.components.size());
    Eigen::MatrixXd load(Eigen::Index(rows.size()), 1 + m + m * (m + 1) / 2);
    load.col(0).setOnes();
    load.middleCols(1, m) = labels_of(rows, component_indices(calibration.components));
    for (Eigen::Index c = 1; c <= m; ++c) {
        const double largest = load.col(c).cwiseAbs().maxCoeff();
        if (largest > 0) load.col(c) /= largest;
    }
    auto at = 1 + m;
    for (Eigen::Index i = 1; i <= m; ++i)
        for (Eigen::Index j = i; j <= m; ++j, ++at) load.col(at) = load.col(i).cwiseProduct(load.col(j));
    return load;
}

// Root mean square error on stretches that were left out.
double held_out(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
    double squares = 0;
    const Eigen::Index n = a.rows();
    for (std::size_t s = 0; s < kStretches; ++s) {
        std::vector<Eigen::Index> seen, unseen;
        for (Eigen::Index i = 0; i < n; ++i)
            (std::size_t(i) * kStretches / std::size_t(n) == s ? unseen : seen).push_back(i);
        // A separate matrix, because the product would copy the indices for each row.
        const Eigen::MatrixXd left_out = a(unseen, Eigen::all);
        const Eigen::VectorXd error = b(unseen) - left_out * dense::solve_by_qr(a(seen, Eigen::all), b(seen));
        squares += error.squaredNorm();
    }
    return std::sqrt(squares / double(n));
}

}  // namespace

Temperature take_temperature_off(const Rows& all, Labelled& labelled, const Calibration& calibration,
                                 std::vector<std::string>& warnings) {
    Rows rows = rows_with(all, component_indices(calibration.components));
    std::erase_if(rows, [](const LabelledRow* row) { return !std::isfinite(row->temperature_C); });
    if (rows.empty()) return {};
    const auto [least, most] = std::minmax_element(
        rows.begin(), rows.end(), [](const auto* a, const auto* b) { return a->temperature_C < b->temperature_C; });
    Temperature found;
    const double lowest_C = (*least)->temperature_C, highest_C = (*most)->temperature_C;
    if (highest_C - lowest_C < kMinRange_K) {
        warnings.push_back(fmt::format("temperature_C covers {:.1f} K: too little to learn zero and gain against it",
                                       highest_C - lowest_C));
        return {};
    }
    found.range_C = {lowest_C, highest_C};
    Eigen::VectorXd from_K(Eigen::Index(rows.size()));
    for (Eigen::Index i = 0; i < from_K.size(); ++i) from_K[i] = rows[std::size_t(i)]->temperature_C;
    found.reference_C = from_K.mean();
    from_K.array() -= found.reference_C;
    const Eigen::MatrixXd load = loads_of_rows(rows, calibration);
    if (load.rows() < Eigen::Index(kRowsPerCoefficient) * (load.cols() + 2)) return {};
    const Eigen::MatrixXd readings = channels_of(rows);
    std::size_t followed = 0;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const Eigen::VectorXd channel = readings.col(Eigen::Index(k));
        // The gain multiplies the response to the load, which is found first.
        Eigen::MatrixXd with_zero(load.rows(), load.cols() + 1);
        with_zero << load, from_K;
        const Eigen::VectorXd first = dense::solve_by_qr(with_zero, channel);
        Eigen::VectorXd response = load * first.head(load.cols());
        response.array() -= first[0];
        Eigen::MatrixXd with_gain(load.rows(), load.cols() + 2);
        with_gain << with_zero, response.cwiseProduct(from_K);
        const double without = held_out(load, channel), zero_alone = held_out(with_zero, channel),
                     both = held_out(with_gain, channel);
        double zero = 0, zero_per_K = 0, gain_per_K = 0;
        if (both < kWorth * std::min(without, zero_alone)) {
            const Eigen::VectorXd solved = dense::solve_by_qr(with_gain, channel);
            zero = solved[0], zero_per_K = solved[load.cols()], gain_per_K = solved[load.cols() + 1];
        } else if (zero_alone < kWorth * without) {
            zero = first[0], zero_per_K = first[load.cols()];
        } else {
            const Eigen::VectorXd solved = dense::solve_by_qr(load, channel);
            zero = solved[0];
        }
        followed += zero_per_K != 0;
        found.zero.push_back(zero);
        found.zero_per_K.push_back(zero_per_K);
        found.gain_per_K.push_back(std::clamp(gain_per_K, -0.1, 0.1));
    }
    if (followed == 0) {
        warnings.emplace_back("no channel follows temperature_C");
        return {};
    }
    for (LabelledRow& row : labelled.rows)
        for (std::size_t k = 0; k < row.channel.size(); ++k)
            row.channel[k] = at_reference(found, k, row.channel[k], row.temperature_C);  // NaN without a temperature
    return found;
}

}  // namespace tactiled
