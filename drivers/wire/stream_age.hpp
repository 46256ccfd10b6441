// Proves the age of the frames of one device, or reports that it is not proved. The caller passes the time. The page
// freshness.md explains the rules.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

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
    StreamAge(double rate_Hz, double rate_tolerance, std::uint64_t stale_ns) : stale_ns_(double(stale_ns)) {
        set_rate(rate_Hz, rate_tolerance);
    }

    // Replaces the declared rate. An unproved age or a lag persists until the link is opened again. rt: wait-free
    void set_rate(double rate_Hz, double rate_tolerance) noexcept {
        declared_ns_ = rate_Hz > 0 ? 1e9 / rate_Hz : 0;
        tolerance_ = rate_tolerance;
    }

    // Restarts the proof for a link with this path that was opened at `opened_ns` of the host's time, 0 = unknown.
    // rt: wait-free
    void open(const Route& route, std::uint64_t opened_ns = 0) noexcept;

    // Sets t_ns, late_ns and age of `frame`, which was read from the kernel at `frame.taken_ns`. `host_ns` is the same time
    // on a clock without corrections that also runs while the machine is suspended. Call it for every frame of the device,
    // in order. rt: as AgeBound::late_ns()
    void judge(Frame& frame, std::uint64_t host_ns) noexcept;

    [[nodiscard]] Proof proof() const noexcept { return proof_; }
    // Returns true if judge() uses the host's time for this frame. rt: wait-free
    [[nodiscard]] bool uses_host_time(const Frame& frame) const noexcept {
        return route_.path == Route::Path::network ||
               (route_.path == Route::Path::direct && route_.device_clock && frame.device_time_us != 0);
    }
    // True if the age is not proved or too large, and the path discards waiting frames when it is reopened. rt: wait-free
    [[nodiscard]] bool is_in_trouble() const noexcept { return trouble_ns_ != 0 && route_.reopening_discards; }
    // Host time since which the age is not proved or too large; 0: the age is proved. rt: wait-free
    [[nodiscard]] std::uint64_t trouble_ns() const noexcept { return trouble_ns_; }
    // Time for which the link should stay closed before it is reopened, so that the frames discarded meanwhile are a
    // detectable gap. rt: wait-free
    [[nodiscard]] std::uint64_t closed_ns() const noexcept {
        return std::uint64_t(std::clamp(kMissingFrames * interval_ns(), kMinClosed_ns, kMaxClosed_ns));
    }
    // True if a reopening may prove the age or end a persistent lag. rt: wait-free
    [[nodiscard]] bool asks_for_reopening(std::uint64_t host_ns) const noexcept {
        return is_in_trouble() && std::int64_t(host_ns - trouble_ns_) > kPatience_ns;
    }

private:
    static constexpr double kLate_ns = 50e6;  // jitter of 20 ms and USB polls of 16 ms, with a margin, are no lag
    static constexpr std::int64_t kPatience_ns = 500'000'000;  // time within which a backlog may arrive
    static constexpr double kMaxWait_ns = 5e9;
    static constexpr double kMinClosed_ns = 200e6, kMaxClosed_ns = 2e9, kMissingFrames = 4;
    // After a restart, a device's clock or counter exceeds the silence since the frame before by at most this.
    static constexpr double kBegun_us = AgeBound::kBegun_ns * 1e-3, kBegunFrames = 3;
    static constexpr double kMaxGap = 100;        // numbers; a larger gap may be another device's
    static constexpr double kFastest_ns = 100e3;  // shortest interval of frames on a cable

    // ---- clock: stream_age_clock.hpp ----
    static constexpr double kWrap_ns = 4294967296e3;  // formats send 32 bits of microseconds
    static constexpr double kFits_ns = 20e9;
    static constexpr double kResonator_ppm = 20'000;
    static constexpr double kLeap = 8, kCountedLeap = 2;  // intervals from one frame to the next

    // ---- sequence: stream_age_sequence.hpp ----
    static constexpr double kBooted_ns = 30e9;  // a number below this time is from a restarted device, or is an old number
    static constexpr double kCountedFrom_ns = 1e15;
    static constexpr double kCaughtUp_ns = 25e6;
    static constexpr double kMaxRateError = 0.04;  // of the rate measured at first: delays of 36 ms in 2 s, with a margin
    static constexpr double kLearn_ns = 2e9;
    static constexpr unsigned kLearnFrames = 10;
    static constexpr double kFaster = 0.5;  // largest relative increase of a device's rate
    // For a lag of this size, a faster device would be detected within the time that it took to catch up the lag.
    static constexpr double kSettled_ns = 160e6;
    static constexpr double kMinSettle_ns = 50e6;     // buffered frames arrive at shorter intervals
    static constexpr double kFallen_ns = 60e6;        // more than jitter
    static constexpr double kHiddenByRate_ns = 96e6;  // lag that a wrong rate may hide, see AgeBound::is_too_fast()
    static constexpr double kShortCounter_ns = 60e9, kShortest_ns = 2e9;

    // The step from the frame before, by the device's clock and counter.
    struct ClockStep {
        double silence_us = 0, booted_us = 0;  // host's time since the frame before; the clock's time if it began at 0
        bool ended = false, went_back = false;
        bool counter_began = false, clock_began = false, may_have_begun = false;  // the device seems to have restarted
        bool leapt = false;
        bool set_back = false, leapt_while_back = false;  // set by late_by_clock(); the latter: ahead, but still set back
    };

    void begin_clock(double silence_ns) noexcept;
    [[nodiscard]] ClockStep clock_step(const Frame& frame, std::uint64_t host_ns) const noexcept;
    [[nodiscard]] double late_by_clock(const Frame& frame, std::uint64_t host_ns, ClockStep& step) noexcept;
    [[nodiscard]] bool has_restarted(const ClockStep& step, double late) const noexcept;
    [[nodiscard]] bool may_hide_lag(const ClockStep& step, double late, bool restarted) noexcept;
    void by_clock(Frame& frame, std::uint64_t host_ns) noexcept;
    void by_sequence(Frame& frame, std::uint64_t host_ns) noexcept;
    void by_arrival(Frame& frame, std::uint64_t host_ns) noexcept;
    void by_cable(Frame& frame, std::uint64_t host_ns) noexcept;
    void backdate(Frame& frame, double late_ns) noexcept;
    [[nodiscard]] double range_ns(const Frame& frame) const noexcept {
        return std::ldexp(interval_ns(), frame.sequence_bits);
    }
    void learn_rate(std::uint64_t host_ns) noexcept;
    void begin_to_count() noexcept;
    [[nodiscard]] bool has_settled(double late, std::uint64_t host_ns) noexcept;
    [[nodiscard]] double frames_in(double silence_ns) const noexcept;
    [[nodiscard]] bool has_begun(const Frame& frame, double silence_ns) const noexcept;
    void follow_run(const Frame& frame, std::uint64_t host_ns) noexcept;
    [[nodiscard]] bool may_come_again(std::uint64_t host_ns) const noexcept {
        return behind_ >= 0 && host_ns < behind_until_ns_;
    }
    [[nodiscard]] double frames_since(const Frame& frame, double silence_ns) const noexcept;
    [[nodiscard]] double advance_of(const Frame& frame, double silence_ns) const noexcept;
    [[nodiscard]] double mean_ns() const noexcept;
    // Interval of the frames; 0: unknown.
    [[nodiscard]] double interval_ns() const noexcept { return period_ns_ > 0 ? period_ns_ : mean_ns(); }
    [[nodiscard]] double late_while_learning(const Frame& frame, double advance, double silence_ns,
                                             std::uint64_t host_ns) noexcept;
    [[nodiscard]] double late_by_counter(const Frame& frame, double advance, double silence_ns,
                                         std::uint64_t host_ns) noexcept;
    [[nodiscard]] bool may_be_kept(const Frame& frame, double advance, std::uint64_t host_ns) noexcept;
    [[nodiscard]] bool seems_restarted(const Frame& frame, double late_ns) const noexcept;
    [[nodiscard]] bool is_network() const noexcept { return route_.path == Route::Path::network; }
    // True if the path has discarded its frames when it was closed: the device's time or counter has advanced meanwhile. On
    // a path that keeps its frames, `late_ns` has grown by the time for which the link was closed.
    [[nodiscard]] bool has_discarded(double late_ns) const noexcept {
        return is_reopened_ && route_.reopening_discards && late_ns < late_ns_ + kLate_ns;
    }
    // True if the first frame after the opening came later than ever before, by more than the device and jitter explain. The
    // path may have held this frame, and its age is not shown by the frames that the opening discarded.
    [[nodiscard]] bool has_waited(std::uint64_t host_ns) const noexcept {
        const double interval = has_clock_ ? interval_us_ * 1e3 : interval_ns();
        return is_reopened_ && opened_ns_ != 0 && interval > 0 &&
               double(host_ns - opened_ns_) > wait_ns_ + std::max(3 * interval, kLate_ns);
    }
    // True until 50 ms after an opening that seemed to prove the age. If the frames arrive faster than the device sends
    // them, the path had kept them, and the age is not proved. rt: wait-free
    [[nodiscard]] bool is_on_trial(double advance, std::uint64_t host_ns) noexcept;
    void put_trouble(bool is_trouble, std::uint64_t host_ns) noexcept {
        trouble_ns_ = !is_trouble ? 0 : trouble_ns_ == 0 ? host_ns : trouble_ns_;
    }

    Route route_;
    double declared_ns_ = 0, tolerance_ = 0, stale_ns_;
    Proof proof_ = Proof::unknown;
    AgeBound bound_;
    bool has_clock_ = false, is_unproved_ = false, is_reopened_ = false, has_frame_ = false;
    std::uint64_t t_ns_ = 0, host_ns_ = 0;  // of the previous frame
    double late_ns_ = 0;                    // lateness of the previous frame by the path
    std::uint64_t trouble_ns_ = 0;
    std::uint64_t opened_ns_ = 0;   // host time of the opening; 0: unknown, or a frame has arrived since
    std::uint64_t trial_ns_ = 0;    // host time of the first frame of an opening on trial; 0: none
    double trial_frames_ = 0;       // frames since then
    double trial_interval_ns_ = 0;  // interval known before the trial
    double wait_ns_ = kMaxWait_ns;  // shortest time from an opening to its first frame

    bool is_resonator_ = false;         // bound_ allows for a clock like that of a ceramic resonator
    bool is_no_clock_ = false;          // the clock was faster still, so its unit is not the stated one
    std::uint64_t device_time_us_ = 0;  // latest time of the device
    double interval_us_ = 0;            // mean interval of the device's times
    double hidden_ns_ = 0;              // longest lag that starts of the device and leaps of its clock may hide

    // The counter as a clock.
    std::uint32_t sequence_ = 0;
    double run_ = 0;                     // length of the run of numbers up to sequence_ without a large gap
    double back_ = 0;                    // distance of this frame's number back into that run; 0: not in the run
    double behind_ = 0;                  // frames until the counter exceeds the numbers that were used
    std::uint64_t behind_until_ns_ = 0;  // host time at which that state ends at the latest
    double period_ns_ = 0;               // 0: unknown
    double max_period_ns_ = 0;           // > 0: the device has become faster than this since
    double counted_ = 0;                 // frames since the first one
    double learn_frames_ = 0;            // frames and host's time from which period_ns_ is learned
    double learned_ns_ = 0, mean_before_ns_ = 0;
    bool must_reopen_ = false;        // the counter cannot prove the age before the link is reopened
    bool began_at_opening_ = false;   // the counter had restarted when the link was last opened
    double max_late_ns_ = 0;          // the largest lateness in this lag
    std::uint64_t max_late_at_ = 0;   // time of the last lateness above 0.9 of it
    std::uint64_t settle_until_ = 0;  // 0: no lag has been caught up
    double settle_offset_ns_ = 0;     // offset of host and counter when it began to settle
    std::uint64_t known_ns_ = 0;      // host time since which the learned rate is valid
    std::uint64_t punctual_ns_ = 0;   // host time of the last proved frame
};

inline void StreamAge::open(const Route& route, std::uint64_t opened_ns) noexcept {
    const bool first = proof_ == Proof::unknown && !has_frame_;
    const bool other = route.path != route_.path || route.clock_ppm != route_.clock_ppm;
    route_ = route;
    if (first || other) {
        bound_ = AgeBound();
        has_clock_ = is_unproved_ = must_reopen_ = has_frame_ = began_at_opening_ = false;
        period_ns_ = hidden_ns_ = late_ns_ = interval_us_ = run_ = behind_ = 0;
        device_time_us_ = 0;
    }
    is_reopened_ = has_frame_;
    trouble_ns_ = 0;
    opened_ns_ = opened_ns;
}

inline bool StreamAge::is_on_trial(double advance, std::uint64_t host_ns) noexcept {
    if (is_reopened_) trial_ns_ = 0;
    if (trial_ns_ == 0) return false;
    const auto elapsed_ns = double(host_ns - trial_ns_);
    trial_frames_ += advance;
    if (trial_frames_ * trial_interval_ns_ - elapsed_ns > kLate_ns) {
        is_unproved_ = must_reopen_ = true;
        learn_frames_ = learned_ns_ = 0;  // these frames do not have the device's interval
        mean_before_ns_ = trial_interval_ns_;
    }
    if (is_unproved_ || elapsed_ns > kMinSettle_ns) trial_ns_ = 0;
    return trial_ns_ != 0;
}

inline void StreamAge::judge(Frame& frame, std::uint64_t host_ns) noexcept {
    if (frame.taken_ns < frame.t_ns) frame.taken_ns = frame.t_ns;
    // Keeps the order: frames of one read have the same time, and each conversion to the host's clock has an error.
    if (has_frame_) host_ns = std::max(host_ns, host_ns_);
    if (route_.path == Route::Path::polled) {
        proof_ = Proof::polled;
        // The thread was not scheduled, or the answer took longer, so the value may be older by that time.
        if (frame.since_ns != 0) backdate(frame, double(frame.taken_ns) - double(frame.since_ns) - kLate_ns);
        return;
    }
    // A server that sends its last frame to each new client repeats it: this is not the connection's first frame.
    if (is_reopened_ && is_network() && frame.has_sequence && frame.sequence == sequence_) {
        frame.age = Frame::Age::unproved;
        return;
    }
    if (has_clock_ && frame.device_time_us == 0) {  // this frame lacks the device's time
        frame.age = Frame::Age::unproved;
        return;
    }
    back_ = 0;
    if (frame.has_sequence) follow_run(frame, host_ns);
    if (route_.device_clock && frame.device_time_us != 0)
        by_clock(frame, host_ns);
    else if (route_.path == Route::Path::direct)
        by_cable(frame, host_ns);
    else if (frame.has_sequence)
        by_sequence(frame, host_ns);
    else
        by_arrival(frame, host_ns);
    if (opened_ns_ != 0) wait_ns_ = std::min(wait_ns_, double(host_ns - std::min(opened_ns_, host_ns)));
    opened_ns_ = 0;
    has_frame_ = true;
    is_reopened_ = false;
    if (frame.has_sequence) sequence_ = frame.sequence;
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

}  // namespace tactiled

// Each proof has its own file.
#include "drivers/wire/stream_age_arrival.hpp"
#include "drivers/wire/stream_age_clock.hpp"
#include "drivers/wire/stream_age_sequence.hpp"
