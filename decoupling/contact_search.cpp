#include "decoupling/contact_search.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tactiled {

double residual_of(const PointContact& contact, std::uint32_t usable, double variance) noexcept {
    const int freedom = std::popcount(usable) - 5;
    return freedom > 0 ? std::sqrt(std::max(0.0, contact.squares) / freedom / variance)
                       : std::numeric_limits<double>::quiet_NaN();
}

void ContactSearch::begin(const Gauges& y, std::uint32_t usable, std::uint32_t silent, double variance) noexcept {
    y_ = y;
    usable_ = usable;
    silent_ = silent & usable;
    variance_ = variance;
    without_ = dead_ = 0;
    running_ = true;
    search_.begin(y, usable, variance);
}

bool ContactSearch::step() noexcept {
    if (!search_.step()) return false;
    const double residual = residual_of(search_.found(), usable_ & ~without_, variance_);
    const bool whole = without_ == 0;
    // Without a gauge: only what explains the rest, and best.
    if (whole || residual < std::min(residual_, kDoubtful)) {
        found_ = search_.found();
        residual_ = residual;
        ambiguous_ = search_.is_ambiguous();
        dead_ = without_;
    }
    if (whole) residual_with_all_ = residual;
    if (whole && !(residual > kDoubtful)) silent_ = 0;
    running_ = begin_without_next();
    return !running_;
}

// The search without the next gauge that delivers 0; false where there is none.
bool ContactSearch::begin_without_next() noexcept {
    without_ = silent_ & (0u - silent_);
    silent_ &= ~without_;
    if (without_ == 0 || std::popcount(usable_ & ~without_) < kFewestGauges) return false;
    search_.begin(y_, usable_ & ~without_, variance_);
    return true;
}

}  // namespace tactiled
