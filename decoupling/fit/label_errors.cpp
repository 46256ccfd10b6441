#include "decoupling/fit/label_errors.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

// Models that are compared by their likelihood. Two degrees: a tail so long that the variance is infinite.
constexpr double kDegrees[] = {2, 4, 8, 30}, kGrowth[] = {0, 2, 8};
// Before the recording is known: one label of a hundred is wrong. It counts as much as this number of loads.
constexpr double kShareBefore = 0.01, kCountsAs = 50;
constexpr int kRounds = 25;
constexpr double kLeastOwn = 1e-6;  // variance of an error that the other components do not share: keeps it above rounding
constexpr std::size_t kEnough = 4000;          // loads that determine a mixture
constexpr std::size_t kInTime = 3;             // loads before and after
constexpr std::size_t kInChannels = 7;         // nearest loads
constexpr std::size_t kMaxCandidates = 2'000;  // loads among which they are searched, evenly over the recording

double log_student(double z, double degrees) {
    constexpr double kPi = 3.14159265358979;
    return std::lgamma((degrees + 1) / 2) - std::lgamma(degrees / 2) - 0.5 * std::log(degrees * kPi) -
           (degrees + 1) / 2 * std::log1p(z * z / degrees);
}

double scale_at(const ErrorMixture& mixture, double load) {
    return mixture.sd * std::sqrt(1 + mixture.growth * mixture.growth * load * load);
}

// Sets the probabilities and returns the logarithm of the likelihood.
double expect(const std::vector<double>& error, const std::vector<double>& load, double full_scale, ErrorMixture& mixture) {
    double sum = 0;
    mixture.wrong.resize(error.size());
    const double normalised = log_student(0, mixture.degrees), of_wrong = log_student(0, 1), half = full_scale / 2;
    for (std::size_t i = 0; i < error.size(); ++i) {
        const double scale = scale_at(mixture, load[i]), z = error[i] / scale;
        const double as_wrong = mixture.share / half * std::exp(of_wrong - std::log1p(std::pow(error[i] / half, 2)));
        const double as_right = (1 - mixture.share) / scale *
                                std::exp(normalised - (mixture.degrees + 1) / 2 * std::log1p(z * z / mixture.degrees));
        mixture.wrong[i] = as_wrong / (as_wrong + as_right);
        sum += std::log(as_wrong + as_right);
    }
    return sum;
}

void maximise(const std::vector<double>& error, const std::vector<double>& load, double least, ErrorMixture& mixture) {
    double squares = 0, right = 0;
    for (std::size_t i = 0; i < error.size(); ++i) {
        const double growth2 = 1 + std::pow(mixture.growth * load[i], 2), e2 = error[i] * error[i] / growth2;
        const double weight = (mixture.degrees + 1) / (mixture.degrees + e2 / (mixture.sd * mixture.sd));
        squares += (1 - mixture.wrong[i]) * weight * e2;
        right += 1 - mixture.wrong[i];
    }
    mixture.sd = std::max(least, std::sqrt(squares / std::max(1.0, right)));
    mixture.share = (double(error.size()) - right + kShareBefore * kCountsAs) / (double(error.size()) + kCountsAs);
}

std::vector<double> some_of(const std::vector<double>& values, std::size_t every) {
    std::vector<double> some;
    for (std::size_t i = 0; i < values.size(); i += every) some.push_back(values[i]);
    return some;
}

// Returns the median error of the neighbours whose labels are not likely to be wrong; 0 without one.
double shared_error(const std::vector<Load>& loads, const std::vector<std::size_t>& neighbours, std::size_t c,
                    const std::vector<Wrench>& wrong) {
    std::vector<double> errors;
    for (const std::size_t l : neighbours)
        if (std::isfinite(loads[l].error[c]) && !(wrong[l][c] > 0.5)) errors.push_back(loads[l].error[c]);
    return errors.empty() ? 0 : median(std::move(errors));
}

// The loads of one component, in their order.
struct OfComponent {
    std::vector<std::size_t> index;
    std::vector<double> error, load;
};

OfComponent of_component(const std::vector<Load>& loads, std::size_t c, const Wrench& full_scale) {
    OfComponent of;
    for (std::size_t l = 0; l < loads.size(); ++l) {
        if (!std::isfinite(loads[l].error[c])) continue;
        double load = 0;
        for (std::size_t other = 0; other < full_scale.size(); ++other)
            if (full_scale[other] > 0 && std::isfinite(loads[l].estimate[other]))
                load = std::max(load, std::abs(loads[l].estimate[other]) / full_scale[other]);
        of.index.push_back(l);
        of.error.push_back(loads[l].error[c]);
        of.load.push_back(std::min(1.0, load));
    }
    return of;
}

// Subtracts from each error the part that the neighbours share: least squares with the weights of the mixture.
void take_shared_off(const std::vector<Load>& loads, const Neighbours& neighbours, std::size_t c, double full_scale,
                     OfComponent& of, std::vector<Wrench>& wrong) {
    const auto n = Eigen::Index(of.index.size());
    for (int round = 0; round < 2; ++round) {
        const ErrorMixture mixture = error_mixture(of.error, of.load, full_scale);
        for (std::size_t i = 0; i < of.index.size(); ++i) wrong[of.index[i]][c] = mixture.wrong[i];
        Eigen::MatrixXd shared(n, 2), weighted(n, 2);
        Eigen::VectorXd error(n);
        for (Eigen::Index i = 0; i < n; ++i) {
            const std::size_t l = of.index[std::size_t(i)];
            shared.row(i) << shared_error(loads, neighbours.in_time[l], c, wrong),
                shared_error(loads, neighbours.in_channels[l], c, wrong);
            const double scale = scale_at(mixture, of.load[std::size_t(i)]), z = of.error[std::size_t(i)] / scale;
            const double weight =
                std::sqrt((1 - mixture.wrong[std::size_t(i)]) * (mixture.degrees + 1) / (mixture.degrees + z * z)) / scale;
            weighted.row(i) = weight * shared.row(i);
            error[i] = weight * loads[l].error[c];
        }
        const Eigen::VectorXd part = dense::least_norm_of_one(weighted, error).cwiseMax(0).cwiseMin(1);
        const Eigen::VectorXd explained = shared * part;
        for (Eigen::Index i = 0; i < n; ++i)
            of.error[std::size_t(i)] = loads[of.index[std::size_t(i)]].error[c] - explained[i];
    }
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
            error_mixture({own.col(k).begin(), own.col(k).end()}, std::vector<double>(whole.size()), full_scale);
        for (std::size_t i = 0; i < whole.size(); ++i) {
            double& here = wrong[whole[i]][component];
            here = std::max(here, mixture.wrong[i]);
        }
    }
}

}  // namespace

std::vector<Load> loads_of_same_label(const Rows& rows) {
    std::vector<Load> loads;
    Rows by_time = rows;
    std::stable_sort(by_time.begin(), by_time.end(), [](const LabelledRow* a, const LabelledRow* b) {
        return a->session != b->session ? a->session < b->session : a->t_ns < b->t_ns;
    });
    for (const auto* row : by_time) {
        if (loads.empty() || loads.back().rows.front()->session != row->session ||
            !is_same_label(loads.back().label, row->wrench_S))
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
        std::array<std::vector<double>, 6> estimates;
        for (const auto* row : load.rows) {
            const Wrench wrench_S = decoupler->decouple({.channel = row->channel, .t_ns = row->t_ns}).wrench_S;
            for (std::size_t c = 0; c < 6; ++c)
                if (std::isfinite(wrench_S[c])) estimates[c].push_back(wrench_S[c]);
        }
        for (std::size_t c = 0; c < 6; ++c) {
            load.estimate[c] = median(estimates[c]);
            load.error[c] = load.estimate[c] - load.label[c];
        }
    }
}

ErrorMixture error_mixture(const std::vector<double>& error, const std::vector<double>& load, double full_scale) {
    const std::size_t every = 1 + error.size() / kEnough;
    const std::vector<double> some = some_of(error, every), some_loads = some_of(load, every);
    std::vector<double> sizes;
    for (const double each : some) sizes.push_back(std::abs(each));
    const double least = 1e-9 * full_scale, typical = std::max(least, kRobustSd * median(std::move(sizes)));
    ErrorMixture best;
    double most = -std::numeric_limits<double>::infinity();
    for (const double degrees : kDegrees)
        for (const double growth : kGrowth) {
            ErrorMixture mixture{.sd = typical / std::sqrt(1 + growth * growth / 4),
                                 .growth = growth,
                                 .degrees = degrees,
                                 .share = kShareBefore,
                                 .wrong = {}};
            double likelihood = 0;
            for (int round = 0; round < kRounds; ++round) {
                likelihood = expect(some, some_loads, full_scale, mixture);
                maximise(some, some_loads, least, mixture);
            }
            if (likelihood > most) most = likelihood, best = mixture;
        }
    expect(error, load, full_scale, best);
    return best;
}

Neighbours neighbours_of(const std::vector<Load>& loads) {
    Neighbours neighbours;
    const auto n = Eigen::Index(loads.size()), channels = Eigen::Index(loads.front().channel.size());
    const std::size_t every = 1 + loads.size() / kMaxCandidates;
    std::vector<std::size_t> candidates;
    for (std::size_t l = 0; l < loads.size(); l += every) candidates.push_back(l);
    Eigen::MatrixXd at(Eigen::Index(candidates.size()), channels);
    for (Eigen::Index i = 0; i < at.rows(); ++i)
        at.row(i) = Eigen::Map<const Eigen::RowVectorXd>(loads[candidates[std::size_t(i)]].channel.data(), channels);
    const Eigen::VectorXd squares = at.rowwise().squaredNorm();
    for (Eigen::Index l = 0; l < n; ++l) {
        const auto here = std::size_t(l);
        auto& in_time = neighbours.in_time.emplace_back();
        for (std::size_t j = here < kInTime ? 0 : here - kInTime; j < std::min(loads.size(), here + kInTime + 1); ++j)
            if (j != here && loads[j].rows.front()->session == loads[here].rows.front()->session) in_time.push_back(j);
        const Eigen::VectorXd d2 =
            squares - 2 * at * Eigen::Map<const Eigen::VectorXd>(loads[here].channel.data(), channels);
        std::vector<Eigen::Index> order(candidates.size());
        std::iota(order.begin(), order.end(), Eigen::Index{0});
        const auto end = order.begin() + std::ptrdiff_t(std::min(kInChannels + 1, order.size()));
        std::partial_sort(order.begin(), end, order.end(), [&](Eigen::Index a, Eigen::Index b) { return d2[a] < d2[b]; });
        auto& in_channels = neighbours.in_channels.emplace_back();
        for (auto each = order.begin(); each != end; ++each)
            if (candidates[std::size_t(*each)] != here) in_channels.push_back(candidates[std::size_t(*each)]);
    }
    return neighbours;
}

LabelErrors label_errors(const std::vector<Load>& loads, const Neighbours& neighbours, const Wrench& full_scale) {
    LabelErrors result{.wrong = std::vector<Wrench>(loads.size(), kUnseen), .own = {}};
    result.own = result.wrong;
    std::vector<Standardised> all;
    for (std::size_t c = 0; c < full_scale.size(); ++c) {
        if (!(full_scale[c] > 0)) continue;
        OfComponent of = of_component(loads, c, full_scale);
        take_shared_off(loads, neighbours, c, full_scale[c], of, result.wrong);
        const ErrorMixture mixture = error_mixture(of.error, of.load, full_scale[c]);
        Standardised& one = all.emplace_back();
        one.component = c;
        one.z = Eigen::VectorXd::Constant(Eigen::Index(loads.size()), kNaN);
        for (std::size_t i = 0; i < of.index.size(); ++i) {
            const std::size_t l = of.index[i];
            result.wrong[l][c] = mixture.wrong[i];
            result.own[l][c] = of.error[i];
            one.z[Eigen::Index(l)] = of.error[i] / scale_at(mixture, of.load[i]);
        }
        one.full_scale = full_scale[c] / scale_at(mixture, median(of.load));
    }
    if (all.size() > 1) judge_together(all, result.wrong);
    return result;
}

}  // namespace tactiled
