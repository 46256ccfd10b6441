// The standard deviation of the zero in use. It grows from the time when the zero was last known, as the dispersion of a
// clock does, and free rests bound it. For each component, in N or Nm:
//
//   variance = hidden + (moved / 3)^2 + (stepped / 3)^2 + (doubted / 3)^2 + (rate t)^2 + shift^2
//
//   t        time since the last tare, removal of a tare or free rest
//   rate     what calibrate has seen (zero_rate_per_h), else the held-out error of the force in each hour
//   hidden   0 after a tare; K sd^2 after a free rest
//   moved    K Y, by which free rests have moved the zero since the tare; all of it may be a load that grows slowly
//   stepped  the sum of what the device may have moved at each restart since then, without a difference that was seen
//   doubted  the force of the last free rest if it is more than the sensor's own standard deviation: a light load, or a
//            drift that goes on as fast as since the zero was known, or in a minute
//   shift    zero_shift of the calibration, until the first tare of one whose sessions had zeros of their own
//
// The mean Y of a free rest, relative to the tare, is a drift with the variance P = (rate time since the tare)^2 + (stepped
// since the tare / 3)^2 plus a light load of the sensor's own standard deviation sd, so that K = P / (P + sd^2) of it is
// drift. Rests do not add up, because their load may be the same.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <utility>

#include "decoupling/decoupler.hpp"

namespace tactiled {

class ZeroError {
public:
    // The calibration's, in N/s or Nm/s, N or Nm. shift: NaN = unknown. limit: the largest standard deviation of a
    // zero that is not old.
    struct Rates {
        static constexpr double kNever = std::numeric_limits<double>::infinity();
        Wrench per_s{}, shift = kUnseen, limit{kNever, kNever, kNever, kNever, kNever, kNever};

        [[nodiscard]] bool has_shift() const noexcept {
            return std::none_of(shift.begin(), shift.end(), [](double x) { return std::isnan(x); });
        }
    };
    explicit ZeroError(const Rates& rates) noexcept : rates_(rates) {}

    // The zero was known at `known_ns`: that of the calibration when the sensor began, that of a tare when it was measured.
    // rt: wait-free
    void know(std::int64_t known_ns) noexcept {
        known_ns_ = known_ns;
        forget_rests();
    }
    // A tare has measured the zero, or was removed. The zero of the calibration may have moved at restarts before the tare,
    // too.
    // rt: wait-free
    void tare(std::int64_t known_ns) noexcept {
        for (std::size_t i = 0; i < stepped_.size(); ++i) before_tare_[i] += stepped_[i];
        stepped_ = {};
        know(known_ns);
    }
    void untare(std::int64_t known_ns) noexcept {
        step(std::exchange(before_tare_, {}));
        know(known_ns);
    }
    // The device may have started again, and its force has differed by no more than this; NaN: not measured. rt: wait-free
    void step(const Wrench& tolerance) noexcept {
        for (std::size_t i = 0; i < stepped_.size(); ++i)
            if (tolerance[i] > 0) stepped_[i] += tolerance[i];
        next_ns_ = std::numeric_limits<std::int64_t>::min();
    }
    [[nodiscard]] const Wrench& stepped() const noexcept { return stepped_; }
    // Continues with what restarts may have moved the zero of the calibration. rt: wait-free
    void succeed(const ZeroError& before) noexcept {
        step(before.stepped_);
        step(before.before_tare_);
    }

    // Another method computes the force: its zero has not moved as far. rt: wait-free
    void forget_rests() noexcept {
        since_ns_.fill(known_ns_);
        rested_ = {};
        hidden_ = moved_ = doubted_ = {};
        next_ns_ = std::numeric_limits<std::int64_t>::min();
    }
    // Follows the time; `is_shifted`: the mounting may have another zero, of which the calibration states how far. rt:
    // wait-free
    void follow(std::int64_t t_ns, bool is_shifted) noexcept {
        if (is_shifted == is_shifted_ && t_ns < next_ns_) return;
        is_shifted_ = is_shifted;
        next_ns_ = t_ns + kRest_ns;  // rates are slow
        const double doubted = (1 + double(t_ns - doubted_ns_) / double(doubt_after_ns_)) / kSure;
        for (std::size_t i = 0; i < variance_.size(); ++i)
            variance_[i] = hidden_[i] + square(moved_[i] / kSure) + square((stepped_[i] - rested_[i]) / kSure) +
                           square(doubted * doubted_[i]) + square(drift(i, t_ns - since_ns_[i])) +
                           (is_shifted ? square(rates_.shift[i]) : 0);
    }
    // Takes the mean force of a free rest, after the zero in use, and the standard deviation of a force there; NaN: not
    // measured. A component beyond both this and what the rest before hid may be a load, so that the rest only raises a
    // doubt; beyond the limit it is one. No component moves by more than 3 sd of its drift. rt: wait-free
    void rest(const Wrench& force_S, const Wrench& sd, std::int64_t t_ns) noexcept {
        bool is_load = false;
        for (std::size_t i = 0; i < sd.size(); ++i) {
            if (is_shifted_ || std::isnan(sd[i]) != std::isnan(force_S[i]) || std::abs(force_S[i]) > rates_.limit[i]) return;
            is_load |= square(force_S[i]) > square(sd[i]) + hidden_[i];
        }
        for (std::size_t i = 0; i < sd.size(); ++i) doubted_[i] = is_load && !std::isnan(sd[i]) ? std::abs(force_S[i]) : 0;
        doubted_ns_ = next_ns_ = t_ns;
        doubt_after_ns_ = std::max(t_ns - known_ns_, kMinute_ns);
        if (is_load) return;
        for (std::size_t i = 0; i < sd.size(); ++i) {
            const double drifted = std::hypot(drift(i, t_ns - known_ns_), stepped_[i] / kSure), load = square(sd[i]);
            const double part = square(drifted) / (square(drifted) + load), moved = part * (moved_[i] + force_S[i]);
            if (!(std::abs(moved) <= kSure * drifted)) continue;
            hidden_[i] = part * load;
            moved_[i] = moved;
            rested_[i] = stepped_[i];
            since_ns_[i] = t_ns;
        }
    }

    [[nodiscard]] const Wrench& moved_S() const noexcept { return moved_; }
    // Returns the farthest drift in this time that is still taken for one, in N or Nm.
    [[nodiscard]] double reach(std::size_t component, std::int64_t age_ns) const noexcept {
        return std::min(kSure * drift(component, age_ns), rates_.limit[component]);
    }
    // Adds the zero's to the standard deviation of a force. Returns true if the zero is old. rt: wait-free
    [[nodiscard]] bool widen(Wrench& sd) const noexcept {
        bool is_old = false;
        for (std::size_t i = 0; i < sd.size(); ++i) {
            if (variance_[i] == 0) continue;
            sd[i] = std::sqrt(square(sd[i]) + variance_[i]);
            is_old |= variance_[i] > square(rates_.limit[i]);
        }
        return is_old;
    }

    static constexpr std::int64_t kRest_ns = 1'000'000'000;  // length of a rest

private:
    static constexpr std::int64_t kMinute_ns = 60'000'000'000;  // a drift is no faster than what it does in this time
    static constexpr double kSure = 3;                          // standard deviations
    [[nodiscard]] static constexpr double square(double x) noexcept { return x * x; }
    // Returns the standard deviation of a drift for this time.
    [[nodiscard]] double drift(std::size_t i, std::int64_t ns) const noexcept { return rates_.per_s[i] * double(ns) * 1e-9; }

    Rates rates_;
    std::int64_t known_ns_ = 0, next_ns_ = std::numeric_limits<std::int64_t>::min();
    std::int64_t doubted_ns_ = 0, doubt_after_ns_ = kMinute_ns;  // time of the last rest; for as much again
    bool is_shifted_ = false;
    std::array<std::int64_t, std::tuple_size_v<Wrench>> since_ns_{};
    Wrench hidden_{}, moved_{}, doubted_{}, variance_{};
    Wrench stepped_{}, rested_{}, before_tare_{};  // since the tare; at the last rest; before the tare
};

}  // namespace tactiled
