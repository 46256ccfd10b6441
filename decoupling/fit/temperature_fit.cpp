#include "decoupling/fit/recording_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

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
constexpr double kMaxGain_per_K = 0.1;  // limit of the file
// Known coefficients hold as far as the dummy and the channels are of one film, which a polymer skin does not limit: the
// standard deviation, which grows with the distance, does.
constexpr double kFilmRange_C[2] = {-50, 150};

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

// An error on stretches that were left out, and the scatter of the last coefficient when each of them is left out.
struct LeftOut {
    double rms = 0, last_sd = 0;
};

// The jackknife over stretches does not take neighbouring rows for independent ones.
LeftOut held_out(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
    double squares = 0;
    const Eigen::Index n = a.rows();
    Eigen::ArrayXd last(kStretches);
    for (std::size_t s = 0; s < kStretches; ++s) {
        std::vector<Eigen::Index> seen, unseen;
        for (Eigen::Index i = 0; i < n; ++i)
            (std::size_t(i) * kStretches / std::size_t(n) == s ? unseen : seen).push_back(i);
        // A separate matrix, because the product would copy the indices for each row.
        const Eigen::MatrixXd left_out = a(unseen, Eigen::all);
        const Eigen::VectorXd solved = dense::solve_by_qr(a(seen, Eigen::all), b(seen));
        squares += (b(unseen) - left_out * solved).squaredNorm();
        last[Eigen::Index(s)] = solved[a.cols() - 1];
    }
    constexpr double kJackknife = double(kStretches - 1) / double(kStretches);
    return {std::sqrt(squares / double(n)), std::sqrt(kJackknife * (last - last.mean()).square().sum())};
}

// The coefficients of one channel.
struct ChannelFit {
    double zero = 0, zero_per_K = 0, gain_per_K = 0, zero_per_K_sd = 0, gain_per_K_sd = 0;
};

ChannelFit fit_channel(const Eigen::MatrixXd& load, const Eigen::VectorXd& from_K, const Eigen::VectorXd& channel) {
    // The gain multiplies the response to the load, which is found first.
    Eigen::MatrixXd with_zero(load.rows(), load.cols() + 1);
    with_zero << load, from_K;
    const Eigen::VectorXd first = dense::solve_by_qr(with_zero, channel);
    Eigen::VectorXd response = load * first.head(load.cols());
    response.array() -= first[0];
    Eigen::MatrixXd with_gain(load.rows(), load.cols() + 2);
    with_gain << with_zero, response.cwiseProduct(from_K);
    const LeftOut without = held_out(load, channel), zero_alone = held_out(with_zero, channel),
                  both = held_out(with_gain, channel);
    if (both.rms < kWorth * std::min(without.rms, zero_alone.rms)) {
        const Eigen::VectorXd solved = dense::solve_by_qr(with_gain, channel);
        return {solved[0], solved[load.cols()], std::clamp(solved[load.cols() + 1], -kMaxGain_per_K, kMaxGain_per_K),
                zero_alone.last_sd, std::min(both.last_sd, kMaxGain_per_K)};
    }
    if (zero_alone.rms < kWorth * without.rms) return {first[0], first[load.cols()], 0, zero_alone.last_sd, 0};
    ChannelFit still;
    still.zero = Eigen::VectorXd(dense::solve_by_qr(load, channel))[0];
    return still;
}

Temperature take_off(Temperature found, Labelled& labelled) {
    for (LabelledRow& row : labelled.rows)
        for (std::size_t k = 0; k < row.channel.size(); ++k)
            row.channel[k] = at_reference(found, k, row.channel[k], row.temperature_C);  // NaN without a temperature
    return found;
}

// The known coefficients of the model relative to its dummy, with the handbook's scatter of both.
Temperature known_coefficients(const Calibration& calibration, const Temperature& dummy, const Rows& rows) {
    const TemperatureEffect& effect = *temperature_effect(calibration.model);
    const std::size_t n = calibration.channels.size();
    Temperature known = dummy;
    known.range_C = {kFilmRange_C[0], kFilmRange_C[1]};
    const Eigen::VectorXd mean = channels_of(rows).colwise().mean().transpose();
    known.zero.assign(mean.data(), mean.data() + n);
    known.zero_per_K.assign(n, effect.zero_per_K);
    known.gain_per_K.assign(n, 0);
    known.zero_per_K_sd.assign(n, effect.mismatch * effect.zero_per_K);
    known.gain_per_K_sd.assign(n, effect.gain_per_K);
    known.dummy_per_K_sd = effect.mismatch * effect.zero_per_K;
    return known;
}

}  // namespace

Temperature take_dummy(Labelled& labelled, const std::string& model, const std::string& channel_unit,
                       const DummyStated& stated) {
    const TemperatureEffect* const effect = temperature_effect(model);
    const std::string name = effect != nullptr ? std::string(effect->dummy) : "";
    const auto at =
        name.empty() ? labelled.channels.end() : std::find(labelled.channels.begin(), labelled.channels.end(), name);
    if (at == labelled.channels.end()) {
        if (std::isnan(stated.at_C) && std::isnan(stated.difference_K)) return {};
        throw SetupError(fmt::format("{}: --dummy-difference-K and --dummy-at-C describe a dummy, and {}", labelled.name,
                                     name.empty() ? fmt::format("model \"{}\" has none", model)
                                                  : fmt::format("the file has no column {} of it", name)));
    }
    if (!channel_unit.empty() && channel_unit != effect->channel_unit)
        throw SetupError(
            fmt::format("{}: the coefficient of the dummy {} is known in {}, and --channel-unit is {}: divide the "
                        "columns by the counts per {}",
                        labelled.name, name, effect->channel_unit, channel_unit, effect->channel_unit));
    const auto k = at - labelled.channels.begin();
    double sum = 0, sum_C = 0;
    std::size_t n = 0, n_C = 0;
    for (const LabelledRow& row : labelled.rows) {
        const double reading = row.channel[std::size_t(k)];
        if (std::isfinite(reading)) sum += reading, ++n;
        if (std::isfinite(row.temperature_C)) sum_C += row.temperature_C, ++n_C;
    }
    if (n == 0) throw SetupError(fmt::format("{}: column {} has no value", labelled.name, *at));
    Temperature dummy;
    dummy.reference_C = std::isfinite(stated.at_C) ? stated.at_C : n_C > 0 ? sum_C / double(n_C) : kNaN;
    dummy.dummy_difference_K = stated.difference_K;
    if (!std::isfinite(dummy.reference_C + dummy.dummy_difference_K))
        throw SetupError(
            fmt::format("{}: column {} is a dummy, which shows changes of temperature: state --dummy-difference-K 0.01, the "
                        "largest difference of temperature between it and another channel, and, without a column "
                        "temperature_C, --dummy-at-C 23, the temperature of the recording",
                        labelled.name, *at));
    dummy.dummy = *at;
    dummy.dummy_zero = sum / double(n);
    dummy.dummy_per_K = effect->zero_per_K;
    for (LabelledRow& row : labelled.rows) {
        row.temperature_C = dummy.of_dummy_C(row.channel[std::size_t(k)]);
        row.channel.erase(row.channel.begin() + k);
    }
    labelled.channels.erase(at);
    return dummy;
}

Temperature take_temperature_off(const Rows& all, Labelled& labelled, const Calibration& calibration,
                                 const Temperature& dummy, std::vector<std::string>& warnings) {
    Rows rows = rows_with(all, component_indices(calibration.components));
    std::erase_if(rows, [](const LabelledRow* row) { return !std::isfinite(row->temperature_C); });
    if (rows.empty()) return {};
    const auto otherwise = [&] {
        return dummy.dummy.empty() ? Temperature{} : take_off(known_coefficients(calibration, dummy, rows), labelled);
    };
    const auto [least, most] = std::minmax_element(
        rows.begin(), rows.end(), [](const auto* a, const auto* b) { return a->temperature_C < b->temperature_C; });
    const double lowest_C = (*least)->temperature_C, highest_C = (*most)->temperature_C;
    if (highest_C - lowest_C < kMinRange_K) {
        if (dummy.dummy.empty())
            warnings.push_back(fmt::format("temperature_C covers {:.1f} K: too little to learn zero and gain against it",
                                           highest_C - lowest_C));
        return otherwise();
    }
    Temperature found = dummy;
    found.range_C = {lowest_C, highest_C};
    Eigen::VectorXd from_K(Eigen::Index(rows.size()));
    for (Eigen::Index i = 0; i < from_K.size(); ++i) from_K[i] = rows[std::size_t(i)]->temperature_C;
    if (dummy.dummy.empty()) found.reference_C = from_K.mean();
    from_K.array() -= found.reference_C;
    const Eigen::MatrixXd load = loads_of_rows(rows, calibration);
    if (const Eigen::Index needed = Eigen::Index(kRowsPerCoefficient) * (load.cols() + 2); load.rows() < needed) {
        warnings.push_back(
            fmt::format("{} rows have a temperature; {} are needed to learn zero and gain against it", load.rows(), needed));
        return otherwise();
    }
    const Eigen::MatrixXd readings = channels_of(rows);
    for (std::size_t k = 0; k < calibration.channels.size(); ++k) {
        const ChannelFit one = fit_channel(load, from_K, readings.col(Eigen::Index(k)));
        found.zero.push_back(one.zero);
        found.zero_per_K.push_back(one.zero_per_K);
        found.gain_per_K.push_back(one.gain_per_K);
        found.zero_per_K_sd.push_back(one.zero_per_K_sd);
        found.gain_per_K_sd.push_back(one.gain_per_K_sd);
    }
    const auto still = std::count(found.zero_per_K.begin(), found.zero_per_K.end(), 0);
    if (still > 0 && !dummy.dummy.empty()) {
        const auto first = std::find(found.zero_per_K.begin(), found.zero_per_K.end(), 0) - found.zero_per_K.begin();
        warnings.push_back(fmt::format("channel {} does not follow the dummy {}: the coefficients are those of the model",
                                       calibration.channels[std::size_t(first)], dummy.dummy));
        return otherwise();
    }
    if (still == std::ptrdiff_t(found.zero_per_K.size())) {
        warnings.emplace_back("no channel follows temperature_C");
        return {};
    }
    return take_off(std::move(found), labelled);
}

}  // namespace tactiled
