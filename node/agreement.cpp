#include "node/agreement.hpp"

#include <cmath>

namespace tactiled {
namespace {

// Reasons that show which of two sensors is faulty. Saturation does not show a fault: the force may be too large for one
// sensor only.
constexpr std::uint32_t kCulprit =
    TACTILED_FROZEN | TACTILED_IDLE_BUS | TACTILED_MISSING_CHANNEL | TACTILED_NOT_FINITE | TACTILED_WRONG_DEVICE;

bool is_comparable(const tactiled_sample& s) noexcept {
    return (s.quality == TACTILED_GOOD || s.quality == TACTILED_UNCERTAIN) &&
           (s.reasons & ~std::uint32_t(TACTILED_REASONS_FOR_COMPARE)) == 0;
}

}  // namespace

void Agreement::succeed(const Agreement& before) noexcept {
    if (other() == before.other()) differs_ = before.differs_;
}

// Returns true if the condition has lasted since `since_ns` for the patience. The measurement restarts if `since_ns` is 0 or
// later than `now_ns`.
bool Agreement::has_lasted(std::uint64_t& since_ns, std::uint64_t now_ns) const noexcept {
    if (since_ns == 0 || now_ns < since_ns) since_ns = now_ns;
    return now_ns - since_ns >= patience_ns();
}

bool Agreement::compare(const tactiled_sample& mine, const tactiled_sample& others) noexcept {
    if ((others.reasons & kCulprit) == 0)
        guilty_since_ns_ = 0;
    else if (has_lasted(guilty_since_ns_, mine.t_ns))
        differs_ = false;
    const std::uint64_t between_ns = mine.t_ns > others.t_ns ? mine.t_ns - others.t_ns : others.t_ns - mine.t_ns;
    if (!is_comparable(mine) || !is_comparable(others) || between_ns > patience_ns()) return differs_;
    if (mine.t_ns - compared_ns_ > patience_ns()) otherwise_since_ns_ = 0;  // a gap restarts the time
    compared_ns_ = mine.t_ns;
    double squares = 0;  // sum over the components that both sensors measure
    for (std::size_t i = 0; i < 3; ++i) {
        const double apart_N = mine.force_S_N[i] - others.force_S_N[i];
        if (std::isfinite(apart_N)) squares += apart_N * apart_N;
    }
    const bool apart = squares > pair_->agree_N * pair_->agree_N;
    if (apart != differs_ && !has_lasted(otherwise_since_ns_, mine.t_ns)) return differs_;
    differs_ = apart;
    otherwise_since_ns_ = 0;
    return differs_;
}

}  // namespace tactiled
