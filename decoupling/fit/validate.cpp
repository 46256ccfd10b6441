#include "decoupling/fit/validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/parallel.hpp"
#include "decoupling/solve/domain.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kFewRows = 3000, kManyRows = 12000;  // repetitions of a row with random zeros

Wrench rms_of(const std::vector<HeldOut>& rows) {
    Wrench squares{}, rms = kUnseen;
    std::array<int, 6> count{};
    for (const auto& [row, estimated] : rows)
        for (std::size_t c = 0; c < 6; ++c) {
            const double error = estimated[c] - row->wrench_S[c];
            if (!std::isfinite(error)) continue;
            squares[c] += error * error;
            ++count[c];
        }
    for (std::size_t c = 0; c < 6; ++c)
        if (count[c] > 0) rms[c] = std::sqrt(squares[c] / count[c]);
    return rms;
}

bool states_sd(const Estimate& estimate) { return (estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) == 0; }

// Estimates the rows. `seen_too`: rows that the loop reads as well, all of them in the order of the file; a session
// begins without a past.
std::vector<HeldOut> estimates(const Calibration& calibration, const Rows& rows, const std::vector<LabelledRow>& seen_too,
                               std::vector<bool>& has_sd) {
    std::map<std::size_t, std::unique_ptr<Decoupler>> of_session;
    std::vector<HeldOut> result;
    for (const LabelledRow& row : seen_too) {
        if (result.size() == rows.size()) break;
        auto& decoupler = of_session[row.session];
        if (decoupler == nullptr) decoupler = make_decoupler(calibration);
        const Estimate estimate = decoupler->decouple({.channel = row.channel, .t_ns = row.t_ns});
        if (&row != rows[result.size()]) continue;
        result.push_back({&row, estimate.wrench_S});
        has_sd.push_back(states_sd(estimate));
    }
    return result;
}

std::vector<HeldOut> estimates(const Calibration& calibration, const Rows& rows, std::vector<bool>& has_sd) {
    const auto decoupler = make_decoupler(calibration);
    std::vector<HeldOut> result;
    for (const auto* row : rows) {
        const Estimate estimate = decoupler->decouple({.channel = row->channel, .t_ns = row->t_ns});
        result.push_back({row, estimate.wrench_S});
        has_sd.push_back(states_sd(estimate));
    }
    return result;
}

std::vector<HeldOut> estimates(const Calibration& calibration, const Rows& rows) {
    std::vector<bool> ignored;
    return estimates(calibration, rows, ignored);
}

// Returns copies of the rows with random zeros of the channels. The copies of a row are consecutive, because they are
// one load.
std::vector<LabelledRow> with_random_zeros(const Rows& rows, const std::vector<double>& drift, std::size_t copies,
                                           std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> result;
    result.reserve(copies * rows.size());
    for (const auto* row : rows)
        for (std::size_t copy = 0; copy < copies; ++copy) {
            result.push_back(*row);
            for (std::size_t k = 0; k < drift.size(); ++k) result.back().channel[k] += drift[k] * normal(random);
        }
    return result;
}

Rows pointers_to(const std::vector<LabelledRow>& rows) {
    Rows result;
    for (const auto& row : rows) result.push_back(&row);
    return result;
}

// Estimates copies with random zeros together with the original rows.
std::vector<HeldOut> estimates_with_random_zeros(const Calibration& calibration, const Rows& rows,
                                                 const std::vector<double>& drift, std::size_t group) {
    const auto copies = with_random_zeros(rows, drift, 1, 1000 + group);
    auto result = estimates(calibration, pointers_to(copies));
    for (std::size_t i = 0; i < rows.size(); ++i) result[i].row = rows[i];
    return result;
}

// The result of leaving one group out.
struct Part {
    std::vector<HeldOut> rows, drifted, of_part;
    std::vector<bool> has_sd;  // one for each of `rows`
    std::string refused;
};

Part hold_out_group(const FitToValidate& of, const Groups& groups, std::size_t group) {
    const auto& [labelled, rows, method, whole, drift, unused] = of;
    Part part;
    Rows seen, unseen;
    for (std::size_t i = 0; i < rows.size(); ++i)
        if (groups.of_row[i] == group)
            unseen.push_back(rows[i]);
        else if (groups.fits(i, group) && (unused == nullptr || unused->count(rows[i]) == 0))
            seen.push_back(rows[i]);
    if (unseen.empty() || (groups.are_in_time && group == 0)) return part;
    if (!groups.are_loads)
        if (const std::string component = not_spanned_without(rows, groups, group); !component.empty()) {
            part.refused = fmt::format("its rows alone load {}", component);
            return part;
        }
    Calibration calibration = whole;
    std::vector<std::string> of_this_part;  // warnings about this part only, which are not reported
    try {
        set_domain(seen, calibration);
        fit_with_drift(method, seen, drift.sd, calibration, of_this_part);
        // Any value will do: it shows for which readings the method states no standard deviation.
        calibration.sd.assign(calibration.components.size(), 1);
        part.rows = method.remembers ? estimates(calibration, unseen, labelled.rows, part.has_sd)
                                     : estimates(calibration, unseen, part.has_sd);
        if (drift.stated && !drift.sd.empty() && !method.remembers)
            part.drifted = estimates_with_random_zeros(calibration, unseen, drift.sd, group);
        if (!method.adds_to.empty()) {
            calibration.method = method.adds_to;
            part.of_part = estimates(calibration, unseen);
        }
    } catch (const Undetermined& error) { part.refused = error.what(); }
    return part;
}

// Holds out all groups, on all processors.
std::vector<Part> hold_out_groups(const FitToValidate& of, const Groups& groups) {
    std::vector<Part> parts(groups.names.size());
    std::atomic<bool> refused{false};  // then the other groups are not needed
    in_parallel(parts.size(), [&](std::size_t group) {
        if (refused) return;
        parts[group] = hold_out_group(of, groups, group);
        if (!parts[group].refused.empty()) refused = true;
    });
    return parts;
}

// Returns an empty validation where a part is not determined, and says in `in_vain` which.
Validation hold_out_in(const FitToValidate& of, const Groups& groups, std::string& in_vain) {
    const std::vector<Part> parts = hold_out_groups(of, groups);
    const auto refused = std::find_if(parts.begin(), parts.end(), [](const Part& part) { return !part.refused.empty(); });
    if (refused != parts.end()) {
        in_vain = fmt::format("without {} the rest does not determine the model ({})",
                              groups.names[std::size_t(refused - parts.begin())], refused->refused);
        return {};
    }
    Validation validation;
    std::vector<HeldOut> of_part;
    for (std::size_t group = 0; group < parts.size(); ++group) {
        const Part& part = parts[group];
        validation.rows.insert(validation.rows.end(), part.rows.begin(), part.rows.end());
        validation.group.resize(validation.rows.size(), group);
        validation.has_sd.insert(validation.has_sd.end(), part.has_sd.begin(), part.has_sd.end());
        validation.drifted.insert(validation.drifted.end(), part.drifted.begin(), part.drifted.end());
        of_part.insert(of_part.end(), part.of_part.begin(), part.of_part.end());
    }
    validation.how = groups.validation;
    validation.all = of.rows;
    validation.by_sessions = groups.are_sessions;
    validation.rms = rms_of(validation.rows);
    validation.rms_of_part = rms_of(of_part);
    return validation;
}

}  // namespace

double mean_share(const Wrench& error, const Calibration& calibration) {
    double sum = 0;
    for (std::size_t i = 0; i < calibration.components.size(); ++i)
        sum += error[component_index(calibration.components[i])] / calibration.full_scale[i];
    return sum / double(calibration.components.size());
}

Wrench error_of(Decoupler& decoupler, const LabelledRow& row) {
    const Estimate estimate = decoupler.decouple({.channel = row.channel, .t_ns = row.t_ns});
    Wrench error;
    for (std::size_t c = 0; c < error.size(); ++c) error[c] = estimate.wrench_S[c] - row.wrench_S[c];
    return error;
}

Wrench rms_error(const Calibration& calibration, const Rows& rows) { return rms_of(estimates(calibration, rows)); }

std::map<std::size_t, Wrench> errors_at_rest(const Calibration& calibration, const Rows& rows) {
    constexpr std::size_t kEnough = 3;  // fewer may be chance
    std::map<std::size_t, std::pair<Wrench, std::size_t>> sums;
    for (const HeldOut& one : estimates(calibration, rows)) {
        if (!(load_of(one.row->wrench_S, calibration) < LoadPeak::kRest)) continue;
        auto& [sum, n] = sums[one.row->session];
        for (std::size_t c = 0; c < sum.size(); ++c) sum[c] += one.estimated_S[c] - one.row->wrench_S[c];
        ++n;
    }
    std::map<std::size_t, Wrench> result;
    for (auto& [session, sum] : sums) {
        if (sum.second < kEnough) continue;
        for (double& each : sum.first) each /= double(sum.second);
        result[session] = sum.first;
    }
    return result;
}

void set_domain(const Rows& rows, Calibration& calibration) {
    const std::size_t n = calibration.channels.size();
    calibration.channel_least.assign(n, std::numeric_limits<double>::infinity());
    calibration.channel_most.assign(n, -std::numeric_limits<double>::infinity());
    for (const auto* row : rows)
        for (std::size_t k = 0; k < n; ++k) {
            calibration.channel_least[k] = std::min(calibration.channel_least[k], row->channel[k]);
            calibration.channel_most[k] = std::max(calibration.channel_most[k], row->channel[k]);
        }
}

void fit_with_drift(const FitEntry& method, const Rows& rows, const std::vector<double>& drift, Calibration& calibration,
                    std::vector<std::string>& warnings) {
    if (drift.empty() || !method.takes_zero_drift) return method.fit(rows, calibration, warnings);
    const std::size_t copies = rows.size() <= kFewRows ? 4 : rows.size() <= kManyRows ? 2 : 1;
    const auto repeated = with_random_zeros(rows, drift, copies, 1);
    method.fit(pointers_to(repeated), calibration, warnings);
}

Validation hold_out(const FitToValidate& of) {
    std::string in_vain;
    for (const Groups& groups : ways_to_hold_out(of.labelled, of.rows, of.method.remembers))
        if (Validation found = hold_out_in(of, groups, in_vain); !found.how.empty()) return found;
    return {};
}

std::vector<Validation> hold_out_all_ways(const FitToValidate& of, std::vector<Way>& tried,
                                          std::vector<std::string>& warnings) {
    std::vector<Validation> found;
    tried.clear();
    for (const Groups& groups : ways_to_hold_out(of.labelled, of.rows, of.method.remembers)) {
        if (groups.are_loads && !found.empty()) break;
        Way way{.how = groups.validation, .error = kNaN, .refused = ""};
        Validation one = hold_out_in(of, groups, way.refused);
        way.error = mean_share(one.rms, of.whole);
        for (const std::string& component : of.whole.components)
            if (way.refused.empty() && std::isnan(one.rms[component_index(component)]))
                way.refused = fmt::format("no row that is left out has a label of {}", component);
        if (groups.are_loads && way.refused.empty())
            warnings.push_back(
                fmt::format("validated by loads: {}, so one load at a time was left out. Loads that were "
                            "applied one after the other share their zero; record every load once more, later",
                            tried.back().refused));
        if (way.refused.empty()) found.push_back(std::move(one));
        tried.push_back(std::move(way));
    }
    std::stable_sort(found.begin(), found.end(), [&](const Validation& a, const Validation& b) {
        return mean_share(a.rms, of.whole) > mean_share(b.rms, of.whole);
    });
    const auto other = [&](const LabelledRow* row) { return row->session != of.rows.front()->session; };
    if (found.empty())
        warnings.push_back(
            fmt::format("not validated, so no standard deviation: {}; record every load twice, or in a second "
                        "session",
                        tried.empty() ? "no rows" : tried.back().refused));
    else if (std::none_of(of.rows.begin(), of.rows.end(), other))
        warnings.emplace_back(
            "one session only: the error after mounting the sensor again, or on another day, is not known");
    return found;
}

std::array<std::array<double, 6>, 6> crosstalk(const std::vector<HeldOut>& rows, const Calibration& calibration) {
    std::array<std::array<double, 6>, 6> result;
    for (auto& row : result) row.fill(kNaN);
    const auto n = Eigen::Index(calibration.components.size());
    const std::vector<std::size_t> index = component_indices(calibration.components);
    std::vector<const HeldOut*> whole;
    for (const auto& held_out : rows) {
        bool known = true;
        for (const std::size_t c : index)
            known = known && std::isfinite(held_out.row->wrench_S[c]) && std::isfinite(held_out.estimated_S[c]);
        if (known) whole.push_back(&held_out);
    }
    if (Eigen::Index(whole.size()) <= n + 1) return result;
    Eigen::MatrixXd applied(Eigen::Index(whole.size()), n), estimated = applied;
    for (std::size_t i = 0; i < whole.size(); ++i)
        for (Eigen::Index j = 0; j < n; ++j) {
            const double scale = calibration.full_scale[std::size_t(j)];
            applied(Eigen::Index(i), j) = whole[i]->row->wrench_S[index[std::size_t(j)]] / scale;
            estimated(Eigen::Index(i), j) = whole[i]->estimated_S[index[std::size_t(j)]] / scale;
        }
    for (Eigen::Index i = 0; i < n; ++i) {
        const Affine affine = affine_fit(applied, estimated.col(i));
        if (!affine.slope.dependent.empty()) continue;
        for (Eigen::Index j = 0; j < n; ++j)
            result[index[std::size_t(i)]][index[std::size_t(j)]] = affine.slope.coefficient[j];
    }
    return result;
}

}  // namespace tactiled
