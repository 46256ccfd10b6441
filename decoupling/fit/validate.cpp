#include "decoupling/fit/validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kStretches = 5;  // of time, where there are no sessions to leave out
constexpr std::size_t kMaxPoseGroups = 10;
constexpr std::size_t kRowsPerPose = 5;  // on average, from where rows are said to repeat poses

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

// `seen_too`: rows that the loop reads as well, all of them in the order of the file; a session begins with no past.
std::vector<HeldOut> estimates(const Calibration& calibration, const Rows& rows, const std::vector<LabelledRow>& seen_too) {
    std::map<std::size_t, std::unique_ptr<Decoupler>> of_session;
    std::vector<HeldOut> result;
    for (const LabelledRow& row : seen_too) {
        if (result.size() == rows.size()) break;
        auto& decoupler = of_session[row.session];
        if (decoupler == nullptr) decoupler = make_decoupler(calibration);
        const Estimate estimate = decoupler->decouple({.channel = row.channel, .t_ns = row.t_ns});
        if (&row == rows[result.size()]) result.push_back({&row, estimate.wrench_S});
    }
    return result;
}

std::vector<HeldOut> estimates(const Calibration& calibration, const Rows& rows) {
    const auto decoupler = make_decoupler(calibration);
    std::vector<HeldOut> result;
    for (const auto* row : rows)
        result.push_back({row, decoupler->decouple({.channel = row->channel, .t_ns = row->t_ns}).wrench_S});
    return result;
}

// The groups that are left out, one after the other.
struct Groups {
    std::vector<std::size_t> of_row;
    std::vector<std::string> names;
    std::string validation;
    bool are_sessions = false;
};

// Poses in groups of neighbours; empty where the rows do not repeat poses.
Groups groups_of_poses(const Rows& rows) {
    Groups groups;
    std::map<Wrench, std::size_t> poses;
    std::vector<std::size_t> pose_of_row;
    for (const auto* row : rows) {
        Wrench key = row->wrench_S;
        for (double& value : key)
            if (std::isnan(value)) value = 1e300;  // NaN has no order
        pose_of_row.push_back(poses.emplace(key, poses.size()).first->second);
    }
    if (poses.size() < 4 || poses.size() * kRowsPerPose > rows.size()) return groups;
    const std::size_t n = std::min(kMaxPoseGroups, poses.size());
    for (const std::size_t pose : pose_of_row) groups.of_row.push_back(pose * n / poses.size());
    for (std::size_t i = 0; i < n; ++i) groups.names.push_back(fmt::format("the poses' group number {} of {}", i + 1, n));
    groups.validation = fmt::format("leave poses out ({} poses in {} groups)", poses.size(), n);
    return groups;
}

Groups groups_of(const Labelled& labelled, const Rows& rows, bool remembers) {
    std::vector<bool> occurs(std::max<std::size_t>(labelled.sessions.size(), 1));
    for (const auto* row : rows) occurs[row->session] = true;
    const auto sessions = std::count(occurs.begin(), occurs.end(), true);
    if (sessions < 2) {
        if (!remembers)
            if (Groups groups = groups_of_poses(rows); !groups.names.empty()) return groups;
        Groups groups;
        // By their times, where the file has some: rows that were shuffled would be rows drawn at random.
        std::vector<std::size_t> by_time(rows.size());
        std::iota(by_time.begin(), by_time.end(), std::size_t{0});
        std::stable_sort(by_time.begin(), by_time.end(),
                         [&](std::size_t a, std::size_t b) { return rows[a]->t_ns < rows[b]->t_ns; });
        groups.of_row.resize(rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) groups.of_row[by_time[i]] = i * kStretches / rows.size();
        for (std::size_t i = 0; i < kStretches; ++i)
            groups.names.push_back(fmt::format("the stretch of time number {} of {}", i + 1, kStretches));
        groups.validation = fmt::format("leave one of {} stretches of time out", kStretches);
        return groups;
    }
    Groups groups;
    groups.are_sessions = true;
    for (const auto* row : rows) groups.of_row.push_back(row->session);
    for (const auto& name : labelled.sessions) groups.names.push_back("session " + name);
    groups.validation = fmt::format("leave one session out ({} sessions)", sessions);
    return groups;
}

}  // namespace

Wrench error_of(Decoupler& decoupler, const LabelledRow& row) {
    const Estimate estimate = decoupler.decouple({.channel = row.channel, .t_ns = row.t_ns});
    Wrench error;
    for (std::size_t c = 0; c < error.size(); ++c) error[c] = estimate.wrench_S[c] - row.wrench_S[c];
    return error;
}

Wrench rms_error(const Calibration& calibration, const Rows& rows) { return rms_of(estimates(calibration, rows)); }

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

std::vector<std::size_t> groups_of_rows(const Labelled& labelled, const Rows& rows, bool remembers) {
    return groups_of(labelled, rows, remembers).of_row;
}

Validation hold_out(const Labelled& labelled, const Rows& rows, const FitEntry& method, const Calibration& whole,
                    std::vector<std::string>& warnings) {
    const Groups groups = groups_of(labelled, rows, method.remembers);
    Validation validation;
    for (std::size_t group = 0; group < groups.names.size(); ++group) {
        Rows seen, unseen;
        for (std::size_t i = 0; i < rows.size(); ++i) (groups.of_row[i] == group ? unseen : seen).push_back(rows[i]);
        if (unseen.empty()) continue;
        Calibration calibration = whole;
        std::vector<std::string> of_this_part;  // said about a part only: not worth repeating
        try {
            set_domain(seen, calibration);
            method.fit(seen, calibration, of_this_part);
        } catch (const Undetermined& error) {
            warnings.push_back(
                fmt::format("not validated, so no standard deviation: without {} the rest does not determine "
                            "the model ({}); record every load twice, or in a second session",
                            groups.names[group], error.what()));
            return {};
        }
        const auto estimated =
            method.remembers ? estimates(calibration, unseen, labelled.rows) : estimates(calibration, unseen);
        validation.rows.insert(validation.rows.end(), estimated.begin(), estimated.end());
    }
    validation.how = groups.validation;
    validation.rms = rms_of(validation.rows);
    if (!groups.are_sessions)
        warnings.emplace_back(
            "one session only: the error after mounting the sensor again, or on another day, is not known");
    return validation;
}

std::array<std::array<double, 6>, 6> crosstalk(const std::vector<HeldOut>& rows, const Calibration& calibration) {
    std::array<std::array<double, 6>, 6> result;
    for (auto& row : result) row.fill(kNaN);
    const auto n = Eigen::Index(calibration.components.size());
    std::vector<std::size_t> index;
    for (const auto& name : calibration.components) index.push_back(component_index(name));
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
