// Computes how much later than the fastest frame a frame arrived, from two clocks: the host's clock and a clock that
// advances with the frames (the device's clock or its counter). Pure: times are arguments. The page freshness.md
// explains the method.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace tactiled {

// x = host time - device time = offset of the clocks + delay of the path. The smallest x seen is the reference; the lateness
// of a frame is its x above the reference.
//
// The reference follows the drift of the clocks as a line. Its slope is fitted to the smallest x of each window. At the end
// of a window the reference may also rise to the window's smallest x, by at most the uncertainty of the slope. A window
// whose smallest x is higher than that shows a lag; the line is then continued without a new fit. A frame below the
// reference lowers it at once. If the reference is lowered by more than the uncertainty of the slope explains, the clock has
// become faster or a lag shrinks steadily: see is_too_fast().
class AgeBound {
public:
    struct Limits {
        double max_drift = 200e-6;   // drift of the two clocks against each other: two crystals of 100 ppm
        double wander = 40e-6;       // change of the drift within minutes, by temperature
        double wrap_ns = 0;          // the device's clock starts again from 0 after this time; 0 = never
        double held_share = 0.125;   // share of the uncertainty by which the reference rises during a lag
        double excess = 0.05;        // largest relative excess of a clock's rate; if x falls faster, a lag ends
        bool begins_at_zero = true;  // the device's clock is 0 after a restart
    };

    // Relation of a frame to the frame before it: measured later (is_new), or an old frame that is sent again (is_old).
    enum class Origin : std::uint8_t { unknown, is_new, is_old };
    // After a restart the first time of the device's clock is at most this plus the preceding silence.
    static constexpr double kBegun_ns = 0.5e9;
    static constexpr double kReplay_ns = 60e9;  // maximum age of old frames that are sent again

    AgeBound() : AgeBound(Limits()) {}
    explicit AgeBound(const Limits& limits) : limits_(limits), uncertainty_(limits.max_drift) {}

    // Returns the lateness in ns of a frame that was measured at `device_ns` and had arrived by `host_ns`. Host times
    // must not decrease. rt: bounded by the number of windows, 90, once in each window; else wait-free
    [[nodiscard]] double late_ns(std::uint64_t host_ns, std::uint64_t device_ns, Origin origin = Origin::unknown) noexcept {
        if (!started_) {
            started_ = true;
            host_ns_ = host_ns;
            device_ns_ = device_ns;
            restart();
            return 0;
        }
        has_fallen_ = false;
        fell_ns_ = 0;
        const auto step = double(std::int64_t(host_ns - host_ns_));
        auto ahead = double(std::int64_t(device_ns - device_ns_));
        if (wraps_early_ && double(device_ns) > kEarlyWrap_ns) wraps_early_ = false;
        const double wrap_ns = wraps_early_ ? kEarlyWrap_ns : limits_.wrap_ns;
        if (wrap_ns > 0 && std::abs(step - ahead) > wrap_ns / 2)  // the number of wraps that is closest to the host's time
            ahead += wrap_ns * std::nearbyint((step - ahead) / wrap_ns);
        has_wrapped_ = false;
        if (limits_.wrap_ns > 0 && !wraps_early_ && is_early_wrap(device_ns_, device_ns)) {
            ahead += kEarlyWrap_ns;
            wraps_early_ = true;
            // Wraps that were missed while the link was closed have increased x by multiples of the period.
            x_ -= kEarlyWrap_ns * std::nearbyint((x_ - reference_) / kEarlyWrap_ns);
        } else if (other_wrap_ns_ > 0 && ahead < 0 && double(device_ns) < step + kWrapError_ns + 2 * ahead_ns_ &&
                   (std::abs(step - ahead - other_wrap_ns_) < kWrapError_ns || is_other_wrap(step, device_ns))) {
            ahead += other_wrap_ns_;
            has_wrapped_ = true;
        }
        host_ns_ = host_ns;
        device_ns_ = device_ns;
        if (ahead < 0) {
            const double reference = back_ns_ > 0 ? reference_if_set_back() : reference_;
            if (back_ns_ <= 0) before_back_ = x_;
            // includes the time by which this frame came later than the device's frame interval
            late_before_back_ = x_ - reference + std::max(step - ahead_ns_, 0.0);
            back_ns_ = step - ahead;
            const bool has_begun = limits_.begins_at_zero && double(device_ns) < step + kBegun_ns;
            may_be_old_ = !has_begun && origin != Origin::is_new;
            set_back_after_ns_ = !may_be_old_               ? kSetBack_ns
                                 : origin == Origin::is_old ? 1e300
                                                            : std::clamp(kLonger * back_ns_, kSetBack_ns, kReplay_ns);
            back_silence_ns_ = step;
            back_for_ns_ = 0;
            min_since_back_ = first_since_back_ = x_ + back_ns_ - slope_ * t_;
        }
        back_for_ns_ += std::max(std::min(ahead, step), 0.0);  // counts only time that has passed on both clocks
        ahead_ns_ = ahead;
        x_ += step - ahead;
        min_since_back_ = std::min(min_since_back_, x_ - slope_ * t_);
        if (back_ns_ > 0 && x_ - before_back_ < (first_since_back_ + slope_ * t_ - before_back_) / 2)
            back_ns_ = 0;  // a single reordered frame, so the clock was not set back
        advance(step);
        if (back_ns_ > 0 && back_for_ns_ > set_back_after_ns_) accept_set_back();
        return x_ - reference_;
    }

    // Returns true if a clock of 30 bits of microseconds (the ticks of MicroPython) has wrapped. The times are from a
    // decoder, which assumes 32 bits. rt: wait-free
    [[nodiscard]] static bool is_early_wrap(std::uint64_t before_ns, std::uint64_t after_ns) noexcept {
        constexpr auto kEnd_ns = std::uint64_t(kEarlyWrap_ns);
        return after_ns < 20'000'000'000 && before_ns < kEnd_ns && before_ns > kEnd_ns - 5'000'000'000;
    }

    // Restarts the estimate of the reference when the next frames are known to be on time. The slope is kept. rt: wait-free
    void restart() noexcept {
        lowered_ns_ = 0;
        begin_again();
    }

    // True if the device's clock has advanced by more than 60 ms more than its rate and uncertainty allow. A lag that begins
    // in this state is not detected. The state is permanent. rt: wait-free
    [[nodiscard]] bool is_too_fast() const noexcept { return is_too_fast_; }

    // Host time minus device time, relative to the first frame. rt: wait-free
    [[nodiscard]] double offset_ns() const noexcept { return x_; }

    // True if the device's clock has gone back and it is not yet known whether it was set back. rt: wait-free
    [[nodiscard]] bool has_gone_back() const noexcept { return back_ns_ > 0; }
    // Number of times that the device's clock was set back permanently.
    [[nodiscard]] unsigned set_back() const noexcept { return set_back_; }
    // True if it was unknown, when the clock last went back, whether the frames were new or old frames sent again.
    [[nodiscard]] bool may_be_old() const noexcept { return may_be_old_; }
    // Silence before the first frame after the clock was set back. A lag that began in this silence is visible in no clock.
    [[nodiscard]] double silence_before_set_back_ns() const noexcept { return back_silence_ns_; }
    // True if the last frame is the first one after a wrap whose period was learned from an earlier wrap.
    [[nodiscard]] bool has_wrapped() const noexcept { return has_wrapped_; }
    // True if the last frame was much earlier than all frames before: a lag since the start has ended, or the clock was set.
    [[nodiscard]] bool has_fallen() const noexcept { return has_fallen_; }
    // Amount by which the last frame was earlier than all frames before, minus the part that the drift explains.
    [[nodiscard]] double fell_ns() const noexcept { return fell_ns_; }
    // True if the reference has fallen by more than 50 ms within about the same time of the host. Frames that were buffered
    // while the host's clock stood still (a virtual machine), or since before the first frame, then arrive in a burst, and
    // the frames are older than they seem until its end. rt: wait-free
    [[nodiscard]] bool is_falling() const noexcept { return falling_ns_ - (t_ - fell_at_) > kFalling_ns; }
    // Call it when the last frame is known to be on time. rt: wait-free
    void end_fall() noexcept { falling_ns_ = 0; }
    // True if the device's clock has jumped ahead so often that it cannot have been set. Its unit is then not the stated
    // one, and the clock proves nothing. rt: wait-free
    [[nodiscard]] bool is_no_clock() const noexcept { return is_no_clock_; }
    // True if the smallest lateness of the last window shows a lag.
    [[nodiscard]] bool is_held() const noexcept { return is_held_; }
    // Uncertainty of the drift between the clocks, as a fraction.
    [[nodiscard]] double uncertainty() const noexcept { return uncertainty_; }

private:
    static constexpr std::size_t kWindows = 90;
    // one eighth of the span of the fit, within these limits
    static constexpr double kMinWindow_ns = 0.5e9, kMaxWindow_ns = 10e9;
    static constexpr unsigned kMinFrames = 8, kMinPoints = 6;  // minimum number of frames in a window, and of points in a
                                                               // fit
    // Change of the fitted line over its span by delays that vary within minutes: USB polls of 16 ms, with a margin.
    static constexpr double kPerturbation_ns = 30e6;
    static constexpr double kFall_ns = 20e6;     // a larger fall would distort the fit, which is restarted
    static constexpr double kLag_ns = 10e6;      // maximum growth of the smallest delay of a window without a lag
    static constexpr double kTooFast_ns = 60e6;  // a fall of kFall_ns, then delays that differ by less than 40 ms
    static constexpr double kJump_ns = 100e6;    // a larger fall within one frame is explained by no rate
    static constexpr double kFalling_ns = 50e6, kMaxFalling_ns = 100e6;
    // Limit of jumps: a clock is not set eight times within minutes.
    static constexpr double kMaxJumps = 8, kJumpsForgotten = 1 / 60e9, kOneJump_ns = 0.5e9;
    // A clock that has gone back counts as set back if it stays so for longer than the step back. Otherwise old frames are
    // sent again, once or in a ring.
    static constexpr double kSetBack_ns = 2e9, kLonger = 1.1;
    static constexpr double kEarlyWrap_ns = 1073741824e3;  // 2^30 us
    static constexpr double kWrapError_ns = 50e6;          // difference of two delays that does not count as a lag

    struct Point {
        double t_ns, x_ns;
    };

    // Returns true if the clock wrapped after the learned period during a silence of `step`. The frame was measured within
    // the silence and may be late by the rest of the silence.
    [[nodiscard]] bool is_other_wrap(double step, std::uint64_t device_ns) const noexcept {
        const double left_ns = other_wrap_ns_ - double(device_ns_);
        return -kWrapError_ns < left_ns && left_ns < step + kWrapError_ns && double(device_ns) - kWrapError_ns < step;
    }

    void begin_again() noexcept {
        reference_ = x_;
        back_ns_ = 0;
        points_ = 0;
        is_held_ = false;
        open_window();
    }

    // A lag that existed before the clock was set back persists. The first frame after the step was measured after the frame
    // before it, so it was late by at most late_before_back_.
    [[nodiscard]] double reference_if_set_back() const noexcept {
        const double lag = late_before_back_ > kWrapError_ns ? late_before_back_ : 0;
        return std::min(first_since_back_ - lag, min_since_back_) + slope_ * t_;
    }

    void accept_set_back() noexcept {
        const double reference = reference_if_set_back();
        // After a silence the device has restarted, so the step back is not a period of its clock.
        const bool may_be_period = limits_.wrap_ns > 0 && back_silence_ns_ < kWrapError_ns + 2 * ahead_ns_;
        other_wrap_ns_ = may_be_period ? back_ns_ : 0;
        ++set_back_;
        restart();
        reference_ = std::min(x_, reference);
    }

    void advance(double step) noexcept {
        t_ += step;
        reference_ += slope_ * step;
        // A silence gives no information on the drift.
        const double risen = step > kMaxWindow_ns ? uncertainty_ * (is_held_ ? limits_.held_share : 1.0) * step : 0;
        reference_ += risen;
        excess_ns_ = std::min(excess_ns_ + limits_.excess * step, kFall_ns);
        explain(uncertainty_ * step);
        if (has_wrapped_) lowered_ns_ = -kWrapError_ns;  // accuracy to which the period is known
        if (x_ < reference_) lower(step, risen);
        if (const double above = x_ - reference_; above < window_min_) {
            window_min_ = above;
            window_point_ = {t_, x_};
        }
        ++window_frames_;
        if (t_ - window_begin_ >= window_ns_ && window_frames_ >= kMinFrames) close_window();
    }

    void explain(double fall_ns) noexcept {
        if (lowered_ns_ > 0) lowered_ns_ = std::max(lowered_ns_ - fall_ns, 0.0);
    }

    // `risen`: amount by which the reference was raised for a silence.
    void lower(double step, double risen) noexcept {
        const double fall = reference_ - x_, counted = std::min(fall, excess_ns_);
        fell_ns_ = std::max(fall - risen - uncertainty_ * step, 0.0);
        excess_ns_ -= counted;
        lowered_ns_ += counted;
        is_too_fast_ = is_too_fast_ || lowered_ns_ > kTooFast_ns;
        const double falling_ns = std::max(falling_ns_ - (t_ - fell_at_), 0.0) + fall - 2 * uncertainty_ * step;
        falling_ns_ = std::clamp(falling_ns, 0.0, kMaxFalling_ns);
        fell_at_ = t_;
        if (fell_ns_ > kFall_ns || is_falling()) {  // a lag since the start has ended, or the clock was set forward
            has_fallen_ = true;
            if (fell_ns_ > kJump_ns + limits_.excess * step) {
                lowered_ns_ = 0;
                if (t_ - last_jump_ > kOneJump_ns) {  // a backlog that arrives at once counts as one jump
                    jumps_ = std::max(jumps_ - (t_ - last_jump_) * kJumpsForgotten, 0.0) + 1;
                    last_jump_ = t_;
                    is_no_clock_ = is_no_clock_ || jumps_ > kMaxJumps;
                }
            }
            begin_again();
        }
        reference_ = x_;
    }

    void close_window() noexcept {
        const double allowed = uncertainty_ * std::min(t_ - window_begin_, 4 * kMaxWindow_ns);
        is_held_ = window_min_ > allowed + kLag_ns;
        if (is_held_) {
            reference_ += allowed * limits_.held_share;
        } else {
            reference_ += std::min(window_min_, allowed);
            explain(std::min(window_min_, allowed));
            if (points_ == kWindows) std::move(point_.begin() + 1, point_.end(), point_.begin());
            point_[std::min(points_++, kWindows - 1)] = window_point_;
            points_ = std::min(points_, kWindows);
            fit();
        }
        open_window();
    }

    void open_window() noexcept {
        window_begin_ = t_;
        window_min_ = 1e300;
        window_frames_ = 0;
        const double span = points_ < 2 ? 0 : point_[points_ - 1].t_ns - point_[0].t_ns;
        window_ns_ = std::clamp(span / 8, kMinWindow_ns, kMaxWindow_ns);
    }

    // Fits by least squares. A new fit replaces the slope if it is at least as certain; after restart() the old slope
    // stays until then.
    void fit() noexcept {
        if (points_ < kMinPoints) return;
        const double span = point_[points_ - 1].t_ns - point_[0].t_ns;
        const double uncertainty = std::clamp(kPerturbation_ns / span, limits_.wander, limits_.max_drift);
        if (!(uncertainty <= uncertainty_)) return;
        double t = 0, x = 0, tt = 0, tx = 0;
        for (std::size_t i = 0; i < points_; ++i) {
            t += point_[i].t_ns - point_[0].t_ns;
            x += point_[i].x_ns - point_[0].x_ns;
        }
        t /= double(points_);
        x /= double(points_);
        for (std::size_t i = 0; i < points_; ++i) {
            const double dt = point_[i].t_ns - point_[0].t_ns - t;
            tt += dt * dt;
            tx += dt * (point_[i].x_ns - point_[0].x_ns - x);
        }
        slope_ = std::clamp(tx / tt, -limits_.max_drift, limits_.max_drift);
        uncertainty_ = uncertainty;
    }

    Limits limits_;
    bool started_ = false, is_held_ = false;
    std::uint64_t host_ns_ = 0, device_ns_ = 0;
    double t_ = 0, x_ = 0, reference_ = 0;  // since the first frame
    double slope_ = 0, uncertainty_;
    double ahead_ns_ = 0;  // last step of the device's clock
    double back_ns_ = 0;   // increase of x when the device's clock went back; 0: no step back
    double back_silence_ns_ = 0;
    bool may_be_old_ = false;
    double set_back_after_ns_ = kSetBack_ns;
    double back_for_ns_ = 0;                            // time that has passed on both clocks since the step back
    double before_back_ = 0, late_before_back_ = 0;     // x and the lateness before the step back
    double first_since_back_ = 0, min_since_back_ = 0;  // x after the step back, without the drift
    double lowered_ns_ = 0;  // sum of the reductions of the reference that neither drift nor jumps explain
    double excess_ns_ = 0;   // further reduction that a clock with the excess rate may cause
    bool is_too_fast_ = false, has_fallen_ = false, is_no_clock_ = false;
    double fell_ns_ = 0;
    double falling_ns_ = 0, fell_at_ = 0;  // sum of the falls minus the time since; time t_ of the last fall
    double last_jump_ = -1e300;            // time t_ of the last jump
    double jumps_ = 0;                     // number of falls that no rate explains; decreases by one per minute
    double other_wrap_ns_ = 0;             // learned period of the device's clock, in addition to wrap_ns; 0: unknown
    bool wraps_early_ = false, has_wrapped_ = false;
    unsigned set_back_ = 0;
    double window_begin_ = 0, window_ns_ = kMinWindow_ns, window_min_ = 1e300;
    Point window_point_{};
    unsigned window_frames_ = 0;
    std::array<Point, kWindows> point_{};
    std::size_t points_ = 0;
};

}  // namespace tactiled
