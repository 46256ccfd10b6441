// Part of stream_age.hpp: the proof by the device's clock. Detects restarts, a clock that was set or has a wrong unit, and a
// lag that the path has discarded.
#pragma once
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

inline void StreamAge::begin_clock(double silence_ns) noexcept {
    // The delay of a cable is bounded, so the clock is only a second check there, and it may be a ceramic resonator.
    const bool cable = route_.path == Route::Path::direct;
    const double ppm = cable ? std::max(route_.clock_ppm, kResonator_ppm) : route_.clock_ppm;
    bound_ = AgeBound({.max_drift = ppm * 1e-6, .wander = cable ? 500e-6 : ppm * 0.2e-6, .wrap_ns = kWrap_ns});
    has_clock_ = true;
    is_resonator_ = cable;
    // A lag that the counter showed may persist, and a lag may have begun in this silence.
    const bool was_silent = interval_ns() > 0 && silence_ns > kLate_ns + interval_ns();
    is_unproved_ = is_network() && has_frame_ && (is_unproved_ || was_silent);
}

// Compares the clock and the counter of a frame with those of the frame before. Inlining saves 20 of 430 instructions
// (09f02815).
[[gnu::always_inline]] inline StreamAge::ClockStep StreamAge::clock_step(const Frame& frame,
                                                                         std::uint64_t host_ns) const noexcept {
    ClockStep step;
    step.silence_us = double(host_ns - host_ns_) * 1e-3;
    // Decoders interpret a clock that restarts in the second half of its 32 bits as a wrap.
    const std::uint64_t booted_us = frame.device_time_us & 0xFFFFFFFF;
    step.booted_us = double(booted_us);
    const auto ahead_us = double(frame.device_time_us - device_time_us_);  // valid if it has not gone back
    step.went_back = frame.device_time_us < device_time_us_ ||
                     (frame.device_time_us >> 32 != device_time_us_ >> 32 && ahead_us > step.silence_us + 1e6);
    const bool is_silent = interval_us_ > 0 && step.silence_us > kLate_ns * 1e-3 + interval_us_;
    const bool is_small = has_frame_ && step.booted_us < kBegun_us + step.silence_us;
    // The clock of a restarted device is small, too. Otherwise a short counter shows an old frame, or that the path has
    // discarded more frames than the counter's range.
    step.counter_began = is_small && frame.has_sequence && frames_since(frame, double(host_ns - host_ns_)) == 0;
    step.ended = AgeBound::is_early_wrap(device_time_us_ * 1000, frame.device_time_us * 1000) && !step.counter_began;
    // A device whose counter continues has not restarted; its clock has wrapped or was set back.
    const bool counter_leapt = double(frame.lost) * interval_us_ >= step.silence_us + 1e6;
    const bool counts_on = frame.has_sequence && !is_reopened_ && !step.counter_began && !counter_leapt;
    const bool is_other = is_small && !counts_on && booted_us < (device_time_us_ & 0xFFFFFFFF);
    step.clock_began =
        is_other && !step.ended && step.went_back && booted_us < device_time_us_ / 2 && step.silence_us > kLate_ns * 1e-3;
    // The device has restarted, or its clock has wrapped during a pause.
    step.may_have_begun = is_other && is_silent;
    // The clock was set forward, or the device had paused while the path held its frames, or the frame is from another
    // device. A cable holds no frames.
    const bool may_lag = late_ns_ > kLate_ns || is_silent || (frame.has_sequence && counter_leapt);
    // The end of a lag makes the clock leap, too, with missing numbers.
    const double explained_us =
        late_ns_ > kLate_ns ? interval_us_ * (frame.has_sequence ? kCountedLeap + 1.25 * frame.lost : kLeap) : 0;
    const double drift = is_resonator_ ? kResonator_ppm : route_.clock_ppm;
    const double most_us = step.silence_us * (1 + drift * 1e-6) + kLate_ns * 1e-3;
    const bool is_leap = frame.device_time_us > device_time_us_ && ahead_us > std::max(most_us, explained_us);
    step.leapt = is_network() && has_frame_ && !is_reopened_ && may_lag && is_leap;
    return step;
}

// Lateness by the clock, before the device is known to have restarted.
inline double StreamAge::late_by_clock(const Frame& frame, std::uint64_t host_ns, ClockStep& step) noexcept {
    if (frame.device_time_us > device_time_us_ && !is_reopened_ && has_frame_ && device_time_us_ != 0) {
        const double interval_us = std::min(double(frame.device_time_us - device_time_us_), 2e6);
        interval_us_ += interval_us_ > 0 ? (std::min(interval_us, kLeap * interval_us_) - interval_us_) * 0.05 : interval_us;
    }
    const bool is_next = frame.has_sequence && !is_reopened_ && frame.sequence == sequence_ + 1 + frame.lost;
    const bool is_old = back_ > 0 && !step.counter_began;
    const unsigned set_back_before = bound_.set_back();
    const bool had_gone_back = bound_.has_gone_back();
    const double offset_ns = bound_.offset_ns();
    const double late = bound_.late_ns(host_ns, frame.device_time_us * 1000,
                                       is_next  ? AgeBound::Origin::is_new
                                       : is_old ? AgeBound::Origin::is_old
                                                : AgeBound::Origin::unknown);
    step.set_back = bound_.set_back() != set_back_before;
    const bool old_frames_end = had_gone_back && !bound_.has_gone_back() && !step.set_back && bound_.fell_ns() <= kLate_ns;
    step.leapt = step.leapt && !old_frames_end;
    step.leapt_while_back = had_gone_back && !old_frames_end && offset_ns - bound_.offset_ns() > kLate_ns;
    const bool begins = is_reopened_ || step.clock_began || step.ended || step.set_back || bound_.has_wrapped();
    device_time_us_ = begins ? frame.device_time_us : std::max(device_time_us_, frame.device_time_us);
    return late;
}

// Returns true if the device and its clock have restarted, so that the reference is invalid.
inline bool StreamAge::has_restarted(const ClockStep& step, double late) const noexcept {
    // After a reopening the clock may have wrapped instead; then it fits the reference.
    const bool fits = is_reopened_ && late < kFits_ns;
    const bool began = step.counter_began || (step.clock_began && !fits && !bound_.has_wrapped());
    return began && (late > kLate_ns || (step.counter_began && step.went_back) || bound_.has_fallen() || step.set_back);
}

// Returns true if a lag may have begun that the clock does not show: at a restart, or when the clock was set forward.
inline bool StreamAge::may_hide_lag(const ClockStep& step, double late, bool restarted) noexcept {
    const double lag_ns = std::max(step.silence_us - interval_us_, 0.0) * 1e3;  // maximum lag
    const bool discards = route_.reopening_discards;
    // A reopening has either discarded the earlier lags or proves nothing.
    const double hidden_ns = std::exchange(hidden_ns_, is_reopened_ ? 0 : hidden_ns_);
    if (restarted) {
        hidden_ns_ += lag_ns;
        return hidden_ns_ > kLate_ns && discards;
    }
    const double fell_ns = bound_.fell_ns();
    // A clock that fits the reference has wrapped during a pause.
    const bool may_have_restarted = step.may_have_begun && (late > kLate_ns || fell_ns > kLate_ns);
    // After the path has discarded a lag, the frames are as late as before the lag, and not earlier.
    const bool was_set_on = is_reopened_ ? (late_ns_ > kLate_ns && !is_unproved_ && bound_.has_fallen()) ||
                                               (discards && fell_ns > kLate_ns + hidden_ns) || step.leapt_while_back
                                         : step.leapt || (late_ns_ > kLate_ns && fell_ns > kLate_ns);
    const bool hides = was_set_on || (may_have_restarted && discards);
    if (hides && !is_reopened_) hidden_ns_ += lag_ns;
    return hides;
}

inline void StreamAge::by_clock(Frame& frame, std::uint64_t host_ns) noexcept {
    if (!has_clock_) begin_clock(has_frame_ ? double(host_ns - host_ns_) : 0);
    proof_ = Proof::clock;
    ClockStep step = clock_step(frame, host_ns);
    double late = late_by_clock(frame, host_ns, step);
    const bool restarted = has_restarted(step, late);
    const bool hides_lag = is_network() && may_hide_lag(step, late, restarted);
    if (restarted) {  // an existing lag may persist
        is_unproved_ = is_unproved_ || (late_ns_ > kLate_ns && is_network());
        bound_.restart();
        late = 0;
        device_time_us_ = frame.device_time_us;
    }
    const bool was_silent = bound_.silence_before_set_back_ns() > kLate_ns + interval_us_ * 1e3;
    const bool may_be_old = bound_.may_be_old() && route_.reopening_discards;
    const bool set_back_hides_lag =
        step.set_back && !step.counter_began && !step.clock_began && is_network() && (was_silent || may_be_old);
    const bool too_fast = bound_.is_too_fast() && is_network();
    is_no_clock_ = is_no_clock_ || bound_.is_no_clock() || (bound_.is_too_fast() && is_resonator_);
    is_unproved_ = is_unproved_ || hides_lag || set_back_hides_lag || too_fast || is_no_clock_;
    if (has_discarded(late) && !hides_lag && !is_no_clock_ && !has_waited(host_ns) && !bound_.has_gone_back()) {
        is_unproved_ = false;
        bound_.end_fall();
        if (too_fast) {  // this frame is on time: the drift is learned again, with the limits of a resonator
            bound_ =
                AgeBound({.max_drift = kResonator_ppm * 1e-6, .wander = route_.clock_ppm * 0.2e-6, .wrap_ns = kWrap_ns});
            late = bound_.late_ns(host_ns, frame.device_time_us * 1000);
            is_resonator_ = true;
        }
    }
    const double waited_ns =
        frame.since_ns != 0 && frame.since_ns < frame.taken_ns ? double(frame.taken_ns - frame.since_ns) : 0;
    late_ns_ = std::max(late - waited_ns, 0.0);  // lateness by the path
    backdate(frame, late);
    // On a cable the clock is a second check, and a clock that is too fast detects nothing.
    if (route_.path == Route::Path::direct && (bound_.is_too_fast() || is_no_clock_)) return by_cable(frame, host_ns);
    if (is_unproved_ || (bound_.is_falling() && is_network())) frame.age = Frame::Age::unproved;
    if (!is_unproved_) punctual_ns_ = host_ns;
    put_trouble(late > stale_ns_ || is_unproved_, host_ns);
}

}  // namespace tactiled
