// Part of stream_age.hpp. The proof by the device's counter, which serves as a clock once its rate is known.
#pragma once
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

// Number of frames that the device may have measured in a silence (for a cable: at most); 0: its interval is unknown.
inline double StreamAge::frames_in(double silence_ns) const noexcept {
    const double interval = route_.path == Route::Path::direct ? kFastest_ns : interval_ns();
    return interval > 0 ? silence_ns / interval : 0;
}

// Returns true if the counter has restarted with the device since the frame before.
inline bool StreamAge::has_begun(const Frame& frame, double silence_ns) const noexcept {
    return frame.sequence < kBegunFrames + frames_in(silence_ns);
}

// Follows the run of used numbers without a large gap. Only these numbers can be sent again, and until the counter exceeds
// them, the path may send old frames even after a reopening.
inline void StreamAge::follow_run(const Frame& frame, std::uint64_t host_ns) noexcept {
    const std::uint32_t mask = frame.sequence_bits >= 32 ? ~0u : (1u << frame.sequence_bits) - 1;
    const std::uint32_t steps = (frame.sequence - sequence_) & mask, back = (sequence_ - frame.sequence) & mask;
    back_ = has_frame_ && frame.lost == 0 && back <= mask / 2 && back <= run_ ? back : 0;
    const double silence_ns = double(host_ns - host_ns_);
    // The device continued to count while the link was closed.
    if (steps <= kMaxGap || (is_reopened_ && steps <= 2 * frames_in(silence_ns)))
        run_ += steps;
    else if (back_ <= 0)
        run_ = 0;
    if (back_ <= 0) {
        behind_ -= steps;
    } else if (has_begun(frame, silence_ns)) {
        behind_ = 0;
    } else {
        behind_ = std::max(behind_, 0.0) + back_;
        behind_until_ns_ = host_ns + std::uint64_t(AgeBound::kReplay_ns);
    }
}

// Returns the number of frames that the device has counted since the frame before; 0: it has restarted. The number of wraps
// follows from the device's rate. If the decoder reports a restart, but the counter has not just begun, the counter has
// wrapped.
inline double StreamAge::frames_since(const Frame& frame, double silence_ns) const noexcept {
    const double range = std::ldexp(1.0, frame.sequence_bits);
    const std::uint32_t mask = frame.sequence_bits >= 32 ? ~0u : (1u << frame.sequence_bits) - 1;
    const std::uint32_t expected = sequence_ + 1 + frame.lost;
    if (!is_reopened_ && ((frame.sequence ^ expected) & mask) == 0) return 1.0 + frame.lost;
    const double period_ns = period_ns_ > 0 ? period_ns_ : interval_us_ * 1e3;
    if (!is_reopened_ && (period_ns <= 0 || frame.sequence < std::min(kBooted_ns / period_ns, range / 8))) return 0;
    const double steps = double((frame.sequence - sequence_) & mask);
    if (period_ns <= 0) return steps < range / 2 ? steps : 0;
    const double expected_steps = silence_ns / period_ns;
    if (expected_steps > range / 2 && range * period_ns > kMaxClosed_ns) return std::max(steps, 1.0);  // or more: not known
    const double wraps = std::nearbyint((expected_steps - steps) / range);
    return wraps >= 0 ? steps + wraps * range : 0;
}

// Returns true for a restart that looks like lost frames: more of them than the time allows, or a small number of a counter
// whose range is shorter than a possible lag. `late_ns` is the lateness by the number.
inline bool StreamAge::seems_restarted(const Frame& frame, double late_ns) const noexcept {
    if (frame.lost == 0 || is_reopened_) return false;
    const double range = std::ldexp(1.0, frame.sequence_bits);
    const bool is_short =
        range * period_ns_ < kShortCounter_ns && frame.sequence < std::min(kBooted_ns / period_ns_, range / 8);
    return late_ns < -2 * kLate_ns || (is_short && late_ns_ + double(frame.lost) * period_ns_ > kLate_ns);
}

// Mean interval since the last opening, without silences; without one, that of the time before, or the declared interval.
inline double StreamAge::mean_ns() const noexcept {
    const double mean_ns = learn_frames_ > 0     ? learned_ns_ / learn_frames_
                           : mean_before_ns_ > 0 ? mean_before_ns_
                           : max_period_ns_ > 0  ? max_period_ns_
                                                 : declared_ns_;
    return declared_ns_ > 0 ? std::clamp(mean_ns, declared_ns_ / (1 + tolerance_), declared_ns_ * (1 + tolerance_))
                            : mean_ns;
}

inline void StreamAge::learn_rate(std::uint64_t host_ns) noexcept {
    if (learned_ns_ < kLearn_ns || learn_frames_ < kLearnFrames) return;
    period_ns_ = mean_ns();
    if (max_period_ns_ > 0) period_ns_ = std::min(period_ns_, max_period_ns_);
    begin_to_count();
    (void)bound_.late_ns(host_ns, std::uint64_t(counted_ * period_ns_));  // this frame is on time
    known_ns_ = host_ns;
}

inline void StreamAge::begin_to_count() noexcept {
    bound_ = AgeBound({.max_drift = kMaxRateError,
                       .wander = route_.clock_ppm * 0.2e-6,
                       .held_share = 0,
                       .excess = kFaster,
                       .begins_at_zero = false});
    counted_ = kCountedFrom_ns / period_ns_;
}

// Returns true if a lag has been caught up: the frames no longer arrive faster than the device's rate. Otherwise the device
// has become faster, and the lag persists.
inline bool StreamAge::has_settled(double late, std::uint64_t host_ns) noexcept {
    if (late > 0.9 * max_late_ns_) {
        max_late_ns_ = std::max(max_late_ns_, late);
        max_late_at_ = host_ns;
    }
    if (late > kCaughtUp_ns) {
        if (late > kLate_ns) settle_until_ = 0;
        return settle_until_ != 0 && host_ns > settle_until_;
    }
    // A falling offset shows that the lag is still being caught up.
    if (settle_until_ == 0 || bound_.offset_ns() < settle_offset_ns_ - kFallen_ns) {
        const auto took_ns = double(host_ns - max_late_at_), lasted_ns = double(host_ns - punctual_ns_);
        double settle_ns = kMinSettle_ns;
        if (took_ns > max_late_ns_ / kFaster) settle_ns = std::max(settle_ns, took_ns / max_late_ns_ * kSettled_ns);
        // An error of the rate hides a part of the lag, and is detected within twice the duration of the lag.
        const double error = std::max(bound_.uncertainty(), kHiddenByRate_ns / double(punctual_ns_ - known_ns_ + 1));
        if (std::min(error, kMaxRateError) * lasted_ns > kLate_ns) settle_ns = std::max(settle_ns, 2 * lasted_ns);
        settle_until_ = host_ns + std::uint64_t(settle_ns);
        settle_offset_ns_ = bound_.offset_ns();
    }
    return host_ns >= settle_until_;
}

// As frames_since(), also for a counter that restarts or leaps without a silence: it has wrapped at a value that the format
// does not state, such as 99, or was damaged. An existing lag then persists. Negative: old frames are sent again.
inline double StreamAge::advance_of(const Frame& frame, double silence_ns) const noexcept {
    if (!has_frame_) return 0;
    const double advance = frames_since(frame, silence_ns);
    if (advance == 1) return advance;
    const bool is_long = range_ns(frame) > kShortest_ns || interval_ns() <= 0;  // otherwise old numbers prove nothing
    if (advance == 0 && back_ > 0 && is_long && !has_begun(frame, silence_ns)) return -back_;
    if (is_reopened_ || silence_ns > kLate_ns + period_ns_) return advance;
    const double passed = period_ns_ > 0 ? silence_ns / period_ns_ : frame.sequence + 1.0;
    if (advance == 0) return std::min(frame.sequence + 1.0, std::ceil(passed + kLate_ns / std::max(period_ns_, 1.0)));
    const bool leapt = period_ns_ > 0 && late_ns_ + silence_ns - advance * period_ns_ < -2 * kLate_ns;
    if (!leapt) return advance;
    // A short counter has gone back by the rest of its range, unless the range is shorter than a path keeps frames.
    return range_ns(frame) < kShortCounter_ns && range_ns(frame) > kShortest_ns
               ? advance - std::ldexp(1.0, frame.sequence_bits)
               : std::max(1.0, std::nearbyint(passed));
}

// Lateness while the rate is unknown: only a silence shows a lag. Returns 0 if nothing is known.
inline double StreamAge::late_while_learning(const Frame& frame, double advance, double silence_ns,
                                             std::uint64_t host_ns) noexcept {
    const double mean = mean_ns();
    if (advance < 0) {
        is_unproved_ = must_reopen_ = true;
        return 0;
    }
    // Three intervals of a slow device may hide a lag of more than stale_ms, so such a silence counts, too.
    const double frames = std::max(advance, 1.0);
    const bool is_silence = silence_ns > frames * std::max(3 * mean, kLate_ns) ||
                            (mean > 0 && silence_ns - frames * mean > std::max(stale_ns_, kLate_ns));
    if (is_reopened_ || advance == 0) {
        learn_frames_ = learned_ns_ = 0;
        mean_before_ns_ = mean;
    }
    if (is_reopened_) {
        const bool counts_each_connection = route_.reopening_discards && advance == 0 && opened_ns_ != 0 &&
                                            frame.sequence * mean < double(host_ns - opened_ns_) + kLate_ns;
        // The frames of the time in which the link was closed must be missing.
        const double error_ns = route_.reopening_discards ? std::min(silence_ns / 8, 2 * kLate_ns) : silence_ns / 8;
        const bool is_kept = !counts_each_connection && silence_ns - advance * mean > kLate_ns + error_ns;
        is_unproved_ = is_unproved_ || is_kept;
        return is_kept ? silence_ns + kLate_ns : 0;
    }
    is_unproved_ = is_unproved_ || is_silence;
    // A silence is not used as an interval, unless no interval is known yet.
    if (advance == 0 || (is_silence && mean > 0) || must_reopen_) return 0;
    learn_frames_ += advance;
    learned_ns_ += silence_ns;
    // The device was never slower than max_period_ns_ after it became faster, so a longer interval is a growing lag.
    if (max_period_ns_ > 0 && learned_ns_ - learn_frames_ * max_period_ns_ > kLate_ns) is_unproved_ = true;
    if (!is_unproved_) learn_rate(host_ns);  // a rate measured during a silence or a backlog is not the device's
    return 0;
}

inline double StreamAge::late_by_counter(const Frame& frame, double advance, double silence_ns,
                                         std::uint64_t host_ns) noexcept {
    counted_ += advance < 0 ? std::max(advance, -2 * AgeBound::kReplay_ns / period_ns_) : std::max(advance, 1.0);
    counted_ = std::max(counted_, 0.0);
    const unsigned set_back_before = bound_.set_back();
    const double late = bound_.late_ns(host_ns, std::uint64_t(counted_ * period_ns_));
    must_reopen_ = must_reopen_ || bound_.set_back() != set_back_before;  // a lag may have begun in between
    if (advance != 0 && !seems_restarted(frame, late_ns_ + silence_ns - advance * period_ns_)) return late;
    // The device has restarted. An existing lag persists, and a lag may have begun in the silence.
    must_reopen_ = must_reopen_ || is_unproved_ || silence_ns > kLate_ns + period_ns_;
    if (!is_unproved_) bound_.restart();
    return 0;
}

// Returns true if the path may have kept its frames at a reopening: the device has restarted or counts each connection from
// 0, or the counter has advanced by more than the time since the last proved frame. The next opening decides.
inline bool StreamAge::may_be_kept(const Frame& frame, double advance, std::uint64_t host_ns) noexcept {
    if (!is_reopened_ || !route_.reopening_discards) return false;
    const double interval = interval_ns();
    const bool leapt = advance * interval > 1.25 * double(host_ns - punctual_ns_) + kLate_ns;
    const bool is_of_connection = opened_ns_ != 0 && frame.sequence * interval < double(host_ns - opened_ns_) + kLate_ns;
    const bool begins = advance == 0 || (leapt && is_of_connection);
    const bool began_before = std::exchange(began_at_opening_, begins);
    return begins ? !began_before : leapt;
}

inline void StreamAge::by_sequence(Frame& frame, std::uint64_t host_ns) noexcept {
    proof_ = Proof::sequence;
    const double silence_ns = has_frame_ ? double(host_ns - host_ns_) : 0;
    const double advance = advance_of(frame, silence_ns);
    if (silence_ns > kLate_ns) {
        const double range = range_ns(frame), interval = interval_ns();
        // The counter may have wrapped any number of times, so it does not show how long the path held this frame.
        if (has_waited(host_ns) && silence_ns > range / 2) must_reopen_ = true;
        // A lag of the counter's range cannot be distinguished from no lag.
        if (!is_reopened_ && interval > 0 && silence_ns > std::max(range - kLate_ns, kLate_ns + interval))
            must_reopen_ = true;
    }
    const bool is_kept = may_be_kept(frame, advance, host_ns);
    must_reopen_ = must_reopen_ || is_kept;
    bool late_is_known = period_ns_ > 0;
    double late = late_is_known ? late_by_counter(frame, advance, silence_ns, host_ns)
                                : late_while_learning(frame, advance, silence_ns, host_ns);
    bool on_trial = is_on_trial(advance, host_ns);
    is_unproved_ = is_unproved_ || must_reopen_;
    if (late_is_known && !is_unproved_ && late > kLate_ns) {
        is_unproved_ = true;
        max_late_ns_ = 0;
        settle_until_ = 0;
    }
    if (late_is_known && is_unproved_ && !must_reopen_) is_unproved_ = !has_settled(late, host_ns);
    if (late_is_known && bound_.is_too_fast()) {  // the counter is unusable as a clock; its rate must be measured again
        is_unproved_ = true;
        late_is_known = false;
        late = is_reopened_ ? silence_ns + kLate_ns : 0;
        max_period_ns_ = period_ns_;
        period_ns_ = 0;
        learn_frames_ = learned_ns_ = mean_before_ns_ = 0;
    }
    // The device had paused if the counter is as far behind as before and the reopening discarded no held frames. If a part
    // of a lag was discarded, the rest of the lag decides.
    const bool had_paused = !late_is_known || late > late_ns_ - kLate_ns;
    if (is_unproved_ && had_paused && has_discarded(late) && !is_kept && !has_waited(host_ns) && !bound_.has_gone_back() &&
        !may_come_again(host_ns)) {
        bound_.restart();
        bound_.end_fall();
        late = 0;
        is_unproved_ = must_reopen_ = false;
        known_ns_ = trial_ns_ = host_ns;
        trial_frames_ = 0;
        trial_interval_ns_ = interval_ns();
        on_trial = true;
    }
    late_ns_ = late;
    const bool is_falling = late_is_known && bound_.is_falling();
    frame.age = is_unproved_ || on_trial || is_falling ? Frame::Age::unproved : Frame::Age::proved;
    if (!is_unproved_) {
        punctual_ns_ = host_ns;
        backdate(frame, late);
    }
    put_trouble(is_unproved_, host_ns);
}

}  // namespace tactiled
