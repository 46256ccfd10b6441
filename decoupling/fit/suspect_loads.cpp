#include "decoupling/fit/suspect_loads.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/least_squares.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

// A load is suspected beyond the median magnitude of the errors times (their 90 % quantile over their median)^kTail:
// 5.2 standard deviations of normal errors, 10 of errors with the tails of Student's distribution of three degrees.
// It is left out beyond kSurely times that: keeping a wrong row does less harm than losing a good one.
constexpr double kTail = 2.3, kSurely = 1.5;
constexpr double kLeast = 2.2;  // times the median, for errors with a short tail
constexpr double kInner = 0.9;  // share of the loads that define the directions of large errors
constexpr Eigen::Index kLoadsPerAxis = 20;
constexpr std::ptrdiff_t kBefore = 3;   // number of loads before and after, whose median error is the slow part
constexpr double kSlow = 0.7;           // scatter without over scatter with the slow part; below this it is subtracted
constexpr std::ptrdiff_t kAround = 15;  // number of loads before and after that define the local size of errors
constexpr std::size_t kNeighbours = 5;  // number of nearest loads in the channels
constexpr std::size_t kMaxCandidates = 20'000;  // number of loads among which they are searched, evenly over the recording
constexpr double kShared = 0.5;                 // share of its error that the neighbours have, too
constexpr double kBeyond = 0.02;                // relative to full scale
constexpr double kBends = 2, kNearEnd = 0.9;
constexpr std::size_t kRunOfMany = 3;  // consecutive suspects are not mistyped labels if errors are slow

std::vector<double> sizes_of(const std::vector<double>& values) {
    std::vector<double> sizes;
    for (const double value : values)
        if (std::isfinite(value)) sizes.push_back(std::abs(value));
    return sizes;
}

// Returns the errors minus the median of those before and after, if that reduces them clearly.
std::vector<double> without_slow_part(const std::vector<Load>& loads, const std::vector<double>& error, bool& slow) {
    std::vector<double> fast(error.size());
    const auto n = std::ptrdiff_t(loads.size());
    for (std::ptrdiff_t i = 0; i < n; ++i) {
        std::vector<double> around;
        for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, i - kBefore); j <= std::min(n - 1, i + kBefore); ++j)
            if (j != i && std::isfinite(error[std::size_t(j)]) &&
                loads[std::size_t(j)].rows.front()->session == loads[std::size_t(i)].rows.front()->session)
                around.push_back(error[std::size_t(j)]);
        fast[std::size_t(i)] = error[std::size_t(i)] - (around.empty() ? 0 : median(around));
    }
    slow = median(sizes_of(fast)) < kSlow * median(sizes_of(error));
    return slow ? fast : error;
}

// Returns the robust standard deviation of the errors around each load: in time if they change slowly, else in load.
std::vector<double> scale_around(const std::vector<Load>& loads, const std::vector<double>& error, std::size_t c,
                                 bool slow) {
    const double of_all = kRobustSd * median(sizes_of(error));
    std::vector<std::size_t> order(loads.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    if (!slow)
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            return std::abs(loads[a].estimate[c]) < std::abs(loads[b].estimate[c]);
        });
    std::erase_if(order, [&](std::size_t i) { return !std::isfinite(error[i]); });
    std::vector<double> scale(loads.size(), of_all);
    const auto n = std::ptrdiff_t(order.size()), around = slow ? kAround : std::max(kAround, n / 10);
    if (n < 4 * kAround) return scale;
    const std::ptrdiff_t every = std::max<std::ptrdiff_t>(1, around / 15);  // they change slowly with the place
    for (std::ptrdiff_t i = 0; i < n; i += every) {
        std::vector<double> sizes;
        for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, i - around); j <= std::min(n - 1, i + around); ++j)
            if (j != i) sizes.push_back(std::abs(error[order[std::size_t(j)]]));
        const double here = std::max(kRobustSd * median(std::move(sizes)), of_all / 2);
        for (std::ptrdiff_t j = i; j < std::min(n, i + every); ++j) scale[order[std::size_t(j)]] = here;
    }
    return scale;
}

// Returns the components' errors of each load in their own scales, with their signs; 0 where there is no label.
std::vector<std::vector<double>> scaled_errors(const std::vector<Load>& loads, const std::vector<std::size_t>& components,
                                               const Wrench& full_scale, bool& slow) {
    std::vector<std::vector<double>> z(loads.size(), std::vector<double>(components.size()));
    slow = false;
    for (std::size_t i = 0; i < components.size(); ++i) {
        const std::size_t c = components[i];
        std::vector<double> error;
        for (const Load& load : loads) error.push_back(load.error[c]);
        bool slow_here = false;
        const std::vector<double> fast = without_slow_part(loads, error, slow_here);
        const std::vector<double> scale = scale_around(loads, fast, c, slow_here);
        slow = slow || slow_here;
        for (std::size_t l = 0; l < loads.size(); ++l)
            if (std::isfinite(fast[l])) z[l][i] = fast[l] / std::max(scale[l], 1e-9 * full_scale[c]);
    }
    return z;
}

// Returns true if the load is at the end of the range, where a nonlinearity of the sensor cannot be distinguished
// from a wrong label. `min` and `max` are the limits of the labels that agree.
bool at_the_end(double label, double estimate, double min, double max, double full_scale) {
    if (!std::isfinite(label) || !std::isfinite(estimate)) return false;
    const double beyond = std::max(estimate - max, min - estimate);
    const bool label_too = estimate > max ? label > max : label < min;
    // A step beyond the range cannot be reduced by a nonlinearity to a value far inside the range.
    if (beyond > kBeyond * full_scale && (label_too || std::abs(label - estimate) <= kBends * beyond)) return true;
    // A saturated sensor reads the end of the range.
    return (label > max && max > 0 && estimate >= kNearEnd * max) || (label < min && min < 0 && estimate <= kNearEnd * min);
}

// Returns the length of each row of `z` in the metric in which its inner nine tenths are isotropic: errors of one
// cause are correlated, the error of a wrong label is not.
std::vector<double> lengths_of(const std::vector<std::vector<double>>& z) {
    const auto n = Eigen::Index(z.size()), m = Eigen::Index(z.front().size());
    Eigen::MatrixXd all(n, m);
    for (Eigen::Index i = 0; i < n; ++i) all.row(i) = Eigen::Map<const Eigen::RowVectorXd>(z[std::size_t(i)].data(), m);
    Eigen::VectorXd length = all.rowwise().norm();
    if (m > 1 && n > kLoadsPerAxis * m)
        for (int round = 0; round < 3; ++round) {
            const double inner = quantile(std::vector<double>(length.data(), length.data() + n), kInner);
            Eigen::MatrixXd covariance = 1e-6 * Eigen::MatrixXd::Identity(m, m);
            double count = 0;
            for (Eigen::Index i = 0; i < n; ++i)
                if (length[i] <= inner) {
                    covariance += all.row(i).transpose() * all.row(i);
                    ++count;
                }
            const Eigen::MatrixXd root = dense::lower_factor(covariance / std::max(1.0, count));
            length = dense::solve_lower(root, all.transpose()).colwise().norm().transpose();
        }
    return {length.data(), length.data() + n};
}

// Returns the limit above which a number is in the tail.
double limit_of(const std::vector<double>& sizes) {
    const double half = quantile(sizes, 0.5), most = quantile(sizes, 0.9);
    if (!(half > 0)) return std::max(kLeast, most);
    return half * std::max(kLeast, std::pow(most / half, kTail));
}

// Returns the median error of the loads that are nearest in the channels, without `suspected` ones and those with the
// same label.
Wrench error_nearby(const std::vector<Load>& loads, std::size_t of, const std::vector<bool>& suspected) {
    std::vector<std::pair<double, std::size_t>> near;
    const std::size_t every = std::max<std::size_t>(1, loads.size() / kMaxCandidates);
    for (std::size_t l = 0; l < loads.size(); l += every) {
        if (l == of || suspected[l]) continue;
        double d2 = 0;
        for (std::size_t k = 0; k < loads[l].channel.size(); ++k)
            d2 += std::pow(loads[l].channel[k] - loads[of].channel[k], 2);
        near.emplace_back(d2, l);
    }
    const std::size_t n = std::min(kNeighbours, near.size());
    std::partial_sort(near.begin(), near.begin() + std::ptrdiff_t(n), near.end());
    Wrench result = kUnseen;
    for (std::size_t c = 0; c < 6; ++c) {
        std::vector<double> errors;
        for (std::size_t i = 0; i < n; ++i)
            if (std::isfinite(loads[near[i].second].error[c])) errors.push_back(loads[near[i].second].error[c]);
        result[c] = median(errors);
    }
    return result;
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

Found suspects_of(const std::vector<Load>& loads, const std::vector<std::size_t>& components, const Wrench& full_scale,
                  const Wrench& relevant) {
    Found found{.suspected = std::vector<bool>(loads.size()),
                .stays = std::vector<bool>(loads.size()),
                .component = std::vector<std::size_t>(loads.size(), components.front())};
    bool slow = false;
    const auto z = scaled_errors(loads, components, full_scale, slow);
    std::vector<double> greatest;
    for (std::size_t l = 0; l < loads.size(); ++l) {
        const auto smaller = [](double a, double b) { return std::abs(a) < std::abs(b); };
        const auto at = std::max_element(z[l].begin(), z[l].end(), smaller);
        found.component[l] = components[std::size_t(at - z[l].begin())];
        greatest.push_back(std::abs(*at));
    }
    const std::vector<double> together = lengths_of(z);
    const double of_greatest = limit_of(greatest), of_all = limit_of(together);
    for (std::size_t l = 0; l < loads.size(); ++l) {
        bool matters = false;
        for (const std::size_t c : components) matters = matters || std::abs(loads[l].error[c]) > relevant[c];
        found.suspected[l] = matters && (greatest[l] > of_greatest || together[l] > of_all);
        found.stays[l] = std::max(greatest[l] / of_greatest, together[l] / of_all) < kSurely;
    }
    // Loads in a nonlinear range of the sensor are not wrong: the loads around them share the error.
    const std::vector<bool> first = found.suspected;
    for (std::size_t l = 0; l < loads.size(); ++l) {
        if (!first[l]) continue;
        const std::size_t c = found.component[l];
        const double nearby = error_nearby(loads, l, first)[c];
        if (std::isfinite(nearby) && std::abs(loads[l].error[c] - nearby) < kShared * std::abs(loads[l].error[c])) {
            found.suspected[l] = false;
            ++found.bent;
        }
    }
    if (slow)
        for (std::size_t l = 0; l < loads.size();) {
            std::size_t end = l;
            while (end < loads.size() && found.suspected[end]) ++end;
            if (end - l >= kRunOfMany) {
                found.bent += end - l;
                std::fill(found.suspected.begin() + std::ptrdiff_t(l), found.suspected.begin() + std::ptrdiff_t(end), false);
            }
            l = std::max(end, l + 1);
        }
    Wrench min, max;
    min.fill(std::numeric_limits<double>::infinity());
    max.fill(-std::numeric_limits<double>::infinity());
    for (std::size_t l = 0; l < loads.size(); ++l)
        for (const std::size_t c : components)
            if (!found.suspected[l] && std::isfinite(loads[l].label[c])) {
                min[c] = std::min(min[c], loads[l].label[c]);
                max[c] = std::max(max[c], loads[l].label[c]);
            }
    for (std::size_t l = 0; l < loads.size(); ++l)
        for (const std::size_t c : components)
            if (found.suspected[l] && std::abs(loads[l].error[c]) > relevant[c] &&
                at_the_end(loads[l].label[c], loads[l].estimate[c], min[c], max[c], full_scale[c]))
                found.stays[l] = true;
    return found;
}

}  // namespace tactiled
