#include "decoupling/fit/mixed_effects.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

constexpr int kRounds = 6;
constexpr std::size_t kEnough = 3000, kOfSession = 20;  // rows that determine gains and variances, evenly over each session
constexpr double kLeast = 1e-7;                         // noise relative to a channel's width: the last digit of a file
constexpr double kFarOff = 10;                          // sd of e: no zero explains such a row
constexpr double kNearRest = 0.1;                       // quantile of a session's loads: bends of these are in its zero

struct RowError {
    double reading, sd;
    const std::array<double, 6>& load;
    template <typename T>
    bool operator()(const T* common, const T* zero, T* error) const {
        T left = T(reading) - common[0] - zero[0];
        for (std::size_t c = 0; c < load.size(); ++c) left -= common[1 + c] * load[c];
        error[0] = left / T(sd);
        return true;
    }
};

// The zero of a session is near the common one.
struct ZeroPrior {
    double between;
    template <typename T>
    bool operator()(const T* zero, T* error) const {
        error[0] = zero[0] / T(between);
        return true;
    }
};

// Holds gains that no label determines.
struct GainPrior {
    template <typename T>
    bool operator()(const T* common, T* error) const {
        for (int i = 0; i < 7; ++i) error[i] = common[i] * 1e-3;
        return true;
    }
};

double magnitude(const std::array<double, 6>& load) {
    double most = 0;
    for (const double part : load) most = std::max(most, std::abs(part));
    return most;
}

double sd_at(const OneFit& fit, const std::array<double, 6>& load) {
    return std::hypot(fit.noise, fit.bend * magnitude(load));
}

double left_of(const OneChannel& channel, const OneFit& fit, std::size_t i) {
    double left = channel.reading[i] - fit.common[0] - fit.session_zero[channel.session[i]];
    for (std::size_t c = 0; c < 6; ++c) left -= fit.common[1 + c] * channel.load[i][c];
    return left;
}

// Weight of an error in Cauchy's loss.
double weight_of(double z) { return 1 / (1 + z * z / (kCauchyEfficient * kCauchyEfficient)); }

void solve(const OneChannel& channel, const ceres::LossFunction& loss, OneFit& fit) {
    ceres::Problem::Options owned;
    owned.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(owned);
    auto* const shared = const_cast<ceres::LossFunction*>(&loss);  // Ceres does not change it
    for (std::size_t i = 0; i < channel.reading.size(); ++i)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<RowError, 1, 7, 1>(
                                     new RowError{channel.reading[i], sd_at(fit, channel.load[i]), channel.load[i]}),
                                 shared, fit.common.data(), &fit.session_zero[channel.session[i]]);
    for (double& zero : fit.session_zero)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ZeroPrior, 1, 1>(new ZeroPrior{fit.between}), nullptr,
                                 &zero);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<GainPrior, 7, 7>(new GainPrior), nullptr, fit.common.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;  // the zeros of the sessions are eliminated first
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (double& zero : fit.session_zero) options.linear_solver_ordering->AddElementToGroup(&zero, 0);
    options.linear_solver_ordering->AddElementToGroup(fit.common.data(), 1);
    options.logging_type = ceres::SILENT;
    options.function_tolerance = 1e-10;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    fit.cost = summary.final_cost;
}

// Sets noise and bend from the errors, and the variance between sessions from their zeros and the uncertainty of these.
void set_variances(const OneChannel& channel, OneFit& fit) {
    Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    std::vector<double> information(channel.sessions, 1 / (fit.between * fit.between));
    // Mean of weight * z^2 for normal errors of sd 1.
    constexpr double kOfNormal = 0.697;
    for (std::size_t i = 0; i < channel.reading.size(); ++i) {
        const double left = left_of(channel, fit, i), sd = sd_at(fit, channel.load[i]), weight = weight_of(left / sd);
        const Eigen::Vector2d x(1, std::pow(magnitude(channel.load[i]), 2));
        const double here = weight * left * left / kOfNormal, trust = 1 / std::pow(sd, 4);
        squares += trust * x * x.transpose();
        right += trust * here * x;
        information[channel.session[i]] += weight / (sd * sd);
    }
    const double all = right[0] / squares(0, 0);  // without a bend
    // Loads of one size do not show a bend.
    const double determinant = squares.determinant();
    const double bend2 = determinant > 1e-9 * squares(0, 0) * squares(1, 1)
                             ? std::max(0.0, (squares(0, 0) * right[1] - squares(0, 1) * right[0]) / determinant)
                             : 0;
    const double noise2 = std::max(all - bend2 * squares(0, 1) / squares(0, 0), all * 1e-4);
    fit.bend = std::sqrt(bend2);
    fit.noise = std::max(kLeast, std::sqrt(noise2));
    double between2 = 0;
    for (std::size_t s = 0; s < channel.sessions; ++s)
        between2 += (fit.session_zero[s] * fit.session_zero[s] + 1 / information[s]) / double(channel.sessions);
    fit.between = std::max(kLeast, std::sqrt(between2));
}

// Loads relative to full scale; which rows determine gains and variances.
struct Prepared {
    std::vector<std::array<double, 6>> load;
    std::vector<std::size_t> chosen;
};

Prepared prepare(const MixedEffects& effects) {
    const Wrench full_scale = full_scales(effects.rows);
    Prepared result;
    std::vector<std::vector<std::size_t>> of_session(effects.index.size());
    for (std::size_t i = 0; i < effects.rows.size(); ++i) {
        of_session[effects.session[i]].push_back(i);
        auto& load = result.load.emplace_back();
        for (const std::size_t c : effects.components) load[c] = effects.rows[i]->wrench_S[c] / full_scale[c];
    }
    const std::size_t most = std::max(kOfSession, kEnough / of_session.size());
    for (const auto& rows : of_session)
        for (const std::size_t i : some_of(rows.size(), most)) result.chosen.push_back(rows[i]);
    return result;
}

// Sets the zeros of the sessions from all rows, with the uncertainty of each.
void set_session_zeros(const OneChannel& all, const OneFit& found, double width, Eigen::Index k, MixedEffects& effects) {
    OneFit fit = found;
    fit.session_zero.assign(all.sessions, 0.0);
    std::vector<double> information(all.sessions), sum(all.sessions);
    std::vector<std::vector<double>> load(all.sessions);
    for (std::size_t i = 0; i < all.reading.size(); ++i) {
        const std::size_t s = all.session[i];
        const double sd = sd_at(fit, all.load[i]), left = left_of(all, fit, i);
        const double weight = weight_of((left - found.session_zero[s]) / sd) / (sd * sd);
        information[s] += weight;
        sum[s] += weight * left;
        load[s].push_back(magnitude(all.load[i]));
    }
    for (std::size_t s = 0; s < all.sessions; ++s) {
        const double bend = fit.bend * quantile(load[s], kNearRest);  // not averaged
        effects.session_zero(Eigen::Index(s), k) = width * sum[s] / information[s];
        effects.own_sd(Eigen::Index(s), k) = width * std::hypot(1 / std::sqrt(information[s]), bend);
    }
}

}  // namespace

OneFit fit_one_channel(const OneChannel& channel, const std::vector<double>& start) {
    OneFit fit{.session_zero = std::vector<double>(channel.sessions), .noise = 0.1, .bend = 0.1, .between = 1};
    if (start.size() == 7 + channel.sessions) {
        std::copy(start.begin(), start.begin() + 7, fit.common.begin());
        std::copy(start.begin() + 7, start.end(), fit.session_zero.begin());
    }
    const ceres::HuberLoss huber(1.345);  // keeps 95 % of least squares' efficiency on normal errors
    const ceres::CauchyLoss cauchy(kCauchyEfficient);
    for (int round = 0; round < kRounds; ++round) {
        if (round < 2)
            solve(channel, huber, fit);
        else
            solve(channel, cauchy, fit);
        if (round + 1 < kRounds) set_variances(channel, fit);
    }
    return fit;
}

MixedEffects mixed_effects(const Labelled& labelled, const Rows& rows) {
    MixedEffects effects;
    for (std::size_t c = 0; c < 6; ++c)
        if (std::any_of(rows.begin(), rows.end(), [&](const auto* row) { return std::isfinite(row->wrench_S[c]); }))
            effects.components.push_back(c);
    Rows whole = rows_with(rows, effects.components);
    std::vector<std::size_t> number(labelled.sessions.size() + 1, labelled.sessions.size() + 1);
    for (const auto* row : whole) {
        std::size_t& here = number[std::min(row->session, labelled.sessions.size())];
        if (here > labelled.sessions.size()) {
            here = effects.index.size();
            effects.index.push_back(row->session);
        }
        effects.session.push_back(here);
    }
    if (whole.size() <= effects.index.size() + effects.components.size()) return effects;
    const Eigen::MatrixXd channels = channels_of(whole);
    const Eigen::RowVectorXd width = channels.colwise().maxCoeff() - channels.colwise().minCoeff();
    const Wrench full_scale = full_scales(whole);
    if (!(width.minCoeff() > 0) || std::any_of(effects.components.begin(), effects.components.end(),
                                               [&](std::size_t c) { return !(full_scale[c] > 0); }))
        return effects;
    effects.rows = std::move(whole);
    const Prepared prepared = prepare(effects);
    const auto n = channels.cols(), sessions = Eigen::Index(effects.index.size());
    effects.gain.resize(Eigen::Index(effects.components.size()), n);
    effects.zero.resize(n);
    effects.session_zero.resize(sessions, n);
    effects.own_sd.resize(sessions, n);
    effects.unloaded.resize(channels.rows(), n);
    std::vector<double> far(effects.rows.size());
    for (Eigen::Index k = 0; k < n; ++k) {
        OneChannel all{.reading = {}, .load = prepared.load, .session = effects.session, .sessions = std::size_t(sessions)};
        const double centre = channels.col(k).mean();
        for (Eigen::Index i = 0; i < channels.rows(); ++i) all.reading.push_back((channels(i, k) - centre) / width[k]);
        OneChannel some{.reading = {}, .load = {}, .session = {}, .sessions = all.sessions};
        for (const std::size_t i : prepared.chosen) {
            some.reading.push_back(all.reading[i]);
            some.load.push_back(all.load[i]);
            some.session.push_back(all.session[i]);
        }
        const OneFit fit = fit_one_channel(some);
        for (std::size_t c = 0; c < effects.components.size(); ++c)
            effects.gain(Eigen::Index(c), k) =
                width[k] * fit.common[1 + effects.components[c]] / full_scale[effects.components[c]];
        effects.zero[k] = centre + width[k] * fit.common[0];
        set_session_zeros(all, fit, width[k], k, effects);
        for (std::size_t i = 0; i < far.size(); ++i) {
            const double z = left_of(all, fit, i) / sd_at(fit, all.load[i]);
            far[i] += z * z / double(n);
        }
    }
    for (const double each : far) effects.agrees.push_back(each <= kFarOff * kFarOff);
    const Eigen::MatrixXd loads = labels_of(effects.rows, effects.components);
    effects.unloaded = (channels - loads * effects.gain).rowwise() - effects.zero;
    const Eigen::RowVectorXd mean = effects.session_zero.colwise().mean();
    effects.session_zero.rowwise() -= mean;
    effects.zero += mean;
    effects.unloaded.rowwise() -= mean;
    effects.zero_sd = Eigen::RowVectorXd::Zero(n);
    if (sessions > 1)
        effects.zero_sd = (effects.session_zero.colwise().squaredNorm() / double(sessions - 1) -
                           effects.own_sd.colwise().squaredNorm() / double(sessions))
                              .cwiseMax(0)
                              .cwiseSqrt();
    return effects;
}

}  // namespace tactiled
