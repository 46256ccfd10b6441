// Bounds the age of the frames of one device: a measured delay plus an error, which grows with the time since the last
// proof. The caller passes the time. The page freshness.md explains the method.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "drivers/frame.hpp"

namespace tactiled {

// The path from a device to this machine.
struct Route {
    enum class Path : std::uint8_t {
        polled,  // each frame answers a request, whose time limits the age
        direct,  // a cable: its buffers and its rate limit the delay, and the driver sets the time of the bytes
        network  // may delay frames for any time
    } path = Path::direct;
    bool device_clock = false;        // device_time_us is the time of the measurement
    bool reopening_discards = false;  // the path may drop its waiting frames when the link is closed: TCP
    bool has_echo = false;            // the device answers requests for its time
    double clock_ppm = 200;           // largest error of the device's clock or rate against this machine's
    bool is_new = false;              // the port hung up before this opening: nothing waits on the way
    bool is_assumed = false;          // `direct` is the kernel's word, not the user's: a radio may hang on the port
};

// x = host time - device time = offset of the clocks + delay of the path. The offset lies between low_ and up_: up_ is the
// smallest x seen, because no frame arrives before it was measured; a proof, a frame whose delay is at most D, raises low_
// to its x - D. Both follow the fitted rate, and move apart by the uncertainty of the rate. Thus the delay of a frame is at
// least x - up_ and at most x - low_. Without a clock, the device's time is the number of its frames times their mean
// interval.
class StreamAge {
public:
    // How the age is bounded. The values are those of tactiled_sensor.freshness.
    enum class Proof : std::uint8_t { unknown, polled, direct, clock, sequence, arrival };

    // `stale_ns`: the age at which a value cannot be used.
    explicit StreamAge(std::uint64_t stale_ns) : stale_ns_(double(stale_ns)) {}

    // The link was opened. `opened_ns`: the host's time, if it was opened to prove the age, else 0. rt: wait-free
    void open(const Route& route, std::uint64_t opened_ns = 0) noexcept {
        const bool is_other = route.path != route_.path || route.clock_ppm != route_.clock_ppm;
        if (is_other || route.is_new || proof_ == Proof::unknown) *this = fresh();
        route_ = route;
        is_opened_ = true;
        opened_ns_ = opened_ns;
    }

    // Sets t_ns, late_ns, bound_ns and age of `frame`, which was read from the kernel at `frame.taken_ns`. `host_ns` is the
    // same time on a clock without corrections that also runs while the machine is suspended, and `asked_ns` is
    // frame.asked_ns on that clock. Call it for every frame of the device, in order. rt: wait-free
    void judge(Frame& frame, std::uint64_t host_ns, std::uint64_t asked_ns = 0) noexcept;

    [[nodiscard]] Proof proof() const noexcept { return proof_; }
    // Returns true if judge() uses the host's time for this frame. rt: wait-free
    [[nodiscard]] bool uses_host_time(const Frame& frame) const noexcept {
        return route_.path == Route::Path::network ||
               (route_.path == Route::Path::direct && (has_clock(frame) || frame.has_sequence));
    }
    // Host time since which the bound is above stale_ns; 0: it is not. rt: wait-free
    [[nodiscard]] std::uint64_t trouble_ns() const noexcept { return trouble_ns_; }
    // True if an opening of the link may prove the age. rt: wait-free
    [[nodiscard]] bool may_ask() const noexcept {
        return route_.reopening_discards && has_frame_ && !is_opened_ && (is_clock_ || period_ns_ < stale_ns_);
    }
    // True if a proof is due, too. `is_busy`: it can wait while the bound allows. rt: wait-free
    [[nodiscard]] bool asks_for_reopening(std::uint64_t host_ns, bool is_busy) const noexcept {
        if (trouble_ns_ != 0) return double(std::int64_t(host_ns - trouble_ns_)) > stale_ns_ / 4;
        // A path that has kept frames and has caught up is asked at once, before the limit has sunk below an honest x.
        const double due = keeps_ && !is_held() ? 0 : due_ns();
        return proof_ != Proof::arrival && error_ns() > due + (is_busy ? stale_ns_ / 8 : 0);
    }
    // Time for which the link should stay closed, so that the missing frames are a gap of four. rt: wait-free
    [[nodiscard]] std::uint64_t closed_ns() const noexcept {
        const double least_ns = std::min(kJitter_ns, stale_ns_ / 2), most_ns = std::max(kJitter_ns, stale_ns_ / 2);
        return std::uint64_t(std::clamp(kMissing * period_ns_, least_ns, most_ns));
    }
    // Returns the error of the device's clock that two proofs have measured, as a fraction, > 0: slow; 0 if unknown. rt:
    // wait-free
    [[nodiscard]] double rate_error() const noexcept { return slope_; }
    // The same as the frames arrive, for a message: a queue that grows has a rate, too. rt: wait-free
    [[nodiscard]] double rate_of_arrivals() const noexcept {
        const double span_ns = time_ns_ - first_.t_ns;
        return is_clock_ && span_ns > 0 ? (x_ - first_.offset_ns) / span_ns : 0;
    }
    [[nodiscard]] const Route& route() const noexcept { return route_; }
    // True if the path has kept frames at an opening and has not caught up: the next one may add to its lag. rt: wait-free
    [[nodiscard]] bool keeps() const noexcept { return keeps_ && is_held(); }
    // Number of openings that have made the error small. rt: wait-free
    [[nodiscard]] std::uint32_t proofs() const noexcept { return proofs_; }

private:
    // Jitter of 20 ms, polls of a USB adapter of 16 ms and their margin: no lag.
    static constexpr double kJitter_ns = 50e6;
    // Delay of the first frame where nothing limits it: three milliseconds of wire, two polls of a scheduler.
    static constexpr double kFirst_ns = 10e6;
    // A device's clock is at most this plus the silence when its first frame comes after a restart.
    static constexpr double kBegun_ns = 0.5e9;
    static constexpr double kMaxRate = 0.02;                    // a larger slope is no rate; an interval by arrivals
    static constexpr double kWander = 0.1;                      // share of a rate that changes with the temperature
    static constexpr double kSpan_ns = 3600e9;                  // the rate is that of the last one to two hours
    static constexpr double kMean_ns = 5e9, kLearn_ns = 0.5e9;  // memory of the mean interval, and its first measurement
    static constexpr double kMissing = 4;                       // periods

    static constexpr double kNone_ns = 1e200, kUnbounded_ns = 1e18;

    struct Anchor {
        double t_ns = 0, offset_ns = 0, error_ns = 0;
        bool is_set = false;
    };

    struct Count {
        double t_ns = 0, frames = 0, error_ns = 0;
        bool is_set = false;
    };

    [[nodiscard]] StreamAge fresh() const noexcept { return StreamAge(std::uint64_t(stale_ns_)); }
    // If the clock is faster than stated, x falls below the lower limit, and the rate may be wrong by as much again.
    [[nodiscard]] double error_ns() const noexcept { return std::abs(up_ - low_) + doubt_ns_; }
    [[nodiscard]] double due_ns() const noexcept { return std::clamp(2 * period_ns_, stale_ns_ / 2, stale_ns_ * 3 / 4); }
    [[nodiscard]] bool has_clock(const Frame& frame) const noexcept {
        return route_.device_clock && frame.device_time_us != 0;
    }
    [[nodiscard]] bool is_held() const noexcept { return x_ >= held_ns_; }
    [[nodiscard]] bool is_direct() const noexcept { return route_.path == Route::Path::direct; }
    [[nodiscard]] bool is_limited(const Frame& frame) const noexcept {
        return route_.path == Route::Path::polled ||
               (is_direct() && !has_clock(frame) && !(frame.has_sequence && route_.is_assumed));
    }
    void judge_limited(Frame& frame, std::uint64_t host_ns, std::uint64_t waited_ns) noexcept;
    void estimate(Frame& frame, std::uint64_t host_ns, std::uint64_t asked_ns, double waited_ns) noexcept;
    [[nodiscard]] double step_by_clock(const Frame& frame, double step_ns) noexcept;
    [[nodiscard]] double step_by_number(const Frame& frame, double step_ns) noexcept;
    [[nodiscard]] double frames_since(const Frame& frame) const noexcept;
    void begin(const Frame& frame, double silence_ns) noexcept;
    void advance(const Frame& frame, std::uint64_t host_ns, double step_ns) noexcept;
    void begin_again(double error_ns) noexcept;
    void follow(double step_ns, double advance_ns, bool is_explained) noexcept;
    void release() noexcept {
        held_ns_ = kNone_ns;
        keeps_ = false;
    }
    void test_opening(const Frame& frame, double advance_ns, double limit_ns, double host_ns) noexcept;
    void prove(double delay_ns) noexcept;
    void measure_interval(double delay_ns) noexcept;
    void learn(double step_ns, double frames) noexcept;
    void publish(Frame& frame, std::uint64_t host_ns, double waited_ns, double stopped_ns) noexcept;

    Route route_;
    double stale_ns_;
    Proof proof_ = Proof::unknown;
    bool has_frame_ = false, is_opened_ = false, is_clock_ = false;
    // x has risen at once, as if frames were held or come again: until it falls below this, no opening or cable is a proof.
    double held_ns_ = kNone_ns;
    // A frame came that was measured before an opening: this limit sinks with low_, and stays until a proof or a new begin.
    bool keeps_ = false;
    std::uint32_t proofs_ = 0;
    std::uint64_t opened_ns_ = 0, trouble_ns_ = 0;
    std::uint64_t host_ns_ = 0, t_ns_ = 0;  // of the previous frame
    std::uint32_t device_us_ = 0, sequence_ = 0;
    double time_ns_ = 0, x_ = 0, up_ = 0, low_ = 0;  // since the first frame
    double doubt_ns_ = 0;                            // error since the clock began again, until a proof
    double slope_ = 0, drift_ = 0;                   // rate of the offset, and its uncertainty
    Anchor first_, second_;
    double period_ns_ = 0, frames_ = 0;  // mean interval of the frames, and how many it is from
    double paused_at_ns_ = kNone_ns;     // x before a pause that made a doubt, until x is there again
    double counted_ = 0;                 // frames
    Count last_, base_;                  // the last proof, and the first one since which the interval is the same
    double span_interval_ns_ = 0;        // mean interval between the last two proofs; 0: not measured
};

// Returns the advance of the device's time since the previous frame, by its clock of 32 bits.
inline double StreamAge::step_by_clock(const Frame& frame, double step_ns) noexcept {
    const auto device_us = std::uint32_t(frame.device_time_us);
    const auto step_us = std::uint64_t(step_ns * 1e-3);
    const double more_us = std::int32_t(device_us - device_us_ - std::uint32_t(step_us));
    device_us_ = device_us;
    const double advance_ns = (double(step_us) + more_us) * 1e3;
    if (!is_opened_ && std::abs(more_us * 1e3) < kJitter_ns) learn(advance_ns, 1);
    return advance_ns;
}

// Returns the frames since the previous one, by its number.
inline double StreamAge::frames_since(const Frame& frame) const noexcept {
    const std::uint32_t mask = frame.sequence_bits >= 32 ? ~0u : (1u << frame.sequence_bits) - 1;
    return (frame.sequence - sequence_) & mask;
}

// Returns the same by the number of frames. Only a pause counts while the mean interval is being measured.
inline double StreamAge::step_by_number(const Frame& frame, double step_ns) noexcept {
    const double frames = !frame.has_sequence ? 1 : is_opened_ ? frames_since(frame) : 1.0 + frame.lost;
    counted_ += frames;
    if (period_ns_ <= 0) {
        learn(step_ns, frames);
        return step_ns;
    }
    const double advance_ns = frames * period_ns_;
    const double excess_ns = step_ns - advance_ns;
    const bool is_pause = excess_ns > stale_ns_ || x_ > up_ + kFirst_ns;
    const bool is_learned = frames_ * period_ns_ > kLearn_ns;
    const bool is_regular = std::abs(excess_ns) < advance_ns / 2 || !is_learned;
    // Neither a pause that makes a doubt nor the frames that end it are the device's rate. If some of those frames counted,
    // the interval would be too small afterwards, and x would rise without a lag.
    if (x_ <= paused_at_ns_ + kFirst_ns) paused_at_ns_ = kNone_ns;
    if (!is_regular && x_ + excess_ns - up_ + error_ns() >= stale_ns_) paused_at_ns_ = std::min(paused_at_ns_, x_);
    // A queue that grows stretches the interval of arrivals, but not that between proofs.
    if (!is_opened_ && span_interval_ns_ <= 0 && (is_regular || paused_at_ns_ == kNone_ns)) learn(step_ns, frames);
    return is_learned || is_pause || is_opened_ ? advance_ns : step_ns;
}

inline void StreamAge::learn(double step_ns, double frames) noexcept {
    if (frames > frames_ + 1) return;  // most of them are lost
    frames_ = std::min(frames_ + frames, std::max(kMean_ns / std::max(period_ns_, 1.0), 2.0));
    period_ns_ += (step_ns - frames * period_ns_) / frames_;
}

// The device has restarted, or its clock was set: the offset is another one.
inline void StreamAge::begin_again(double error_ns) noexcept {
    up_ = low_ = x_;
    release();
    paused_at_ns_ = kNone_ns;
    doubt_ns_ = error_ns;
    first_ = {time_ns_, x_};
    second_ = {};
}

// `is_explained`: a rise of x is no lag.
inline void StreamAge::follow(double step_ns, double advance_ns, bool is_explained) noexcept {
    up_ += (slope_ + drift_) * step_ns;
    low_ += (slope_ - drift_) * step_ns;
    if (is_clock_ && x_ < std::min(low_, up_) - kJitter_ns) {  // the clock was set on, or this machine stood still
        const Anchor first = first_;  // a clock in another unit leaps with each frame, and the next proof shows that
        begin_again(error_ns() + up_ - x_);
        first_ = first;
        return;
    }
    if (!is_clock_) x_ = std::max(x_, low_);  // a burst of the device gives no credit for a later lag
    up_ = std::min(up_, x_);
    const double risen_ns = step_ns - advance_ns - (slope_ + drift_) * step_ns;
    if (std::abs(risen_ns) > kJitter_ns / 2 && !first_.is_set) first_.offset_ns += risen_ns;  // no rate
    // A rate may look like a lag, and behind a gateway that keeps its frames a lag like a rate.
    const double by_rate = is_direct() ? 0 : keeps_ ? -drift_ : route_.clock_ppm * 1e-6;
    held_ns_ += (slope_ + by_rate) * step_ns;
    if (!keeps_ && !is_held()) release();
    const double least_ns = is_direct() ? kJitter_ns : kJitter_ns / 2;
    // A cable's frames are proved near up_ only, so half of the way back is enough there.
    if ((is_clock_ || is_direct()) && risen_ns > least_ns && !is_explained)
        held_ns_ = std::min(held_ns_, x_ - risen_ns + (is_direct() ? risen_ns / 2 : least_ns));
}

// The first frame after an opening for a proof. If the frames of the time in which the link was closed are missing, the
// path keeps none, and this one has passed it since the opening.
inline void StreamAge::test_opening(const Frame& frame, double advance_ns, double limit_ns, double host_ns) noexcept {
    const double closed_ns = double(opened_ns_) - double(host_ns_);
    double delay_ns = host_ns - double(opened_ns_);
    if (is_clock_ && advance_ns < closed_ns / 2) {  // it was measured before
        keeps_ = true;
        held_ns_ = std::min(held_ns_, x_ - (host_ns - double(host_ns_) - advance_ns) + closed_ns / 2);
    }
    if (is_held()) return;
    if (is_clock_ || frame.has_sequence) {
        // A number shows that frames are missing even if the device has paused.
        const bool is_gap = frame.has_sequence ? frames_since(frame) >= 2 : advance_ns >= 1.5 * period_ns_;
        if (!is_gap || advance_ns < closed_ns / 2 || advance_ns > limit_ns) return;
        delay_ns += std::max(closed_ns - advance_ns, 0.0);  // the path may have kept the last ones
    }
    if (!is_clock_) begin_again(delay_ns);
    prove(delay_ns);
    if (error_ns() < due_ns()) ++proofs_;
}

// This frame has been on its way for at most `delay_ns`.
inline void StreamAge::prove(double delay_ns) noexcept {
    if (delay_ns < 0 || delay_ns > x_ - up_ + error_ns()) return;  // a damaged answer, or it shows nothing new
    const bool contradicts = x_ - delay_ns > up_ || up_ < low_ || doubt_ns_ > 0;
    doubt_ns_ = 0;
    low_ = contradicts ? x_ - delay_ns : std::max(low_, x_ - delay_ns);
    up_ = contradicts ? x_ : up_;
    low_ = std::min(low_, up_);
    release();
    paused_at_ns_ = kNone_ns;
    if (!is_clock_) return measure_interval(delay_ns);
    const Anchor now{time_ns_, (up_ + low_) / 2, is_direct() ? kJitter_ns / 2 : (up_ - low_) / 2, true};
    if (!first_.is_set) first_ = now;
    const double span_ns = now.t_ns - first_.t_ns;
    if (span_ns <= 0) return;
    const double slope = (now.offset_ns - first_.offset_ns) / span_ns;
    if (std::abs(slope) > kMaxRate) {  // no rate: the clock was set, or it counts in another unit and is no proof
        if (!is_direct() && std::abs(slope) - (now.error_ns + first_.error_ns) / span_ns > kMaxRate)
            doubt_ns_ = 2 * stale_ns_;
        first_ = now;
        second_ = {};
        return;
    }
    const double error =
        (now.error_ns + first_.error_ns) / span_ns + kWander * std::max(route_.clock_ppm * 1e-6, std::abs(slope));
    if (contradicts || error < drift_) {
        slope_ = slope;
        drift_ = error;
    }
    if (span_ns > kSpan_ns / 2 && !second_.is_set) second_ = now;
    if (span_ns > kSpan_ns) first_ = std::exchange(second_, {});
}

// The frames between two proofs and the time between them give the mean interval of the device, whatever the path does. All
// spans count that agree; else the shorter one of the last two, because a pause makes a span longer.
inline void StreamAge::measure_interval(double delay_ns) noexcept {
    const Count now{time_ns_, counted_, delay_ns, true};
    if (!last_.is_set) base_ = last_ = now;
    const double span_ns = now.t_ns - last_.t_ns, all_ns = now.t_ns - base_.t_ns;
    if (span_ns < kLearn_ns || now.frames <= last_.frames) return;
    const double interval_ns = span_ns / (now.frames - last_.frames), error = (delay_ns + last_.error_ns) / span_ns;
    const double mean_ns = all_ns / (now.frames - base_.frames), mean_error = (delay_ns + base_.error_ns) / all_ns;
    const double before_ns = span_interval_ns_ > 0 ? span_interval_ns_ : period_ns_;
    const bool agrees = span_interval_ns_ > 0 && std::abs(interval_ns - mean_ns) <= (error + mean_error) * mean_ns;
    period_ns_ = agrees ? mean_ns : std::min(interval_ns, before_ns);
    drift_ = is_direct() ? kMaxRate : route_.clock_ppm * 1e-6 + (agrees ? mean_error : error);
    if (!agrees || all_ns > kSpan_ns) base_ = last_;
    span_interval_ns_ = interval_ns;
    last_ = now;
}

// Takes a frame whose age its request or its cable limits. It needs no estimate, so whole numbers suffice.
inline void StreamAge::judge_limited(Frame& frame, std::uint64_t host_ns, std::uint64_t waited_ns) noexcept {
    const bool is_polled = route_.path == Route::Path::polled;
    proof_ = is_polled ? Proof::polled : Proof::direct;
    // A slice of the wait is no stop of this process, nor is the time that an answer may take.
    const std::uint64_t usual_ns = is_polled ? std::uint64_t(kJitter_ns) : frame.slice_ns;
    const std::uint64_t stopped_ns = waited_ns - std::min(waited_ns, usual_ns),
                        stale_ns = std::uint64_t(std::int64_t(stale_ns_));
    const std::uint64_t lag_ns = is_polled ? stopped_ns : waited_ns;
    const bool is_within = lag_ns <= stale_ns, is_bounded = is_within || stopped_ns > stale_ns;
    const std::uint64_t doubt_ns = is_bounded ? lag_ns - std::min(lag_ns, stale_ns / 2) : 0;
    const std::uint64_t back_ns = std::max(stopped_ns, doubt_ns);
    const std::uint64_t measured_ns = frame.taken_ns - std::min(frame.taken_ns, back_ns);
    frame.late_ns = stopped_ns;
    frame.bound_ns = double(std::int64_t(std::max(waited_ns, frame.taken_ns - frame.t_ns)));
    frame.t_ns = std::max(std::min(frame.t_ns, measured_ns), std::min(t_ns_, frame.t_ns));
    frame.age = is_bounded ? Frame::Age::proved : Frame::Age::unproved;
    trouble_ns_ = is_within ? 0 : trouble_ns_ == 0 ? host_ns : trouble_ns_;
}

inline void StreamAge::judge(Frame& frame, std::uint64_t host_ns, std::uint64_t asked_ns) noexcept {
    if (frame.taken_ns < frame.t_ns) frame.taken_ns = frame.t_ns;
    // The process was stopped, and the bytes arrived at any time since then.
    const bool has_begin = frame.since_ns != 0 && frame.since_ns < frame.taken_ns;
    const std::uint64_t waited_ns = has_begin ? frame.taken_ns - frame.since_ns : 0;
    if (is_limited(frame))
        judge_limited(frame, host_ns, waited_ns);
    else
        estimate(frame, host_ns, asked_ns, double(waited_ns));
}

inline void StreamAge::estimate(Frame& frame, std::uint64_t host_ns, std::uint64_t asked_ns, double waited_ns) noexcept {
    double stopped_ns = std::max(waited_ns - double(frame.slice_ns), 0.0);
    // Keeps the order: frames of one read have the same time, and each conversion to the host's clock has an error.
    if (has_frame_) host_ns = std::max(host_ns, host_ns_);
    const bool repeats = frame.has_sequence ? frame.sequence == sequence_
                                            : has_clock(frame) && std::uint32_t(frame.device_time_us) == device_us_;
    if (has_frame_ && is_opened_ && repeats) {  // the last frame again, which servers send to each new client
        frame.age = Frame::Age::unproved;
        frame.bound_ns = kUnbounded_ns;
        return;
    }
    const bool begins = !has_frame_ || is_clock_ != has_clock(frame);
    is_clock_ = has_clock(frame);
    proof_ = is_clock_ ? Proof::clock : is_direct() ? Proof::direct : frame.has_sequence ? Proof::sequence : Proof::arrival;
    const bool is_fresh = stopped_ns < kJitter_ns;
    // The path is not late by the time for which this process was stopped. A clock shows the age in any case.
    if (is_clock_) waited_ns = stopped_ns = 0;
    const double silence_ns = has_frame_ ? double(host_ns - host_ns_) : 0;
    if (begins)
        begin(frame, silence_ns);
    else
        advance(frame, host_ns, silence_ns - std::min(stopped_ns, silence_ns));
    if (asked_ns != 0) {  // by the clock, the answer is the proof, else this frame, which came after it
        const double after_ns = is_clock_ ? double(std::int32_t(device_us_ - frame.answered_us)) * 1e3 : 0;
        prove(double(std::int64_t(host_ns - asked_ns)) - after_ns);
    }
    if (is_direct() && is_fresh) {
        // A cable that the user declares holds no frames for so long: the clock was set back.
        const bool lasts = trouble_ns_ != 0 && double(host_ns - std::min(trouble_ns_, host_ns)) > kLearn_ns;
        if (!route_.is_assumed && lasts) begin_again(0);
        if (x_ - up_ < kJitter_ns && !is_held()) prove(x_ - up_);
    }
    is_opened_ = false;
    has_frame_ = true;
    sequence_ = frame.sequence;
    host_ns_ = host_ns;
    publish(frame, host_ns, waited_ns, stopped_ns);
    t_ns_ = frame.t_ns;
}

// Takes the first frame, or the first one with the device's time.
inline void StreamAge::begin(const Frame& frame, double silence_ns) noexcept {
    device_us_ = std::uint32_t(frame.device_time_us);
    slope_ = 0;
    // Until a number's interval was measured between two proofs, it may be that of a queue that grows.
    const bool is_unknown = is_direct() || (proof_ == Proof::sequence && route_.reopening_discards);
    drift_ = proof_ == Proof::arrival ? 0 : is_unknown ? kMaxRate : route_.clock_ppm * 1e-6;
    begin_again(has_frame_ ? silence_ns + x_ - up_ + error_ns() : 0);
    if (has_frame_) return;
    // The first frames may have waited, which an opening or an answer can show.
    if ((route_.reopening_discards || route_.has_echo) && proof_ != Proof::arrival)
        doubt_ns_ = 2 * stale_ns_;
    else
        low_ = x_ - std::min(kFirst_ns, stale_ns_ / 4);
}

inline void StreamAge::advance(const Frame& frame, std::uint64_t host_ns, double step_ns) noexcept {
    const double bound_ns = x_ - up_ + error_ns();
    const double advance_ns = is_clock_ ? step_by_clock(frame, step_ns) : step_by_number(frame, step_ns);
    const double most_ns = step_ns + bound_ns + kJitter_ns;
    time_ns_ += step_ns;
    x_ += step_ns - advance_ns;
    const double begun_ns = double(device_us_) * 1e3;
    const bool has_begun = is_clock_ ? std::abs(step_ns - advance_ns) > kBegun_ns && begun_ns < step_ns + kBegun_ns
                                     : is_opened_ && advance_ns > most_ns;
    const bool is_asked = is_opened_ && opened_ns_ != 0;
    // Its number goes on, so a clock that went back was set back.
    const bool is_next = frame.has_sequence && !is_opened_ && frame.sequence == sequence_ + 1 + frame.lost;
    const bool is_explained = is_next && advance_ns < -kJitter_ns;
    if (has_begun) {  // the device has restarted
        begin_again(bound_ns + step_ns);
        last_ = {};
        span_interval_ns_ = 0;
    } else if (is_clock_ && advance_ns < 0 && is_direct())
        begin_again(bound_ns + step_ns);  // its clock was set back; a network may send old frames again
    else
        follow(step_ns, advance_ns, is_explained);
    if (is_asked && !has_begun) test_opening(frame, advance_ns, most_ns, double(host_ns));
}

inline void StreamAge::publish(Frame& frame, std::uint64_t host_ns, double waited_ns, double stopped_ns) noexcept {
    const double late_ns = (is_clock_ ? x_ - up_ : 0) + stopped_ns, bound_ns = x_ - up_ + error_ns() + waited_ns;
    const bool is_bounded = bound_ns <= stale_ns_ || late_ns > stale_ns_;  // a frame that is known to be late is BAD
    const auto back_ns = std::uint64_t(std::max(late_ns, is_bounded ? bound_ns - stale_ns_ / 2 : 0));
    const std::uint64_t measured_ns = frame.taken_ns > back_ns ? frame.taken_ns - back_ns : 0;
    frame.late_ns = std::uint64_t(late_ns);
    // Without a clock, a doubt has no size.
    frame.bound_ns = proof_ == Proof::arrival || (!is_clock_ && !is_bounded) ? kUnbounded_ns : bound_ns;
    frame.t_ns = std::max(std::min(frame.t_ns, measured_ns), std::min(t_ns_, frame.t_ns));
    frame.age = !is_bounded                ? Frame::Age::unproved
                : proof_ == Proof::arrival ? Frame::Age::arrival_only
                                           : Frame::Age::proved;
    trouble_ns_ = bound_ns <= stale_ns_ ? 0 : trouble_ns_ == 0 ? host_ns : trouble_ns_;
}

}  // namespace tactiled
