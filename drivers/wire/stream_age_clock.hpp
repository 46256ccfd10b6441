// Part of stream_age.hpp. The proof by the device's clock: has it begun again, was it set, is it a clock at all, and has the
// path discarded a lag?
#pragma once
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

inline void StreamAge::begin_clock(double silence_ns) noexcept {
    // On a cable a lag cannot be large: the clock is a second look, and may be a ceramic resonator's.
    const bool cable = route_.path == Route::Path::direct;
    const double ppm = cable ? std::max(route_.clock_ppm, kResonator_ppm) : route_.clock_ppm;
    bound_ = AgeBound({.max_drift = ppm * 1e-6, .wander = cable ? 500e-6 : ppm * 0.2e-6, .wrap_ns = kWrap_ns});
    has_clock_ = true;
    is_resonator_ = cable;
    // A lag that its counter showed may be there still, and one may begin now.
    is_unproved_ = is_network() && has_frame_ && (is_unproved_ || silence_ns > kLate_ns + interval_ns());
}

// Compares the clock and the counter of a frame with those of the frame before. Inlined: 20 of 430 instructions fewer
// (09f02815).
[[gnu::always_inline]] inline StreamAge::ClockStep StreamAge::clock_step(const Frame& frame,
                                                                         std::uint64_t host_ns) const noexcept {
    ClockStep step;
    step.silence_us = double(host_ns - host_ns_) * 1e-3;
    // Decoders take a clock that begins again in the second half of its 32 bits for one that has passed its end.
    const std::uint64_t booted_us = frame.device_time_us & 0xFFFFFFFF;
    step.booted_us = double(booted_us);
    const auto ahead_us = double(frame.device_time_us - device_time_us_);  // if it has not gone back
    step.went_back = frame.device_time_us < device_time_us_ ||
                     (frame.device_time_us >> 32 != device_time_us_ >> 32 && ahead_us > step.silence_us + 1e6);
    const bool is_silent = step.silence_us > kLate_ns * 1e-3 + interval_us_;
    const bool is_small = has_frame_ && step.booted_us < kBegun_us + step.silence_us;
    // The clock of a device that restarted is small, too: else a short counter shows an old frame, or that a path has
    // discarded more frames than the counter's range.
    step.counter_began = is_small && frame.has_sequence && frames_since(frame, double(host_ns - host_ns_)) == 0;
    step.ended = AgeBound::is_early_wrap(device_time_us_ * 1000, frame.device_time_us * 1000) && !step.counter_began;
    // A device whose counter goes on has not restarted: its clock has passed its end, or was set back.
    const bool counter_leapt = double(frame.lost) * interval_us_ >= step.silence_us + 1e6;
    const bool counts_on = frame.has_sequence && !is_reopened_ && !step.counter_began && !counter_leapt;
    const bool is_other = is_small && !counts_on && booted_us < (device_time_us_ & 0xFFFFFFFF);
    step.clock_began =
        is_other && !step.ended && step.went_back && booted_us < device_time_us_ / 2 && step.silence_us > kLate_ns * 1e-3;
    // A number that has been, and a new time: of another device.
    const bool is_long = std::ldexp(interval_us_, frame.sequence_bits) > kShortCounter_ns * 1e-3;
    const bool is_contradictory = back_ > 0 && is_long && !step.counter_began && frame.device_time_us > device_time_us_;
    // It may as well have passed its end in a pause.
    step.may_have_begun = is_other && is_silent;
    // Either the clock was set on, or the device had paused while the path held its frames; or it is another device. A
    // cable holds none.
    const bool may_lag = late_ns_ > kLate_ns || is_silent || (frame.has_sequence && counter_leapt);
    // A lag that ends makes it leap, too, with numbers that are missing.
    const double lost = counter_leapt ? 0 : frame.lost;
    const double explained_us =
        late_ns_ > kLate_ns ? interval_us_ * (frame.has_sequence ? kCountedLeap + 1.25 * lost : kLeap) : 0;
    const bool is_leap =
        frame.device_time_us > device_time_us_ && ahead_us > std::max(step.silence_us + kLate_ns * 1e-3, explained_us);
    step.leapt = is_network() && has_frame_ && !is_reopened_ && ((may_lag && is_leap) || is_contradictory);
    return step;
}

inline void StreamAge::by_clock(Frame& frame, std::uint64_t host_ns) noexcept {
    if (!has_clock_) begin_clock(has_frame_ ? double(host_ns - host_ns_) : 0);
    proof_ = Proof::clock;
    const ClockStep step = clock_step(frame, host_ns);
    if (frame.device_time_us > device_time_us_ && !is_reopened_ && has_frame_)
        interval_us_ += (std::min(double(frame.device_time_us - device_time_us_), 2e6) - interval_us_) * 0.05;
    const bool is_next = frame.has_sequence && !is_reopened_ && frame.sequence == sequence_ + 1 + frame.lost;
    const bool is_old = back_ > 0 && !step.counter_began;
    const bool begins = is_reopened_ || step.clock_began || step.ended;
    device_time_us_ = begins ? frame.device_time_us : std::max(device_time_us_, frame.device_time_us);
    const unsigned set_back_before = bound_.set_back();
    const bool was_unproved = is_unproved_;
    const bool had_gone_back = bound_.has_gone_back();
    const double offset_before_ns = bound_.offset_ns();
    double late = bound_.late_ns(host_ns, frame.device_time_us * 1000,
                                 is_next  ? AgeBound::Origin::is_new
                                 : is_old ? AgeBound::Origin::is_old
                                          : AgeBound::Origin::unknown);
    const bool set_back = bound_.set_back() != set_back_before;
    if (set_back || bound_.has_wrapped()) device_time_us_ = frame.device_time_us;

    // After a new opening the clock may as well have passed the end of its 32 bits: then it fits the reference.
    const bool fits = is_reopened_ && late < kFits_ns;
    const bool began = step.counter_began || (step.clock_began && !fits && !bound_.has_wrapped());
    const bool restarts =
        began && (late > kLate_ns || (step.counter_began && step.went_back) || bound_.has_fallen() || set_back);
    if (restarts) {  // a new reference; a lag that there was may still be there
        is_unproved_ = is_unproved_ || (late_ns_ > kLate_ns && is_network());
        bound_.restart();
        late = 0;
        device_time_us_ = frame.device_time_us;
    }
    // One may have begun in the silence before a start, or in several of them.
    if (restarts || step.may_have_begun) hidden_ns_ += std::max(step.silence_us - interval_us_, 0.0) * 1e3;
    const bool start_hides = (restarts || step.may_have_begun) && hidden_ns_ > kLate_ns && route_.reopening_discards;
    // A path that has discarded a lag makes the frames as late as they were before it, and not earlier.
    const bool fell = bound_.fell_ns() > kLate_ns;
    const bool old_frames_end = had_gone_back && !bound_.has_gone_back() && !set_back && !fell;
    // No lag is longer than the time for which the age was not proved.
    const double longest_lag_ns = double(host_ns_ - punctual_ns_);
    const bool was_set_on = (late_ns_ > kLate_ns && !was_unproved && bound_.has_fallen()) ||
                            bound_.fell_ns() > kLate_ns + longest_lag_ns ||
                            (had_gone_back && !old_frames_end && offset_before_ns - bound_.offset_ns() > kLate_ns);
    const bool leapt_while_closed = is_reopened_ && was_set_on && !restarts && is_network();
    const bool leapt =
        (step.leapt && !old_frames_end) || (late_ns_ > kLate_ns && fell && !restarts && !is_reopened_ && is_network());
    const bool was_silent = bound_.silence_before_set_back_ns() > kLate_ns + interval_us_ * 1e3;
    const bool may_be_old = bound_.may_be_old() && route_.reopening_discards;
    const bool may_have_begun =
        set_back && !step.counter_began && !step.clock_began && is_network() && (was_silent || may_be_old);
    const bool too_fast = bound_.is_too_fast() && is_network();
    is_no_clock_ = is_no_clock_ || bound_.is_no_clock() || (bound_.is_too_fast() && is_resonator_);
    const bool is_doubtful = leapt || leapt_while_closed || start_hides;
    is_unproved_ = is_unproved_ || is_doubtful || may_have_begun || too_fast || is_no_clock_;
    if (has_discarded(late) && !is_doubtful && !is_no_clock_ && !has_waited(host_ns) && !bound_.has_gone_back()) {
        is_unproved_ = false;
        hidden_ns_ = 0;
        bound_.end_fall();
        if (too_fast) {  // this frame is on time: the drift is learned anew, as that of a resonator
            bound_ =
                AgeBound({.max_drift = kResonator_ppm * 1e-6, .wander = route_.clock_ppm * 0.2e-6, .wrap_ns = kWrap_ns});
            late = bound_.late_ns(host_ns, frame.device_time_us * 1000);
            is_resonator_ = true;
        }
    }
    const double waited_ns =
        frame.since_ns != 0 && frame.since_ns < frame.taken_ns ? double(frame.taken_ns - frame.since_ns) : 0;
    late_ns_ = std::max(late - waited_ns, 0.0);  // by the path
    backdate(frame, late);
    // On a cable the clock is a second look, and one that is too fast sees nothing.
    if (route_.path == Route::Path::direct && (bound_.is_too_fast() || is_no_clock_)) return by_cable(frame, host_ns);
    if (is_unproved_ || (bound_.is_falling() && is_network())) frame.age = Frame::Age::unproved;
    if (!is_unproved_) punctual_ns_ = host_ns;
    put_trouble(late > stale_ns_ || is_unproved_, host_ns);
}

}  // namespace tactiled
