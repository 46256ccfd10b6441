// Part of stream_age.hpp. The proof by the device's clock: has it begun again, was it set, is it a clock at all, and has the
// path discarded a lag?
#pragma once
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

inline void StreamAge::begin_clock() noexcept {
    // On a cable a lag cannot be large: the clock is a second look, and may be a ceramic resonator's.
    const bool cable = route_.path == Route::Path::direct;
    const double ppm = cable ? std::max(route_.clock_ppm, kResonator_ppm) : route_.clock_ppm;
    bound_ = AgeBound({.max_drift = ppm * 1e-6, .wander = cable ? 500e-6 : ppm * 0.2e-6, .wrap_ns = kWrap_ns});
    has_clock_ = true;
    is_resonator_ = cable;
    is_unproved_ = false;
}

// Compares the clock and the counter of a frame with those of the frame before. Inlined: 20 of 430 instructions fewer
// (09f02815).
[[gnu::always_inline]] inline StreamAge::ClockStep StreamAge::clock_step(const Frame& frame,
                                                                         std::uint64_t host_ns) const noexcept {
    ClockStep step;
    step.silence_us = double(host_ns - host_ns_) * 1e-3;
    step.ended = AgeBound::is_early_wrap(device_time_us_ * 1000, frame.device_time_us * 1000);
    // Decoders take a clock that begins again in the second half of its 32 bits for one that has passed its end.
    const std::uint64_t booted_us = frame.device_time_us & 0xFFFFFFFF;
    step.booted_us = double(booted_us);
    const auto ahead_us = double(frame.device_time_us - device_time_us_);  // if it has not gone back
    step.went_back = frame.device_time_us < device_time_us_ ||
                     (frame.device_time_us >> 32 != device_time_us_ >> 32 && ahead_us > step.silence_us + 1e6);
    // The clock of a device that restarted is small, too: else a short counter shows an old frame, or that a path has
    // discarded more frames than the counter's range.
    step.counter_began = has_frame_ && !step.ended && frame.has_sequence && step.booted_us < kBegun_us + step.silence_us &&
                         frames_since(frame, double(host_ns - host_ns_)) == 0;
    // A device whose counter goes on has not restarted: its clock has passed its end, or was set back.
    const bool counts_on = frame.has_sequence && !is_reopened_ && !step.counter_began &&
                           double(frame.lost) * interval_us_ < step.silence_us + 1e6;
    step.clock_began = has_frame_ && !step.ended && !counts_on && step.booted_us < kBegun_us + step.silence_us &&
                       step.went_back && booted_us < device_time_us_ / 2 && step.silence_us > kLate_ns * 1e-3;
    // Either the clock was set on, or the device had paused while the path held its frames. A cable holds none. A leap after
    // the clock had gone back may be the end of old frames.
    step.leapt = is_network() && !bound_.has_gone_back() && late_ns_ > kLate_ns && !is_reopened_ &&
                 frame.device_time_us > device_time_us_ && ahead_us > step.silence_us + kLate_ns * 1e-3 &&
                 ahead_us > (frame.has_sequence ? kCountedLeap : kLeap) * interval_us_ * (1.0 + frame.lost);
    return step;
}

inline void StreamAge::by_clock(Frame& frame, std::uint64_t host_ns) noexcept {
    if (!has_clock_) begin_clock();
    proof_ = Proof::clock;
    const ClockStep step = clock_step(frame, host_ns);
    if (frame.device_time_us > device_time_us_ && !is_reopened_ && has_frame_)
        interval_us_ += (std::min(double(frame.device_time_us - device_time_us_), 2e6) - interval_us_) * 0.05;
    const bool is_next = frame.has_sequence && !is_reopened_ && frame.sequence == sequence_ + 1 + frame.lost;
    const bool is_old = back_ > 0 && !step.counter_began;
    const bool begins = is_reopened_ || step.clock_began || step.ended;
    device_time_us_ = begins ? frame.device_time_us : std::max(device_time_us_, frame.device_time_us);
    const unsigned set_back_before = bound_.set_back();
    double late = bound_.late_ns(host_ns, frame.device_time_us * 1000,
                                 is_next  ? AgeBound::Origin::is_new
                                 : is_old ? AgeBound::Origin::is_old
                                          : AgeBound::Origin::unknown);
    const bool set_back = bound_.set_back() != set_back_before;
    if (set_back || bound_.has_wrapped()) device_time_us_ = frame.device_time_us;

    // After a new opening the clock may as well have passed the end of its 32 bits: then it fits the reference.
    const bool fits = is_reopened_ && late < kFits_ns;
    const bool began = step.counter_began || (step.clock_began && !fits && !bound_.has_wrapped());
    if (began && (late > kLate_ns || (step.counter_began && step.went_back) || bound_.has_fallen() || set_back)) {
        // A new reference. A lag that there was may still be there, and one may have begun in the silence, as far as the
        // device's time does not explain it.
        const bool may_lag = step.silence_us - step.booted_us > kLate_ns * 1e-3 + interval_us_ && route_.reopening_discards;
        is_unproved_ = is_unproved_ || may_lag || (late_ns_ > kLate_ns && is_network());
        bound_.restart();
        late = 0;
    }
    // A path that has discarded a lag makes the frames as late as they were before it, and not earlier.
    const bool leapt_while_closed = is_reopened_ && late_ns_ > kLate_ns && bound_.has_fallen() && !began && is_network();
    const bool was_silent = bound_.silence_before_set_back_ns() > kLate_ns + interval_us_ * 1e3;
    const bool may_be_old = bound_.may_be_old() && route_.reopening_discards;
    const bool may_have_begun =
        set_back && !step.counter_began && !step.clock_began && is_network() && (was_silent || may_be_old);
    const bool too_fast = bound_.is_too_fast() && is_network();
    is_no_clock_ = is_no_clock_ || bound_.is_no_clock() || (bound_.is_too_fast() && is_resonator_);
    is_unproved_ = is_unproved_ || step.leapt || leapt_while_closed || may_have_begun || too_fast || is_no_clock_;
    if (has_discarded(late) && !leapt_while_closed && !is_no_clock_ && !has_waited(host_ns) && !bound_.has_gone_back()) {
        is_unproved_ = false;
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
    put_trouble(late > stale_ns_ || is_unproved_, host_ns);
}

}  // namespace tactiled
