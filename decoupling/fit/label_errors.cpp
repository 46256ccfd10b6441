#include "decoupling/fit/label_errors.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

// Models that are compared by their likelihood. Two degrees: a tail so long that the variance is infinite.
constexpr double kDegrees[] = {2, 4, 8, 30}, kFollows[] = {0, 0.5, 1};
// Share of wrong labels, in tables that were typed. Its limits are stated, because a long tail explains wrong labels as
// well.
constexpr double kLeastShare = 0.01, kMostShare = 0.05;
constexpr int kRounds = 25, kRoundsOfShared = 2;
constexpr double kNoGain = 0.01;    // logarithm of the likelihood
constexpr double kLeastOwn = 1e-6;  // variance of an error that the other components do not share: keeps it above rounding
constexpr std::size_t kEnough = 4000;  // loads that determine a mixture
// Loads before and after, and nearest loads: those that share an error, and those that show its size.
constexpr std::size_t kInTime = 3, kInTimeOfSize = 10, kInChannels = 7, kInChannelsOfSize = 15;
constexpr std::size_t kMaxCandidates = 2'000;  // loads among which the nearest are searched, evenly over the recording
constexpr double kSmallest = 0.25;             // size of the errors around a load, relative to that of all

double log_student(double z, double degrees) {
    return std::lgamma((degrees + 1) / 2) - std::lgamma(degrees / 2) - 0.5 * std::log(degrees * std::numbers::pi) -
           (degrees + 1) / 2 * std::log1p(z * z / degrees);
}

double scale_at(const ErrorMixture& mixture, double size) { return mixture.sd * std::pow(size, mixture.follows); }

// Sets the probabilities and returns the logarithm of the likelihood. `scale`: of each error, for an sd of 1.
double expect(const std::vector<double>& error, const std::vector<double>& scale, double full_scale, ErrorMixture& mixture) {
    double sum = 0;
    mixture.wrong.resize(error.size());
    const double half = full_scale / 2, of_wrong = mixture.share / half * std::exp(log_student(0, 1));
    const double of_right = (1 - mixture.share) * std::exp(log_student(0, mixture.degrees));
    for (std::size_t i = 0; i < error.size(); ++i) {
        const double here = mixture.sd * scale[i], z = error[i] / here, from_half = error[i] / half;
        const double as_wrong = of_wrong / (1 + from_half * from_half);
        const double as_right = of_right / here * std::pow(1 + z * z / mixture.degrees, -(mixture.degrees + 1) / 2);
        mixture.wrong[i] = as_wrong / (as_wrong + as_right);
        sum += std::log(as_wrong + as_right);
    }
    return sum;
}

void maximise(const std::vector<double>& error, const std::vector<double>& scale, double least, ErrorMixture& mixture) {
    double squares = 0, right = 0;
    for (std::size_t i = 0; i < error.size(); ++i) {
        const double z2 = std::pow(error[i] / (mixture.sd * scale[i]), 2);
        squares += (1 - mixture.wrong[i]) * (mixture.degrees + 1) / (mixture.degrees + z2) * z2;
        right += 1 - mixture.wrong[i];
    }
    mixture.sd = std::max(least, mixture.sd * std::sqrt(squares / std::max(1.0, right)));
    mixture.share = std::clamp(1 - right / double(error.size()), kLeastShare, kMostShare);
}

// Returns the median of the first `most` values of the neighbours, or `otherwise`. A few wrong labels do not change it, and
// a range in which the sensor bends has no others.
double median_around(const std::vector<double>& values, const std::vector<std::size_t>& neighbours, std::size_t most,
                     double otherwise) {
    std::vector<double> around;
    for (const std::size_t l : neighbours)
        if (around.size() < most && std::isfinite(values[l])) around.push_back(values[l]);
    return around.empty() ? otherwise : median(std::move(around));
}

// One component of all loads: NaN without a label.
struct OneComponent {
    std::vector<double> error, own, size, wrong;
};

// The size of the errors around each load, relative to that of all, where both kinds of neighbours have the greater one.
void set_sizes(const Neighbours& neighbours, OneComponent& of) {
    std::vector<double> magnitude, known;
    for (const double own : of.own) {
        magnitude.push_back(std::abs(own));
        if (std::isfinite(own)) known.push_back(std::abs(own));
    }
    const double all = median(known);
    for (std::size_t l = 0; all > 0 && l < magnitude.size(); ++l) {
        const double in_time = median_around(magnitude, neighbours.in_time[l], 2 * kInTimeOfSize, all);
        const double alike = median_around(magnitude, neighbours.in_channels[l], kInChannelsOfSize, all);
        of.size[l] = std::max(kSmallest, std::max(in_time, alike) / all);
    }
}

struct Known {
    std::vector<std::size_t> index;
    std::vector<double> own, size;
};

Known known_of(const OneComponent& of) {
    Known known;
    for (std::size_t l = 0; l < of.own.size(); ++l)
        if (std::isfinite(of.own[l])) {
            known.index.push_back(l);
            known.own.push_back(of.own[l]);
            known.size.push_back(of.size[l]);
        }
    return known;
}

ErrorMixture mixture_of(OneComponent& of, double full_scale) {
    const Known known = known_of(of);
    const ErrorMixture mixture = error_mixture(known.own, known.size, full_scale);
    for (std::size_t i = 0; i < known.index.size(); ++i) of.wrong[known.index[i]] = mixture.wrong[i];
    return mixture;
}

// Subtracts from each error the part that the neighbours share: least squares with the weights of the mixture.
void take_shared_off(const Neighbours& neighbours, const ErrorMixture& mixture, OneComponent& of) {
    const Known known = known_of(of);
    const auto n = Eigen::Index(known.index.size());
    Eigen::MatrixXd shared(n, 2), weighted(n, 2);
    Eigen::VectorXd error(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const std::size_t l = known.index[std::size_t(i)];
        shared.row(i) << median_around(of.error, neighbours.in_time[l], 2 * kInTime, 0),
            median_around(of.error, neighbours.in_channels[l], kInChannels, 0);
        const double scale = scale_at(mixture, of.size[l]), z = of.own[l] / scale;
        const double weight = std::sqrt((1 - of.wrong[l]) * (mixture.degrees + 1) / (mixture.degrees + z * z)) / scale;
        weighted.row(i) = weight * shared.row(i);
        error[i] = weight * of.error[l];
    }
    const Eigen::VectorXd explained = shared * dense::least_norm_of_one(weighted, error).cwiseMax(0).cwiseMin(1);
    for (Eigen::Index i = 0; i < n; ++i)
        of.own[known.index[std::size_t(i)]] = of.error[known.index[std::size_t(i)]] - explained[i];
}

// The errors of one component in their scale; NaN without a label.
struct Standardised {
    std::size_t component = 0;
    Eigen::VectorXd z;
    double full_scale = 0;  // in the scale of a usual load
};

// Errors of one cause are in proportion in all components; the error of a label is in one. Judges the error of each
// component minus what the others predict, for loads with all labels.
void judge_together(const std::vector<Standardised>& all, std::vector<Wrench>& wrong) {
    const auto m = Eigen::Index(all.size());
    std::vector<std::size_t> whole;
    for (std::size_t l = 0; l < wrong.size(); ++l)
        if (std::all_of(all.begin(), all.end(), [&](const auto& one) { return std::isfinite(one.z[Eigen::Index(l)]); }))
            whole.push_back(l);
    if (Eigen::Index(whole.size()) <= m) return;
    Eigen::MatrixXd z(Eigen::Index(whole.size()), m), weighted(z.rows(), m);
    for (Eigen::Index i = 0; i < z.rows(); ++i) {
        double most = 0;
        for (Eigen::Index k = 0; k < m; ++k) {
            z(i, k) = all[std::size_t(k)].z[Eigen::Index(whole[std::size_t(i)])];
            most = std::max(most, wrong[whole[std::size_t(i)]][all[std::size_t(k)].component]);
        }
        weighted.row(i) = z.row(i) * ((1 - most) / (1 + z.row(i).squaredNorm() / double(m)));
    }
    const Eigen::MatrixXd covariance = weighted.transpose() * z / double(z.rows());
    const Eigen::MatrixXd precision = dense::inverse(covariance + kLeastOwn * Eigen::MatrixXd::Identity(m, m));
    const Eigen::MatrixXd own = (z * precision).array().rowwise() / precision.diagonal().transpose().array();
    for (Eigen::Index k = 0; k < m; ++k) {
        const auto& [component, unused, full_scale] = all[std::size_t(k)];
        const ErrorMixture mixture =
            error_mixture({own.col(k).begin(), own.col(k).end()}, std::vector<double>(whole.size(), 1.0), full_scale);
        for (std::size_t i = 0; i < whole.size(); ++i) {
            double& here = wrong[whole[i]][component];
            here = std::max(here, mixture.wrong[i]);
        }
    }
}

// Rows of one load: every label within 1 % of full scale of that of the first.
bool is_held(const LabelledRow& first, const LabelledRow& row, const Wrench& full_scale) {
    bool held = first.session == row.session;
    for (std::size_t c = 0; c < full_scale.size(); ++c)
        held = held && std::isnan(first.wrench_S[c]) == std::isnan(row.wrench_S[c]) &&
               !(std::abs(row.wrench_S[c] - first.wrench_S[c]) > kSameLoad * full_scale[c]);
    return held;
}

}  // namespace

std::vector<Load> loads_of_same_label(const Rows& rows, const Wrench& full_scale) {
    std::vector<Load> loads;
    Rows by_time = rows;
    std::stable_sort(by_time.begin(), by_time.end(), [](const LabelledRow* a, const LabelledRow* b) {
        return a->session != b->session ? a->session < b->session : a->t_ns < b->t_ns;
    });
    for (const auto* row : by_time) {
        if (loads.empty() || !is_held(*loads.back().rows.front(), *row, full_scale))
            loads.push_back({.rows = {}, .label = row->wrench_S, .error = {}, .estimate = {}, .channel = {}});
        loads.back().rows.push_back(row);
    }
    const std::size_t n = rows.front()->channel.size();
    std::vector<double> sum(n), squares(n);
    for (const auto* row : rows)
        for (std::size_t k = 0; k < n; ++k) sum[k] += row->channel[k] / double(rows.size());
    for (const auto* row : rows)
        for (std::size_t k = 0; k < n; ++k) squares[k] += std::pow(row->channel[k] - sum[k], 2) / double(rows.size());
    for (Load& load : loads) {
        load.channel.assign(n, 0.0);
        for (const auto* row : load.rows)
            for (std::size_t k = 0; k < n; ++k)
                if (squares[k] > 0)
                    load.channel[k] += (row->channel[k] - sum[k]) / std::sqrt(squares[k]) / double(load.rows.size());
    }
    return loads;
}

void estimate_loads(const Calibration& calibration, std::vector<Load>& loads) {
    const auto decoupler = make_decoupler(calibration);
    for (Load& load : loads)
        for (std::size_t c = 0; c < 6; ++c) load.error[c] = load.estimate[c] = kNaN;
    for (Load& load : loads) {
        std::array<std::vector<double>, 6> estimates, errors;
        for (const auto* row : load.rows) {
            const Wrench wrench_S = decoupler->decouple({.channel = row->channel, .t_ns = row->t_ns}).wrench_S;
            for (std::size_t c = 0; c < 6; ++c) {
                if (!std::isfinite(wrench_S[c])) continue;
                estimates[c].push_back(wrench_S[c]);
                errors[c].push_back(wrench_S[c] - row->wrench_S[c]);
            }
        }
        for (std::size_t c = 0; c < 6; ++c) {
            load.estimate[c] = median(estimates[c]);
            load.error[c] = median(errors[c]);
        }
    }
}

ErrorMixture error_mixture(const std::vector<double>& error, const std::vector<double>& size, double full_scale) {
    std::vector<double> some, some_sizes;
    for (const std::size_t i : some_of(error.size(), kEnough)) some.push_back(error[i]), some_sizes.push_back(size[i]);
    std::vector<double> magnitudes;
    for (const double each : some) magnitudes.push_back(std::abs(each));
    const double least = 1e-9 * full_scale, typical = std::max(least, kRobustSd * median(std::move(magnitudes)));
    ErrorMixture best;
    double most = -std::numeric_limits<double>::infinity();
    for (const double follows : kFollows) {
        const auto scales = [&](std::vector<double> sizes) {
            for (double& each : sizes) each = std::pow(each, follows);
            return sizes;
        };
        const std::vector<double> scale = scales(some_sizes);
        for (const double degrees : kDegrees) {
            ErrorMixture mixture{.sd = typical, .follows = follows, .degrees = degrees, .share = kLeastShare, .wrong = {}};
            double likelihood = 0;
            for (int round = 0; round < kRounds; ++round) {
                const double before = likelihood;
                likelihood = expect(some, scale, full_scale, mixture);
                maximise(some, scale, least, mixture);
                if (round > 0 && likelihood - before < kNoGain) break;
            }
            if (likelihood > most) most = likelihood, best = mixture;
        }
        if (follows == best.follows) expect(error, scales(size), full_scale, best);
    }
    return best;
}

Neighbours neighbours_of(const std::vector<Load>& loads) {
    Neighbours neighbours;
    const std::vector<std::size_t> candidates = some_of(loads.size(), kMaxCandidates);
    const auto channels = Eigen::Index(loads.front().channel.size());
    Eigen::MatrixXd at(Eigen::Index(candidates.size()), channels);
    for (Eigen::Index i = 0; i < at.rows(); ++i)
        at.row(i) = Eigen::Map<const Eigen::RowVectorXd>(loads[candidates[std::size_t(i)]].channel.data(), channels);
    const Eigen::VectorXd squares = at.rowwise().squaredNorm();
    std::vector<Eigen::Index> order(candidates.size());
    for (std::size_t here = 0; here < loads.size(); ++here) {
        auto& in_time = neighbours.in_time.emplace_back();
        for (std::size_t away = 1; away <= kInTimeOfSize; ++away)
            for (const std::size_t j : {here - away, here + away})  // before the first one: beyond the last one
                if (j < loads.size() && loads[j].rows.front()->session == loads[here].rows.front()->session)
                    in_time.push_back(j);
        const Eigen::VectorXd d2 =
            squares - 2 * at * Eigen::Map<const Eigen::VectorXd>(loads[here].channel.data(), channels);
        order.clear();
        for (std::size_t i = 0; i < candidates.size(); ++i)
            if (candidates[i] != here) order.push_back(Eigen::Index(i));
        const auto last = order.begin() + std::ptrdiff_t(std::min(kInChannelsOfSize, order.size()));
        std::partial_sort(order.begin(), last, order.end(), [&](Eigen::Index a, Eigen::Index b) { return d2[a] < d2[b]; });
        auto& in_channels = neighbours.in_channels.emplace_back();
        for (auto each = order.begin(); each != last; ++each) in_channels.push_back(candidates[std::size_t(*each)]);
    }
    return neighbours;
}

std::vector<Wrench> wrong_labels(const std::vector<Load>& loads, const Neighbours& neighbours, const Wrench& full_scale) {
    std::vector<Wrench> wrong(loads.size(), kUnseen);
    std::vector<Standardised> all;
    for (std::size_t c = 0; c < full_scale.size(); ++c) {
        if (!(full_scale[c] > 0)) continue;
        OneComponent of{.error = {},
                        .own = {},
                        .size = std::vector<double>(loads.size(), 1.0),
                        .wrong = std::vector<double>(loads.size())};
        for (const Load& load : loads) of.error.push_back(load.error[c]);
        of.own = of.error;
        ErrorMixture mixture = mixture_of(of, full_scale[c]);
        for (int round = 0; round < kRoundsOfShared; ++round) {
            take_shared_off(neighbours, mixture, of);
            set_sizes(neighbours, of);
            mixture = mixture_of(of, full_scale[c]);
        }
        Standardised& one = all.emplace_back(Standardised{
            .component = c, .z = Eigen::VectorXd(Eigen::Index(loads.size())), .full_scale = full_scale[c] / mixture.sd});
        for (std::size_t l = 0; l < loads.size(); ++l) {
            one.z[Eigen::Index(l)] = of.own[l] / scale_at(mixture, of.size[l]);
            if (std::isfinite(of.own[l])) wrong[l][c] = of.wrong[l];
        }
    }
    if (all.size() > 1) judge_together(all, wrong);
    return wrong;
}

}  // namespace tactiled
