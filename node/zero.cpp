#include "node/zero.hpp"

#include <bit>
#include <cmath>

namespace tactiled {
namespace {

// Accepted reasons of a zero that a method computes from one reading in its initial state: its uncertainty must be known.
constexpr std::uint32_t kOtherMayHave = TACTILED_OUTSIDE_DOMAIN | TACTILED_TEMPERATURE | TACTILED_UNCALIBRATED;
// in addition to the averaging time; the tare of a slow or stopped sensor then fails
constexpr std::uint64_t kPatienceNs = 2'000'000'000;

// The zero of a component that the sensor does not measure is 0.
Wrench seen_or_0(const Wrench& wrench) noexcept {
    Wrench zero;
    for (std::size_t i = 0; i < zero.size(); ++i) zero[i] = std::isfinite(wrench[i]) ? wrench[i] : 0;
    return zero;
}

}  // namespace

bool Zero::can_be_zero(const tactiled_sample& s) noexcept {
    return s.quality != TACTILED_BAD && (s.reasons & ~std::uint32_t(TACTILED_REASONS_FOR_ZERO)) == 0;
}

void Zero::begin_tare(std::uint64_t now_ns) noexcept {
    tare_ = Tare::running;
    window_.begin(now_ns, tuning_->tare_ns());
    channel_sum_ = {};
    is_unsure_ = false;
    to_find_ = 0;
}

void Zero::begin_removal(bool is_delivering) noexcept {
    of_method_ = {};
    unknown_ = to_find_ = tare_count_ = 0;
    is_lost_ = is_doubted_ = false;
    error_.untare(begun_ns_);
    tare_ = is_delivering ? Tare::removing : Tare::done;
}

Tare Zero::poll(bool is_delivering, std::uint64_t now_ns) noexcept {
    if (tare_ == Tare::running && (!is_delivering || now_ns > window_.begin_ns() + tuning_->tare_ns() + kPatienceNs))
        tare_ = Tare::failed;
    if (tare_ == Tare::removing && !is_delivering) tare_ = Tare::done;
    const Tare reported = tare_;
    if (tare_ != Tare::running && tare_ != Tare::removing) tare_ = Tare::none;
    return reported;
}

bool Zero::advance(const tactiled_sample& s, std::span<const double> channel, std::size_t method,
                   std::size_t n_methods) noexcept {
    if (!can_be_zero(s)) {
        tare_ = Tare::failed;
        return false;
    }
    if (s.t_ns < window_.begin_ns()) return false;          // measured before the command
    if ((s.reasons & TACTILED_STEPPED) != 0) return false;  // not confirmed
    const bool complete = window_.add(wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm), s.t_ns);
    for (std::size_t k = 0; k < channel.size(); ++k) channel_sum_[k] += channel[k];
    is_unsure_ |= (s.reasons & TACTILED_UNKNOWN_UNCERTAINTY) != 0;
    if (!complete) return false;
    tare_ = verdict(s);
    if (tare_ != Tare::done) return false;
    of_method_ = {};
    of_method_[method] = seen_or_0(window_.mean_S());
    to_find_ = ((1u << n_methods) - 1) & ~(1u << method);
    unknown_ = to_find_ | (is_unsure_ ? 1u << method : 0u);
    end_ns_ = s.t_ns;
    is_lost_ = is_doubted_ = false;
    error_.tare(now_ns_);
    ++tare_count_;
    return true;
}

// Returns `done` if the mean of the window may be a zero, else the reason; `last` is the last sample of the window.
Tare Zero::verdict(const tactiled_sample& last) const noexcept {
    if (window_.has_moved(wrench_of(last.sd_force_N, last.sd_torque_Nm))) return Tare::moved;
    const Wrench mean = window_.mean_S();
    const std::int64_t age_ns = now_ns_ - begun_ns_;  // the limits are those of a drift from the calibration's zero, too
    double squares = 0, reach_N = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        if (!std::isfinite(mean[i])) continue;
        squares += mean[i] * mean[i];
        const double limit_N = tuning_->tare_limit_of_component_N[i], of_drift_N = error_.reach(i, age_ns);
        reach_N += of_drift_N;
        if (limit_N > 0 && std::abs(mean[i]) > limit_N + of_drift_N) return Tare::loaded;
    }
    const double max_N = tuning_->tare_limit_of_magnitude_N;
    return max_N > 0 && std::sqrt(squares) > max_N + reach_N ? Tare::loaded : Tare::done;
}

void Zero::lose() noexcept {
    of_method_ = {};
    to_find_ = tare_count_ = 0;
    unknown_ = ~0u;
    is_lost_ = true;
}

void Zero::restore(const TaredZero& zero, std::int64_t age_ns) noexcept {
    restored_age_ns_ = age_ns;
    tare_count_ = zero.tare_count;
    unknown_ = zero.unknown;
    of_method_ = zero.of_method;
    error_.forget_rests();
}

// A method that has begun to run since the tare keeps its state; its zero is computed when it no longer runs.
void Zero::find_other(AutoMethod& automatic, std::size_t method, std::size_t n_channels) noexcept {
    const std::uint32_t idle = to_find_ & ~(1u << method);
    if (idle == 0) return;
    const auto i = std::size_t(std::countr_zero(idle));
    to_find_ &= ~(1u << i);
    std::array<double, kMaxChannels> mean{};
    Reading reading;
    for (std::size_t k = 0; k < n_channels; ++k) {
        mean[k] = channel_sum_[k] / window_.samples();
        if (!std::isfinite(mean[k])) reading.missing |= 1u << k;
    }
    reading.channel = {mean.data(), n_channels};
    reading.t_ns = end_ns_;
    const Estimate e = automatic.decouple_anew(i, reading);
    if (!e.has_value || (e.reasons & ~kOtherMayHave) != 0) return;
    of_method_[i] = seen_or_0(e.wrench_S);
    unknown_ &= ~(1u << i);
}

}  // namespace tactiled
