#include "decoupling/fit/outliers.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "decoupling/fit/labels.hpp"
#include "decoupling/fit/validate.hpp"

namespace tactiled {
namespace {

// An error of a suspected row beyond this quantile of the others' errors counts linearly: if the label is wrong, its error
// gives little information on the fit.
constexpr double kTail = 0.99;
// A gain counts if it is this share of the squared errors, or as many standard errors of the sum over the parts held out.
constexpr double kClearGain = 0.05, kSure = 2;
// A label is also left out if its error exceeds the others' 99 % quantile by so large a factor that it would occur in one of
// twenty recordings of good rows, with errors as in Student's distribution of two degrees (shares fall with the square).
constexpr double kFarTimes = 5, kFarPerRow = 0.01 * 20;

// Sums of the squared errors of each part that was held out.
std::vector<Wrench> losses_of(const Validation& validation, const std::set<const LabelledRow*>& suspects,
                              const Wrench& tail) {
    std::vector<Wrench> losses(validation.group.empty() ? 0 : validation.group.back() + 1, Wrench{});
    for (std::size_t i = 0; i < validation.rows.size(); ++i)
        for (std::size_t c = 0; c < 6; ++c) {
            const auto& [row, estimated_S] = validation.rows[i];
            const double size = std::abs(estimated_S[c] - row->wrench_S[c]);
            if (!std::isfinite(size)) continue;
            const bool linear = suspects.count(row) != 0 && size > tail[c];
            losses[validation.group[i]][c] += linear ? tail[c] * (2 * size - tail[c]) : size * size;
        }
    return losses;
}

// Returns true if the errors are lower, clearly or by more than chance: a few good rows in the tail change the others'
// errors by chance, and wrong labels are few, so that not every part shows them.
bool gains(const std::vector<Wrench>& before, const std::vector<Wrench>& after, std::size_t c) {
    const auto n = double(before.size());
    double all = 0, sum = 0, squares = 0;
    for (std::size_t i = 0; i < before.size(); ++i) all += before[i][c], sum += before[i][c] - after[i][c];
    for (std::size_t i = 0; i < before.size(); ++i) squares += std::pow(before[i][c] - after[i][c] - sum / n, 2);
    return sum > std::min(kClearGain * all, kSure * std::sqrt(squares * n / (n - 1)));
}

Wrench tail_of(const Validation& validation, const std::set<const LabelledRow*>& suspects) {
    Wrench tail{};
    for (std::size_t c = 0; c < 6; ++c) {
        std::vector<double> sizes;
        for (const HeldOut& one : validation.rows)
            if (const double size = std::abs(one.estimated_S[c] - one.row->wrench_S[c]);
                std::isfinite(size) && suspects.count(one.row) == 0)
                sizes.push_back(size);
        if (!sizes.empty()) tail[c] = quantile(std::move(sizes), kTail);
    }
    return tail;
}

// Returns, for each suspected row, the labels whose errors chance does not explain.
std::map<const LabelledRow*, std::array<bool, 6>> far_off(const Validation& validation,
                                                          const std::set<const LabelledRow*>& suspects, const Wrench& tail) {
    const double times = std::max(kFarTimes, std::sqrt(kFarPerRow * double(validation.rows.size())));
    std::map<const LabelledRow*, std::array<bool, 6>> far;
    for (const auto& [row, estimated_S] : validation.rows)
        for (std::size_t c = 0; suspects.count(row) != 0 && c < 6; ++c)
            far[row][c] = tail[c] > 0 && std::abs(estimated_S[c] - row->wrench_S[c]) > times * tail[c];
    return far;
}

}  // namespace

void leave_out(Labelled& labelled, Rows& rows, const FitEntry& method, const ZeroDrift& drift, const Refit& refit,
               LabelsJudged& judged) {
    std::set<const LabelledRow*> suspects, kept;
    for (const Suspect& suspect : judged.suspects) {
        suspects.insert(suspect.row);
        if (!suspect.left_out) kept.insert(suspect.row);
    }
    if (kept.size() == suspects.size()) return;
    // Suspected rows that are kept would hide the effect of the others.
    const Validation with = hold_out({labelled, rows, method, judged.calibration, drift, &kept});
    const Validation without = hold_out({labelled, rows, method, judged.calibration, drift, &suspects});
    std::array<bool, 6> lower{};
    lower.fill(true);
    std::map<const LabelledRow*, std::array<bool, 6>> far;
    if (!with.how.empty() && !without.how.empty()) {
        const Wrench tail = tail_of(without, suspects);
        const auto before = losses_of(with, suspects, tail), after = losses_of(without, suspects, tail);
        for (std::size_t c = 0; c < 6; ++c) lower[c] = gains(before, after, c);
        far = far_off(without, suspects, tail);
    }
    bool all = true;
    for (Suspect& suspect : judged.suspects) {
        if (!suspect.left_out) continue;
        const std::array<bool, 6> off = far[suspect.row];
        suspect.left_out = lower[suspect.component] || off[suspect.component];
        Wrench& label = labelled.rows[std::size_t(suspect.row - labelled.rows.data())].wrench_S;
        for (std::size_t c = 0; c < 6; ++c)
            if (suspect.left_out && (lower[c] || off[c])) label[c] = kNaN;
        all = all && !has_label(*suspect.row);
    }
    std::erase_if(rows, [](const LabelledRow* row) { return !has_label(*row); });
    if (!all) judged.calibration = refit(rows);
}

}  // namespace tactiled
