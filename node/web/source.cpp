#include "node/web/source.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <limits>
#include <utility>

#include "node/bridges/edge.hpp"

namespace tactiled::web {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint64_t kTryEachNs = 200'000'000;

std::int64_t wall_ms() {
    timespec t{};
    ::clock_gettime(CLOCK_REALTIME, &t);
    return std::int64_t(t.tv_sec) * 1000 + t.tv_nsec / 1'000'000;
}

double component(const tactiled_sample& s, std::size_t c) { return c < 3 ? s.force_S_N[c] : s.torque_S_Nm[c - 3]; }
double sd_of(const tactiled_sample& s, std::size_t c) { return c < 3 ? s.sd_force_N[c] : s.sd_torque_Nm[c - 3]; }

void widen(Interval& interval, const tactiled_sample& s) {
    interval.quality = bridges::worse(interval.quality, s.quality);
    interval.reasons |= s.reasons;
    for (std::size_t c = 0; c < 6; ++c) {
        const double value = component(s, c), sd = sd_of(s, c);
        if (!std::isfinite(value)) continue;
        // fmin and fmax drop a NaN: one sample without an uncertainty must leave the band unknown.
        const bool first = std::isnan(interval.value[c]);
        interval.low[c] = first ? float(value - sd) : std::min(interval.low[c], float(value - sd));
        interval.high[c] = first ? float(value + sd) : std::max(interval.high[c], float(value + sd));
        if (!std::isfinite(sd)) interval.low[c] = interval.high[c] = kNan;
        interval.value[c] = float(value);
    }
}

// Rate and temperature of a sample that is too old are no measurements any more.
void forget_measured(tactiled_sample& s) {
    if (s.quality == TACTILED_BAD && (s.reasons & TACTILED_REASONS_OF_OLD) != 0) s.rate_Hz = s.temperature_C = kNan;
}

}  // namespace

std::uint32_t View::worst_quality() const { return bridges::worst_quality(std::span(snapshot.sensor).first(n_sensors())); }

std::uint32_t View::grasp_quality() const { return bridges::grasp_quality(snapshot.node.grasp, worst_quality()); }

std::uint32_t View::weight_quality() const { return bridges::weight_quality(snapshot.node.grasp, worst_quality()); }

const View& Source::tick() {
    attach();
    view_.taken_ns = monotonic_ns();
    view_.wall_ms = wall_ms();
    view_.is_alive = false;
    if (!segment_.is_open()) {
        view_.why = why_;
        return view_;
    }
    const bool published = segment_.snapshot(view_.snapshot);
    view_.taken_ns = monotonic_ns();
    if (!published) {
        view_.why = "the daemon is starting";
        view_.snapshot = Snapshot{};
        for (auto& sample : view_.snapshot.sensor) tactiled_invalidate(&sample, TACTILED_NO_DATA_YET);
        tactiled_forget_grasp(&view_.snapshot.node.grasp);
        tactiled_forget_tool(&view_.snapshot.node.tool);
    } else if (!segment_.is_current()) {
        view_.why = "the daemon has ended";
    } else if (tactiled_is_fresh(view_.snapshot.node.t_ns, view_.taken_ns, segment_.header().watchdog_ms) == 0) {
        view_.why = "the daemon does not respond: it was killed, or hangs";
    } else {
        view_.is_alive = true;
        view_.why.clear();
    }
    if (!view_.is_alive && !unreadable_.empty()) view_.why = unreadable_;
    for (std::uint32_t i = 0; i < segment_.n_sensors(); ++i) forget_measured(view_.snapshot.sensor[i]);
    const std::uint32_t reloads = __atomic_load_n(&segment_.header().reloads, __ATOMIC_ACQUIRE);
    if (reloads % 2 == 0 && std::exchange(view_.reloads, reloads) != reloads) ++view_.structure;
    for (std::uint32_t i = 0; i < segment_.n_sensors(); ++i) read_interval(i);
    return view_;
}

// Opens the node's segment where there is none, and its successor's where the daemon has ended or does not respond.
void Source::attach() {
    const std::uint64_t now_ns = monotonic_ns();
    if (view_.is_alive && segment_.is_current()) return;
    if (now_ns - tried_ns_ < kTryEachNs) return;
    tried_ns_ = now_ns;
    errno = 0;
    Segment fresh = Segment::try_open(node_name_, why_);
    unreadable_ = fresh.is_open() || errno == ENOENT ? "" : why_;
    if (!fresh.is_open()) return;
    const auto& is = fresh.header();
    if (segment_.is_open() && segment_.header().epoch == is.epoch && segment_.header().pid == is.pid) return;
    segment_ = std::move(fresh);
    ++view_.structure;
    view_.reloads = __atomic_load_n(&segment_.header().reloads, __ATOMIC_ACQUIRE);
    for (std::uint32_t i = 0; i < segment_.n_sensors(); ++i) {
        cursor_[i] = {};
        tactiled_ring_seek(segment_.base(), &segment_.c()->ring[i], &cursor_[i], 0);
    }
}

void Source::read_interval(std::uint32_t sensor) {
    Interval& interval = view_.interval[sensor];
    interval = {};
    const tactiled_sample& newest = view_.snapshot.sensor[sensor];
    interval.quality = newest.quality;
    tactiled_sample sample;
    tactiled_cursor& cursor = cursor_[sensor];
    const std::uint64_t lost = cursor.lost;
    // Bounded: a ring that fills faster than it is read must not hold up the page.
    for (std::uint32_t n = segment_.c()->ring[sensor].slots; n > 0; --n) {
        if (tactiled_ring_next(segment_.base(), &segment_.c()->ring[sensor], &cursor, &sample, sizeof sample) == 0) break;
        widen(interval, sample);
    }
    view_.missed += cursor.lost - lost;
    widen(interval, newest);
    for (std::size_t c = 0; c < 6; ++c) {
        interval.value[c] = float(component(newest, c));
        if (!std::isfinite(interval.value[c])) interval.low[c] = interval.high[c] = kNan;
    }
}

}  // namespace tactiled::web
