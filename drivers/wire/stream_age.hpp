// Proves the age of the frames of one device, or reports that it is not proved. Time comes only from the caller. The
// page freshness.md explains the rules.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "drivers/frame.hpp"
#include "drivers/wire/age_bound.hpp"

namespace tactiled {

// The path from a device to this machine.
struct Route {
    enum class Path : std::uint8_t {
        polled,  // each frame answers a request, whose time limits the age
        direct,  // a cable: its buffers and its rate limit the delay, and the driver sets the time of the bytes
        network  // may delay frames for any time
    } path = Path::direct;
    bool device_clock = false;        // device_time_us is the time of the measurement
    bool reopening_discards = false;  // the path drops its waiting frames when the link is closed
    double clock_ppm = 200;           // largest error or change of the device's clock, or of its rate
};

class StreamAge {
public:
    // How the age is proved. The values are those of tactiled_sensor.freshness.
    enum class Proof : std::uint8_t { unknown, polled, direct, clock, sequence, arrival };

    // `rate_Hz`: the declared rate of frames, 0 = none; `stale_ns`: the age at which a value cannot be used.
    StreamAge(double rate_Hz, double rate_tolerance, std::uint64_t stale_ns)
        : declared_ns_(rate_Hz > 0 ? 1e9 / rate_Hz : 0), tolerance_(rate_tolerance), stale_ns_(double(stale_ns)) {}

    // Begins again for a link with this path that was opened at `opened_ns` of the host's time, 0 = not known. rt:
    // wait-free
    void open(const Route& route, std::uint64_t opened_ns = 0) noexcept;

    // Sets t_ns, late_ns and age of `frame`, which was read from the kernel at `frame.taken_ns`. `host_ns` is the
    // same time on a clock without corrections that also runs while the machine is suspended. Every frame of the
    // device must pass here, in order. rt: as AgeBound::late_ns()
    void judge(Frame& frame, std::uint64_t host_ns) noexcept;

    [[nodiscard]] Proof proof() const noexcept { return proof_; }
    // Returns true if judge() uses the host's time for this frame. rt: wait-free
    [[nodiscard]] bool uses_host_time(const Frame& frame) const noexcept {
        return route_.path == Route::Path::network ||
               (route_.path == Route::Path::direct && route_.device_clock && frame.device_time_us != 0);
    }
    // The age is not proved, or too large. rt: wait-free
    [[nodiscard]] bool is_in_trouble() const noexcept { return trouble_ns_ != 0 && route_.reopening_discards; }
    // Host time since which the age is not proved or too large; 0: it is proved. rt: wait-free
    [[nodiscard]] std::uint64_t trouble_ns() const noexcept { return trouble_ns_; }
    // How long the link should stay closed when it is opened again: the frames that a path discards meanwhile must be seen
    // to be missing. rt: wait-free
    [[nodiscard]] std::uint64_t closed_ns() const noexcept {
        return std::uint64_t(std::clamp(kMissingFrames * period_ns_, kMinClosed_ns, kMaxClosed_ns));
    }
    // Opening the link again may prove what is not proved now, or end a lag that lasts. rt: wait-free
    [[nodiscard]] bool asks_for_reopening(std::uint64_t host_ns) const noexcept {
        return is_in_trouble() && std::int64_t(host_ns - trouble_ns_) > kPatience_ns;
    }

private:
    static constexpr double kLate_ns = 50e6;  // jitter of 20 ms, USB polls of 16 ms and some more are no lag
    static constexpr double kCaughtUp_ns = 25e6;
    static constexpr std::int64_t kPatience_ns = 500'000'000;  // in which a backlog may come in
    static constexpr double kWrap_ns = 4294967296e3;           // formats send 32 bits of microseconds
    // A clock that begins again below this is of a device that restarted.
    static constexpr std::uint64_t kBooted_us = 30'000'000;
    static constexpr double kBooted_ns = double(kBooted_us) * 1e3;
    static constexpr double kFits_ns = 20e9;
    static constexpr double kResonator_ppm = 20'000;
    static constexpr double kLeap = 8, kCountedLeap = 2;  // intervals from one frame to the next
    static constexpr double kMaxRateError = 0.04;         // of the rate measured at first: delays of 36 ms in 2 s, and more
    static constexpr double kLearn_ns = 2e9;
    static constexpr double kFaster = 0.5;  // largest part by which a device gets faster than its rate
    // For a lag of this size, a device that got faster would be seen within the time that the lag took to be caught up.
    static constexpr double kSettled_ns = 160e6;
    static constexpr double kMinSettle_ns = 50e6;     // frames that were kept come faster one after the other
    static constexpr double kFallen_ns = 60e6;        // more than jitter
    static constexpr double kHiddenByRate_ns = 96e6;  // AgeBound::is_too_fast() and jitter allow a wrong rate to hide it
    static constexpr double kShortCounter_ns = 60e9;
    static constexpr double kMaxWait_ns = 5e9;
    static constexpr double kMinClosed_ns = 200e6, kMaxClosed_ns = 2e9, kMissingFrames = 4;
    static constexpr unsigned kLearnFrames = 10;

    void by_clock(Frame& frame, std::uint64_t host_ns) noexcept;
    void by_sequence(Frame& frame, std::uint64_t host_ns) noexcept;
    void by_arrival(Frame& frame, std::uint64_t host_ns) noexcept;
    void by_cable(Frame& frame) noexcept;
    void backdate(Frame& frame, double late_ns) noexcept;
    [[nodiscard]] double range_ns(const Frame& frame) const noexcept { return std::ldexp(period_ns_, frame.sequence_bits); }
    void learn_rate(double advance, std::uint64_t host_ns) noexcept;
    void begin_to_count() noexcept;
    [[nodiscard]] bool has_settled(double late, std::uint64_t host_ns) noexcept;
    [[nodiscard]] double frames_since(const Frame& frame, double silence_ns) const noexcept;
    [[nodiscard]] bool seems_restarted(const Frame& frame, double late_ns) const noexcept;
    // The path has discarded what it held when it was closed: the device's time, or its counter, has gone on meanwhile.
    // `late_ns` of a path that keeps its frames has grown by the time for which it was closed.
    [[nodiscard]] bool has_discarded(double late_ns) const noexcept {
        return is_reopened_ && route_.reopening_discards && late_ns < late_ns_ + kLate_ns;
    }
    // The first frame after the opening has come later than ever before, by more than its device and jitter explain: the
    // path may have held it, and nothing that the opening discarded shows its age.
    [[nodiscard]] bool has_waited(std::uint64_t host_ns) const noexcept {
        return is_reopened_ && opened_ns_ != 0 && period_ns_ > 0 &&
               double(host_ns - opened_ns_) > wait_ns_ + std::max(3 * period_ns_, kLate_ns);
    }
    void put_trouble(bool is_trouble, std::uint64_t host_ns) noexcept {
        trouble_ns_ = !is_trouble ? 0 : trouble_ns_ == 0 ? host_ns : trouble_ns_;
    }

    Route route_;
    double declared_ns_, tolerance_, stale_ns_;
    Proof proof_ = Proof::unknown;
    AgeBound bound_;
    bool has_clock_ = false, is_unproved_ = false, is_reopened_ = false, has_frame_ = false;
    std::uint64_t t_ns_ = 0, host_ns_ = 0;  // of the previous frame
    std::uint64_t trouble_ns_ = 0;
    std::uint64_t opened_ns_ = 0;   // host time; 0: not known, or a frame has come since
    double wait_ns_ = kMaxWait_ns;  // shortest time from an opening to its first frame

    bool is_resonator_ = false;             // bound_ allows for a clock like that of a ceramic resonator
    bool is_no_clock_ = false;              // and it was faster still: its unit is another one
    std::uint64_t device_time_us_ = 0;      // the latest one
    double late_ns_ = 0, interval_us_ = 0;  // lateness of the frame before; mean interval of the device's times

    // The counter as a clock.
    std::uint32_t sequence_ = 0;
    double period_ns_ = 0;        // 0: not known yet
    double max_period_ns_ = 0;    // > 0: the device has got faster than this since
    double counted_ = 0;          // frames since the first one
    std::uint64_t learn_ns_ = 0;  // host time of the first frame that period_ns_ is learnt from
    double learn_frames_ = 0;
    bool must_reopen_ = false;        // no number can prove the age until then
    double max_late_ns_ = 0;          // the largest lateness in this lag
    std::uint64_t max_late_at_ = 0;   // when it was so late, by a tenth
    std::uint64_t settle_until_ = 0;  // 0: no lag has been caught up
    double settle_offset_ns_ = 0;     // offset of host and counter when it began to settle
    std::uint64_t known_ns_ = 0;      // host time since which the rate is as it was learnt
    std::uint64_t punctual_ns_ = 0;   // host time of the last frame that was proved
};

inline void StreamAge::open(const Route& route, std::uint64_t opened_ns) noexcept {
    const bool first = proof_ == Proof::unknown && !has_frame_;
    const bool other = route.path != route_.path || route.clock_ppm != route_.clock_ppm;
    route_ = route;
    if (first || other) {
        bound_ = AgeBound();
        has_clock_ = is_unproved_ = must_reopen_ = has_frame_ = false;
    }
    is_reopened_ = has_frame_;
    trouble_ns_ = 0;
    opened_ns_ = opened_ns;
}

inline void StreamAge::judge(Frame& frame, std::uint64_t host_ns) noexcept {
    if (frame.taken_ns < frame.t_ns) frame.taken_ns = frame.t_ns;
    // Two frames of one read have the same time, and each conversion to the host's clock has an error.
    if (has_frame_) host_ns = std::max(host_ns, host_ns_);
    if (route_.path == Route::Path::polled) {
        proof_ = Proof::polled;
        return;
    }
    // The last frame again, from a server that sends it to each client: it is not the first one of the new connection.
    if (is_reopened_ && frame.has_sequence && frame.sequence == sequence_) {
        frame.age = Frame::Age::unproved;
        return;
    }
    if (route_.device_clock && frame.device_time_us != 0)
        by_clock(frame, host_ns);
    else if (has_clock_)  // without its time for once
        frame.age = Frame::Age::unproved;
    else if (route_.path == Route::Path::direct)
        by_cable(frame);
    else if (frame.has_sequence)
        by_sequence(frame, host_ns);
    else
        by_arrival(frame, host_ns);
    if (opened_ns_ != 0) wait_ns_ = std::min(wait_ns_, double(host_ns - std::min(opened_ns_, host_ns)));
    opened_ns_ = 0;
    has_frame_ = true;
    is_reopened_ = false;
    host_ns_ = host_ns;
    t_ns_ = frame.t_ns;
}

// Sets the age of a frame that was measured `late_ns` or longer before it was read.
inline void StreamAge::backdate(Frame& frame, double late_ns) noexcept {
    const auto late = std::uint64_t(std::max(late_ns, 0.0));
    const std::uint64_t measured_ns = frame.taken_ns > late ? frame.taken_ns - late : 0;
    frame.late_ns = late;
    frame.t_ns = std::max(std::min(frame.t_ns, measured_ns), std::min(t_ns_, frame.t_ns));
}

inline void StreamAge::by_clock(Frame& frame, std::uint64_t host_ns) noexcept {
    if (!has_clock_) {
        // On a cable a lag cannot be large: the clock is a second look, and may be a ceramic resonator's.
        const bool cable = route_.path == Route::Path::direct;
        const double ppm = cable ? std::max(route_.clock_ppm, kResonator_ppm) : route_.clock_ppm;
        bound_ = AgeBound({.max_drift = ppm * 1e-6, .wander = cable ? 500e-6 : ppm * 0.2e-6, .wrap_ns = kWrap_ns});
        has_clock_ = true;
        is_resonator_ = cable;
        is_unproved_ = false;
    }
    proof_ = Proof::clock;
    const bool ended = AgeBound::is_early_wrap(device_time_us_ * 1000, frame.device_time_us * 1000);
    const auto silence_us = double(host_ns - host_ns_) * 1e-3;
    // Decoders take a clock that begins again in the second half of its 32 bits for one that has passed its end.
    const std::uint64_t booted_us = frame.device_time_us & 0xFFFFFFFF;
    const bool went_back =
        frame.device_time_us < device_time_us_ || (frame.device_time_us >> 32 != device_time_us_ >> 32 &&
                                                   double(frame.device_time_us - device_time_us_) > silence_us + 1e6);
    // The clock of a device that restarted is small, too: else a short counter shows an old frame, or that a path has
    // discarded more frames than the counter's range.
    const bool counter_began = has_frame_ && !ended && frame.has_sequence &&
                               double(booted_us) < double(kBooted_us) + silence_us &&
                               frames_since(frame, double(host_ns - host_ns_)) == 0;
    // A device whose counter goes on has not restarted: its clock has passed its end, or was set back.
    const bool counts_on = frame.has_sequence && !is_reopened_ && !counter_began &&
                           double(frame.lost) * interval_us_ < double(host_ns - host_ns_) * 1e-3 + 1e6;
    const bool clock_began = has_frame_ && !ended && !counts_on && booted_us < kBooted_us && went_back &&
                             booted_us < device_time_us_ / 2 && silence_us > kLate_ns * 1e-3;
    // Either the clock was set on, or the device had paused while the path held its frames. A cable holds none.
    const bool leapt = route_.path == Route::Path::network && late_ns_ > kLate_ns && !is_reopened_ &&
                       frame.device_time_us > device_time_us_ &&
                       double(frame.device_time_us - device_time_us_) > silence_us + kLate_ns * 1e-3 &&
                       double(frame.device_time_us - device_time_us_) >
                           (frame.has_sequence ? kCountedLeap : kLeap) * interval_us_ * (1.0 + frame.lost);
    if (frame.device_time_us > device_time_us_ && !is_reopened_ && has_frame_)
        interval_us_ += (std::min(double(frame.device_time_us - device_time_us_), 2e6) - interval_us_) * 0.05;
    sequence_ = frame.sequence;
    device_time_us_ =
        is_reopened_ || clock_began || ended ? frame.device_time_us : std::max(device_time_us_, frame.device_time_us);
    const unsigned set_back = bound_.set_back();
    double late = bound_.late_ns(host_ns, frame.device_time_us * 1000);
    if (bound_.set_back() != set_back || bound_.has_wrapped()) device_time_us_ = frame.device_time_us;
    // After a new opening the clock may as well have passed the end of its 32 bits: then it fits the reference.
    const bool fits = is_reopened_ && late < kFits_ns;
    const bool began = counter_began || (clock_began && !fits && !bound_.has_wrapped());
    if (began && (late > kLate_ns || (counter_began && went_back) || bound_.has_fallen() ||
                  bound_.set_back() != set_back)) {  // a new reference; a lag that there was may still be there
        is_unproved_ = is_unproved_ || (late_ns_ > kLate_ns && route_.path == Route::Path::network);
        // A lag may have begun in the silence, as far as the device's time does not explain it.
        if (silence_us - double(booted_us) > kLate_ns * 1e-3 + interval_us_ && route_.reopening_discards)
            is_unproved_ = true;
        bound_.restart();
        late = 0;
    }
    const bool may_have_begun = bound_.set_back() != set_back && !counter_began && !clock_began &&
                                route_.path == Route::Path::network &&
                                bound_.silence_before_set_back_ns() > kLate_ns + interval_us_ * 1e3;
    const bool too_fast = bound_.is_too_fast() && route_.path == Route::Path::network;
    // A path that has discarded a lag makes the frames as late as they were before it, and not earlier.
    const bool leapt_meanwhile = is_reopened_ && late_ns_ > kLate_ns && bound_.has_fallen() && !began &&
                                 route_.path == Route::Path::network;
    is_no_clock_ = is_no_clock_ || bound_.is_no_clock() || (bound_.is_too_fast() && is_resonator_);
    is_unproved_ = is_unproved_ || leapt || leapt_meanwhile || may_have_begun || too_fast || is_no_clock_;
    if (has_discarded(late) && !leapt_meanwhile && !is_no_clock_) {
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
    // On a cable the clock is a second look, and such a clock sees nothing.
    if (route_.path == Route::Path::direct && (bound_.is_too_fast() || is_no_clock_)) return by_cable(frame);
    if (is_unproved_ || (bound_.is_falling() && route_.path == Route::Path::network)) frame.age = Frame::Age::unproved;
    put_trouble(late > stale_ns_ || is_unproved_, host_ns);
}

// The bytes of a frame that waited for a stopped process may all have come right after it was stopped.
inline void StreamAge::by_cable(Frame& frame) noexcept {
    proof_ = Proof::direct;
    if (frame.since_ns != 0 && frame.since_ns < frame.t_ns) backdate(frame, double(frame.taken_ns - frame.since_ns));
}

// Frames that the device has counted since the one before; 0: it has restarted. The device's rate tells how often the
// counter has passed its end meanwhile. A counter that the decoder takes for one that has restarted, and that has not just
// begun, has passed its end, too.
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

// A restart that looks as if frames were lost: more of them than the time allows, or a small number of a counter whose range
// is shorter than a lag may be. `late_ns` is what the number makes of the frame's lateness.
inline bool StreamAge::seems_restarted(const Frame& frame, double late_ns) const noexcept {
    if (frame.lost == 0 || is_reopened_) return false;
    const double range = std::ldexp(1.0, frame.sequence_bits);
    const bool is_short =
        range * period_ns_ < kShortCounter_ns && frame.sequence < std::min(kBooted_ns / period_ns_, range / 8);
    return late_ns < -2 * kLate_ns || (is_short && late_ns_ + double(frame.lost) * period_ns_ > kLate_ns);
}

inline void StreamAge::learn_rate(double advance, std::uint64_t host_ns) noexcept {
    learn_frames_ += advance;
    const auto elapsed_ns = double(host_ns - learn_ns_);
    if (elapsed_ns < kLearn_ns || learn_frames_ < kLearnFrames) return;
    period_ns_ = elapsed_ns / learn_frames_;
    if (declared_ns_ > 0)
        period_ns_ = std::clamp(period_ns_, declared_ns_ / (1 + tolerance_), declared_ns_ * (1 + tolerance_));
    if (max_period_ns_ > 0) period_ns_ = std::min(period_ns_, max_period_ns_);
    begin_to_count();
    known_ns_ = host_ns;
}

inline void StreamAge::begin_to_count() noexcept {
    bound_ = AgeBound({.max_drift = kMaxRateError, .wander = route_.clock_ppm * 0.2e-6, .held_share = 0, .excess = kFaster});
    counted_ = 0;
}

// A lag has been caught up if the frames come no longer faster than the device's rate: else the device has got faster, and
// the lag is still there.
inline bool StreamAge::has_settled(double late, std::uint64_t host_ns) noexcept {
    if (late > 0.9 * max_late_ns_) {
        max_late_ns_ = std::max(max_late_ns_, late);
        max_late_at_ = host_ns;
    }
    if (late > kCaughtUp_ns) {
        if (late > kLate_ns) settle_until_ = 0;
        return settle_until_ != 0 && host_ns > settle_until_;
    }
    // While the offset falls, there is still something to catch up.
    if (settle_until_ == 0 || bound_.offset_ns() < settle_offset_ns_ - kFallen_ns) {
        const auto took_ns = double(host_ns - max_late_at_), lasted_ns = double(host_ns - punctual_ns_);
        double settle_ns = kMinSettle_ns;
        if (took_ns > max_late_ns_ / kFaster) settle_ns = std::max(settle_ns, took_ns / max_late_ns_ * kSettled_ns);
        // An error of the rate hides a part of the lag, and is seen in the end in twice the time that the lag lasted.
        const double error = std::max(bound_.uncertainty(), kHiddenByRate_ns / double(punctual_ns_ - known_ns_ + 1));
        if (std::min(error, kMaxRateError) * lasted_ns > kLate_ns) settle_ns = std::max(settle_ns, 2 * lasted_ns);
        settle_until_ = host_ns + std::uint64_t(settle_ns);
        settle_offset_ns_ = bound_.offset_ns();
    }
    return host_ns >= settle_until_;
}

inline void StreamAge::by_sequence(Frame& frame, std::uint64_t host_ns) noexcept {
    proof_ = Proof::sequence;
    const double silence_ns = has_frame_ ? double(host_ns - host_ns_) : 0;
    double advance = has_frame_ ? frames_since(frame, silence_ns) : 0;
    // A counter that begins again without a silence has passed an end that the format does not state, such as 99, and one that
    // leaps without a silence was damaged. The lag that there was is there still.
    if (has_frame_ && !is_reopened_ && silence_ns <= kLate_ns + period_ns_) {
        const double passed = period_ns_ > 0 ? silence_ns / period_ns_ : frame.sequence + 1.0;
        if (advance == 0)
            advance = std::min(frame.sequence + 1.0, std::ceil(passed + kLate_ns / std::max(period_ns_, 1.0)));
        else if (period_ns_ > 0 && late_ns_ + silence_ns - advance * period_ns_ < -2 * kLate_ns)
            advance = std::max(1.0, std::nearbyint(passed));
    }
    sequence_ = frame.sequence;
    if (!has_frame_) learn_ns_ = host_ns;
    double late = 0;
    bool late_is_known = false;
    if (period_ns_ <= 0) {  // not yet known: a silence alone shows a lag
        if (advance == 0) {
            learn_ns_ = host_ns;
            learn_frames_ = 0;
        } else {
            const double mean_ns = learn_frames_ > 0    ? double(host_ns_ - learn_ns_) / learn_frames_
                                   : max_period_ns_ > 0 ? max_period_ns_
                                                        : declared_ns_;
            if (silence_ns > advance * std::max(3 * mean_ns, kLate_ns)) is_unproved_ = true;
            // After it got faster, the device was never as slow as it seems now.
            if (max_period_ns_ > 0 && double(host_ns - learn_ns_) - (learn_frames_ + advance) * max_period_ns_ > kLate_ns)
                is_unproved_ = true;
            if (!is_unproved_) learn_rate(advance, host_ns);  // a rate over a silence, or a backlog, is not the device's
            if (is_reopened_ && advance * mean_ns < silence_ns / 2) late = silence_ns + kLate_ns;  // nothing was discarded
        }
    } else {
        counted_ += std::max(advance, 1.0);
        late = bound_.late_ns(host_ns, std::uint64_t(counted_ * period_ns_));
        late_is_known = true;
        if (advance == 0 || seems_restarted(frame, late_ns_ + silence_ns - advance * period_ns_)) {
            // The device has restarted. A lag that there was is there still, and one may have begun in the silence.
            must_reopen_ = must_reopen_ || is_unproved_ || silence_ns > kLate_ns + period_ns_;
            if (!is_unproved_) bound_.restart();
            late = 0;
        }
    }
    is_unproved_ = is_unproved_ || must_reopen_;
    if (late_is_known && !is_unproved_ && late > kLate_ns) {
        is_unproved_ = true;
        max_late_ns_ = 0;
        settle_until_ = 0;
    }
    if (late_is_known && is_unproved_ && !must_reopen_) is_unproved_ = !has_settled(late, host_ns);
    if (late_is_known && bound_.is_too_fast()) {  // the counter is no clock any more: its rate must be measured anew
        is_unproved_ = true;
        late_is_known = false;
        late = is_reopened_ ? silence_ns + kLate_ns : 0;
        max_period_ns_ = period_ns_;
        period_ns_ = 0;
        learn_frames_ = 0;
    }
    // The device had paused: its counter is behind as before, and the path held nothing that opening it again discarded. A
    // lag of which a part was discarded is judged by the rest of it.
    const bool had_paused = !late_is_known || late > late_ns_ - kLate_ns;
    const bool may_have_waited = has_waited(host_ns) && (!late_is_known || range_ns(frame) < kShortCounter_ns);
    if (is_unproved_ && had_paused && has_discarded(late) && !may_have_waited) {
        bound_.restart();
        bound_.end_fall();
        late = 0;
        is_unproved_ = must_reopen_ = false;
        known_ns_ = learn_ns_ = host_ns;
        learn_frames_ = 0;
    }
    late_ns_ = late;
    frame.age = is_unproved_ || (late_is_known && bound_.is_falling()) ? Frame::Age::unproved : Frame::Age::proved;
    if (!is_unproved_) {
        punctual_ns_ = host_ns;
        backdate(frame, late);
    }
    put_trouble(is_unproved_, host_ns);
}

inline void StreamAge::by_arrival(Frame& frame, std::uint64_t host_ns) noexcept {
    proof_ = Proof::arrival;
    const double silence_ns = has_frame_ ? double(host_ns - host_ns_) : 0;
    if (has_frame_ && !is_reopened_) {
        if (silence_ns > std::max(3 * period_ns_, kLate_ns)) {
            if (period_ns_ > 0) is_unproved_ = true;
        } else {
            period_ns_ += (silence_ns - period_ns_) / (learn_frames_ < 100 ? ++learn_frames_ : 100);
        }
        if (period_ns_ <= 0) period_ns_ = silence_ns;  // a slow device: its first interval
    }
    if (is_reopened_) is_unproved_ = !route_.reopening_discards || has_waited(host_ns);
    if (frame.since_ns != 0 && frame.since_ns < frame.t_ns) {
        backdate(frame, double(frame.taken_ns - frame.since_ns));
        is_unproved_ = true;
    }
    frame.age = is_unproved_ ? Frame::Age::unproved : Frame::Age::arrival_only;
    put_trouble(is_unproved_, host_ns);
}

}  // namespace tactiled
