// The zero of one sensor, which is subtracted from the raw wrench, and the tare that measures it.
//
// With method "auto" each method has its own zero, because two methods compute different forces from the same channels
// without a load. A tare measures the zero of the method that runs, and keeps the mean of the channels. The zeros of the
// other methods are computed from that mean, one method in each later sample.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "config/names.hpp"
#include "decoupling/auto_method.hpp"
#include "decoupling/decoupler.hpp"
#include "node/tare_window.hpp"
#include "node/tuning.hpp"
#include "node/zero_error.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// Return the six components of a force and a torque of a sample, and write them there. rt: wait-free
inline Wrench wrench_of(const double (&force)[3], const double (&torque)[3]) noexcept {
    return {force[0], force[1], force[2], torque[0], torque[1], torque[2]};
}
inline void put_wrench(const Wrench& wrench, double (&force)[3], double (&torque)[3]) noexcept {
    std::copy_n(wrench.begin(), 3, force);
    std::copy_n(wrench.begin() + 3, 3, torque);
}

// The state of a sensor's tare. From `done` on the tare has ended: `done` with success, the others with an unchanged zero,
// because a sample had no value (failed), the force moved (moved), or the new zero differed from the calibration's by more
// than the limit (loaded).
enum class Tare { none, running, removing, done, failed, moved, loaded };

// The result of the tares of a sensor, as it is stored for a restart (zero_store.hpp).
struct TaredZero {
    std::uint32_t tare_count = 0;  // 0 = no tare is in force
    std::uint32_t unknown = 0;     // bit i: the zero of method i is unknown
    std::array<Wrench, MethodChoice::kMax> of_method{};
};

class Zero {
public:
    // `tuning` must outlive this object. Other limits leave the zeros unchanged. `needs_tare`: the zero of the calibration
    // is not that of another session.
    explicit Zero(const Tuning& tuning, bool needs_tare = false, const ZeroError::Rates& rates = {})
        : tuning_(&tuning), needs_tare_(needs_tare), knows_shift_(rates.has_shift()), error_(rates) {}

    // Returns true if the value can be a zero. A mounted sensor may rest outside the calibrated domain, but a
    // saturated or incomplete reading has no known zero. rt: wait-free
    [[nodiscard]] static bool can_be_zero(const tactiled_sample& sample) noexcept;

    // rt: wait-free
    void begin_tare(std::uint64_t now_ns) noexcept;
    // Returns to the calibration's zero with the next sample, or immediately if no sample arrives. rt: wait-free
    void begin_removal(bool is_delivering) noexcept;
    [[nodiscard]] Tare tare() const noexcept { return tare_; }
    // Returns the state; a tare that has ended is reported once. rt: wait-free
    [[nodiscard]] Tare poll(bool is_delivering, std::uint64_t now_ns) noexcept;

    // Adds the sample that method `method` of `n_methods` computed from `channel` to the running tare. Returns true if this
    // sample completed the tare; it is the first sample with the new zero. rt: wait-free
    [[nodiscard]] bool advance(const tactiled_sample& sample, std::span<const double> channel, std::size_t method,
                               std::size_t n_methods) noexcept;
    // Returns the number of samples in the mean of the last tare that began. rt: wait-free
    [[nodiscard]] unsigned tare_samples() const noexcept { return window_.samples(); }
    // Records that a sample with the tare removed exists. rt: wait-free
    void end_removal() noexcept { tare_ = Tare::done; }
    // Computes the zero of one method that does not run, if a zero is still missing. rt: bounded by that method's decouple()
    void find_other(AutoMethod& automatic, std::size_t method, std::size_t n_channels) noexcept;

    // Returns the zero of a method; `method` is 0 without "auto".
    [[nodiscard]] Wrench of(std::size_t method) const noexcept {
        Wrench zero = of_method_[method];
        for (std::size_t i = 0; i < zero.size(); ++i) zero[i] += error_.moved_S()[i];
        return zero;
    }
    // Returns false if the zero is missing, or unknown for this method.
    [[nodiscard]] bool is_known(std::size_t method) const noexcept {
        return (unknown_ >> method & 1u) == 0 && !is_missing();
    }
    // The daemon begins, `t_ns` by the clock of the functions below: a restored tare is as old as it was. The zero of the
    // calibration is as old as the first sample. rt: wait-free
    void start(std::int64_t t_ns) noexcept {
        begun_ns_ = restored_age_ns_ != 0 ? t_ns : kNever;
        error_.know(t_ns - restored_age_ns_);
    }
    // Continues with the age of the calibration's zero in `before`, and what restarts may have moved. rt: wait-free
    void succeed(const Zero& before) noexcept {
        error_.know(begun_ns_ = before.begun_ns_);
        error_.succeed(before.error_);
    }
    // rt: wait-free
    void follow(std::int64_t t_ns) noexcept {
        if (begun_ns_ == kNever) error_.know(begun_ns_ = t_ns);
        error_.follow(now_ns_ = t_ns, knows_shift_ && has_shifted());
    }
    // Adds the standard deviation of the zero to that of a force. Returns true if the zero is old. rt: wait-free
    [[nodiscard]] bool widen(Wrench& sd) const noexcept { return error_.widen(sd); }
    // Takes the mean force of a free rest, after the zero, and the standard deviation of a force there. rt: wait-free
    void rest(const Wrench& force_S, const Wrench& sd) noexcept {
        if (!is_missing() && !has_shifted()) error_.rest(force_S, sd, now_ns_);
    }
    // The device may have been exchanged or started again. `agrees`: its force is the one before; a start may have moved it
    // by this. rt: wait-free
    void judge(bool agrees, const Wrench& tolerance) noexcept {
        if (agrees)
            error_.step(tolerance);
        else
            doubt();
    }
    // Restarts before this run may have moved the zero by this. setup
    void step(const Wrench& tolerance) noexcept { error_.step(tolerance); }
    [[nodiscard]] const Wrench& stepped() const noexcept { return error_.stepped(); }
    // Another method computes the force. rt: wait-free
    void forget_rests() noexcept { error_.forget_rests(); }
    [[nodiscard]] bool has_more_to_find() const noexcept { return to_find_ != 0; }
    // Returns the number of finished tares since the last removal.
    [[nodiscard]] std::uint32_t tare_count() const noexcept { return tare_count_; }

    // True if a tare was in force whose zero is lost. No method then has a known zero until the next tare or removal.
    [[nodiscard]] bool is_lost() const noexcept { return is_lost_; }
    // True if the mounting may have another zero than the calibration. rt: wait-free
    [[nodiscard]] bool has_shifted() const noexcept { return needs_tare_ && tare_count_ == 0; }
    // True if no method has a known zero until the next tare. rt: wait-free
    [[nodiscard]] bool is_missing() const noexcept { return is_lost_ || is_doubted() || (has_shifted() && !knows_shift_); }
    // The device may have another zero until the next tare or removal. rt: wait-free
    void doubt() noexcept { is_doubted_ = true; }
    [[nodiscard]] bool is_doubted() const noexcept { return is_doubted_ && tuning_->doubts_zero; }
    // rt: wait-free
    void lose() noexcept;
    // Returns the zeros of the tare in force, to be stored for a restart; tare_count 0: no tare is in force. rt:
    // wait-free
    [[nodiscard]] TaredZero tared() const noexcept { return {tare_count_, unknown_, of_method_}; }
    // Continues with a tare of an earlier run, `age_ns` ago. Before the first sample. setup
    void restore(const TaredZero& zero, std::int64_t age_ns) noexcept;

private:
    [[nodiscard]] Tare verdict(const tactiled_sample& last) const noexcept;
    const Tuning* tuning_;
    bool needs_tare_, knows_shift_;
    ZeroError error_;
    std::array<Wrench, MethodChoice::kMax> of_method_{};
    static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
    std::int64_t begun_ns_ = kNever, now_ns_ = 0, restored_age_ns_ = 0;
    std::uint32_t unknown_ = 0;  // bit i: the zero of method i is unknown
    std::uint32_t to_find_ = 0;  // bit i: method i needs its zero from the mean of the last tare
    std::uint32_t tare_count_ = 0;
    bool is_lost_ = false, is_doubted_ = false;

    Tare tare_ = Tare::none;
    TareWindow window_;
    std::array<double, kMaxChannels> channel_sum_{};  // over the window
    std::uint64_t end_ns_ = 0;                        // time of the last sample of the window
    bool is_unsure_ = false;                          // the method did not know the uncertainty of a sample of the window
};

}  // namespace tactiled
