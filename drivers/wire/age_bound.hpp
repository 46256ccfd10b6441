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
// whose smallest x lies higher shows a lag: the line is then continued and not learned from. A frame below the reference
// lowers it at once. A reference that is lowered for longer than the uncertainty of the slope explains belongs to a clock
// that has become faster, or to a lag that shrinks evenly: see is_too_fast().
class AgeBound {
public:
    struct Limits {
        double max_drift = 200e-6;   // drift of the two clocks against each other: two crystals of 100 ppm
        double wander = 40e-6;       // change of the drift within minutes, by temperature
        double wrap_ns = 0;          // the device's clock starts again from 0 after this time; 0 = never
        double held_share = 0.125;   // share of the uncertainty by which the reference rises during a lag
        double excess = 0.05;        // largest part by which a clock runs too fast; x that falls faster is the end of a lag
        bool begins_at_zero = true;  // when the device restarts
    };

    // The device has measured a frame after the one before it, or it is an old one that has come before.
    enum class Origin : std::uint8_t { unknown, is_new, is_old };
    // After a restart the first time of the device's clock is at most this plus the silence before it.
    static constexpr double kBegun_ns = 0.5e9;
    static constexpr double kReplay_ns = 60e9;  // old frames that come again are taken to be at most this old

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
            // Ends that had passed unseen, while the link was closed, made the frames late by as much.
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
            // and later, if it came later after the one before than the device's frames follow each other
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
        back_for_ns_ += std::max(std::min(ahead, step), 0.0);  // a silence shows nothing
        ahead_ns_ = ahead;
        x_ += step - ahead;
        min_since_back_ = std::min(min_since_back_, x_ - slope_ * t_);
        if (back_ns_ > 0 && x_ - before_back_ < (first_since_back_ + slope_ * t_ - before_back_) / 2)
            back_ns_ = 0;  // a frame that was overtaken comes alone
        advance(step);
        if (back_ns_ > 0 && back_for_ns_ > set_back_after_ns_) accept_set_back();
        return x_ - reference_;
    }

    // A clock of 30 bits of microseconds, as the ticks of MicroPython, has begun again from 0. The times are those of a
    // decoder, which knows 32 bits. rt: wait-free
    [[nodiscard]] static bool is_early_wrap(std::uint64_t before_ns, std::uint64_t after_ns) noexcept {
        constexpr auto kEnd_ns = std::uint64_t(kEarlyWrap_ns);
        return after_ns < 20'000'000'000 && before_ns < kEnd_ns && before_ns > kEnd_ns - 5'000'000'000;
    }

    // The next frames are known to be on time: the reference is learned anew. The slope is kept. rt: wait-free
    void restart() noexcept {
        lowered_ns_ = 0;
        begin_again();
    }

    // The device's clock advances faster than its rate and its uncertainty allow, by more than 60 ms in sum: while that goes
    // on, a lag that begins is not seen. It is not forgotten. rt: wait-free
    [[nodiscard]] bool is_too_fast() const noexcept { return is_too_fast_; }

    // Host time less the device's time, since the first frame. rt: wait-free
    [[nodiscard]] double offset_ns() const noexcept { return x_; }

    // The device's clock has gone back, and it is not known yet whether it was set back. rt: wait-free
    [[nodiscard]] bool has_gone_back() const noexcept { return back_ns_ > 0; }
    // How often the device's clock was set back, and has stayed so.
    [[nodiscard]] unsigned set_back() const noexcept { return set_back_; }
    // When the clock last went back, nothing showed whether its frames were new, or old ones that came again.
    [[nodiscard]] bool may_be_old() const noexcept { return may_be_old_; }
    // The silence before the frame that showed it first, in which a lag may have begun that no clock shows.
    [[nodiscard]] double silence_before_set_back_ns() const noexcept { return back_silence_ns_; }
    // The last frame is the first one after a known period of the clock, which had been learned from an earlier end.
    [[nodiscard]] bool has_wrapped() const noexcept { return has_wrapped_; }
    // The last frame came much earlier than any before: a lag since the start has ended, or the clock was set.
    [[nodiscard]] bool has_fallen() const noexcept { return has_fallen_; }
    // By how much the last frame came earlier than any before, and more than by its slope.
    [[nodiscard]] double fell_ns() const noexcept { return fell_ns_; }
    // The reference has fallen by more than 50 ms within about as much of the host's time: frames that had been kept while
    // the host's clock stood still (a virtual machine), or since before the first one, come one after the other. Until that
    // is over, the frames are older than they seem. rt: wait-free
    [[nodiscard]] bool is_falling() const noexcept { return falling_ns_ - (t_ - fell_at_) > kFalling_ns; }
    // The last frame is known to be on time. rt: wait-free
    void end_fall() noexcept { falling_ns_ = 0; }
    // The device's clock has run ahead in jumps, so often that it cannot have been set: its unit is not what was stated. It
    // proves nothing. rt: wait-free
    [[nodiscard]] bool is_no_clock() const noexcept { return is_no_clock_; }
    // The smallest lateness of the last window shows a lag.
    [[nodiscard]] bool is_held() const noexcept { return is_held_; }
    // Uncertainty of the drift between the clocks, as a fraction.
    [[nodiscard]] double uncertainty() const noexcept { return uncertainty_; }

private:
    static constexpr std::size_t kWindows = 90;
    // one eighth of the span of the fit, within these limits
    static constexpr double kMinWindow_ns = 0.5e9, kMaxWindow_ns = 10e9;
    static constexpr unsigned kMinFrames = 8, kMinPoints = 6;  // minimum number for a window, and for a fit
    // Delays that vary within minutes change the slope by this over the span of the fit: USB polls of 16 ms, and half
    // as much again.
    static constexpr double kPerturbation_ns = 30e6;
    static constexpr double kFall_ns = 20e6;     // a larger fall of the smallest delay would bend the fit: it begins again
    static constexpr double kLag_ns = 10e6;      // the smallest delay of a window does not grow by so much without a lag
    static constexpr double kTooFast_ns = 60e6;  // a fall of kFall_ns, then delays that differ by less than 40 ms
    static constexpr double kJump_ns = 100e6;    // no rate explains such a fall within one frame
    static constexpr double kFalling_ns = 50e6, kMaxFalling_ns = 100e6;
    // A clock is not set eight times within minutes.
    static constexpr double kMaxJumps = 8, kJumpsForgotten = 1 / 60e9, kOneJump_ns = 0.5e9;
    // A clock that has gone back was set back, if it stays so for longer than it went back: else old frames come again, once
    // or in a ring.
    static constexpr double kSetBack_ns = 2e9, kLonger = 1.1;
    static constexpr double kEarlyWrap_ns = 1073741824e3;  // 2^30 us
    static constexpr double kWrapError_ns = 50e6;          // by which two delays differ that are no lag

    struct Point {
        double t_ns, x_ns;
    };

    // A clock that begins again from 0 after a period that it has shown before, during a silence of `step`: the frame
    // was measured within the silence, and may be late by the rest of it.
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

    // A lag that there was before the clock was set back is there still: the first frame after it was measured later than
    // the one before it, and so came at most that much late.
    [[nodiscard]] double reference_if_set_back() const noexcept {
        const double lag = late_before_back_ > kWrapError_ns ? late_before_back_ : 0;
        return std::min(first_since_back_ - lag, min_since_back_) + slope_ * t_;
    }

    void accept_set_back() noexcept {
        const double reference = reference_if_set_back();
        // After a silence it has restarted: no period is known.
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
        if (has_wrapped_) lowered_ns_ = -kWrapError_ns;  // the period is known so well
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

    // `risen`: by which the reference was raised for a silence.
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
                if (t_ - last_jump_ > kOneJump_ns) {  // a backlog that came at once is one
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
    double back_ns_ = 0;   // x rose by this because the device's clock went back; 0: it did not
    double back_silence_ns_ = 0;
    bool may_be_old_ = false;
    double set_back_after_ns_ = kSetBack_ns;
    double back_for_ns_ = 0;                            // the device's clock has advanced by this since it went back
    double before_back_ = 0, late_before_back_ = 0;     // x and the lateness before
    double first_since_back_ = 0, min_since_back_ = 0;  // x since then, without the drift
    double lowered_ns_ = 0;  // sum by which the reference was lowered, as far as neither drift nor jumps explain it
    double excess_ns_ = 0;   // by which a clock that is too fast may have lowered it since
    bool is_too_fast_ = false, has_fallen_ = false, is_no_clock_ = false;
    double fell_ns_ = 0;
    double falling_ns_ = 0, fell_at_ = 0;  // sum of the falls, less the time since, at this t_
    double last_jump_ = -1e300;            // its time t_
    double jumps_ = 0;                     // falls that no rate explains; one is forgotten each minute
    double other_wrap_ns_ = 0;             // period of the device's clock, besides wrap_ns; 0: not known
    bool wraps_early_ = false, has_wrapped_ = false;
    unsigned set_back_ = 0;
    double window_begin_ = 0, window_ns_ = kMinWindow_ns, window_min_ = 1e300;
    Point window_point_{};
    unsigned window_frames_ = 0;
    std::array<Point, kWindows> point_{};
    std::size_t points_ = 0;
};

}  // namespace tactiled
