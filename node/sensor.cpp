#include "node/sensor.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled {
namespace {

// Method "auto" is timed in one of this many samples, because reading the clock twice takes as long as a fast method.
constexpr std::uint64_t kTimedEvery = 8;

void put(const Estimate& e, tactiled_sample& s) noexcept {
    s.reasons = e.reasons;
    s.residual = e.residual;
    s.state |= (e.direction & 31u) << 8;
    put_wrench(e.wrench_S, s.raw_force_S_N, s.raw_torque_S_Nm);
    put_wrench(e.sd, s.sd_force_N, s.sd_torque_Nm);
}

}  // namespace

// ---- one frame -> one sample -------------------------------------------------------------------------------------------

tactiled_sample Sensor::sample(const Frame& frame, std::uint64_t now_ns, const Taxels& taxels) noexcept {
    notice_suspension(now_ns);
    if (stream_.is_late(frame)) return late_sample(frame, now_ns);
    if (stream_.arrive(frame)) {
        low_pass_.reset();
        latency_.forget();
        jumps_.end_motion();
        break_rest();
    }
    if (std::exchange(has_rested_, false)) end_rest();
    if (setup_.automatic != nullptr) take_over_method();

    tactiled_sample s = next_sample(frame.t_ns, now_ns);
    s.device_sequence = frame.has_sequence ? frame.sequence : 0;
    s.rate_Hz = stream_.rate_Hz();
    const Estimate& e = estimate_ = estimate(frame, taxels, s);
    put(e, s);
    of_model_ = {e.cop_S_m, e.cop_sd_m};
    s.epoch = epoch();  // set after the estimate, because a channel that froze begins a new epoch
    judge_age(frame.age, s);
    tactiled_put_verdict(&s, e.has_value);
    judge_jump(frame.lost, s);
    follow_tare(s);
    judge_zero(s);
    tactiled_put_verdict(&s, e.has_value);
    judge_latency(s);
    if (is_confirmed(s)) {
        // A doubtful value, for instance of a saturated channel, must not contribute to a GOOD value through the low pass.
        if (s.quality == TACTILED_BAD || (s.quality == TACTILED_GOOD && own_quality_ == TACTILED_UNCERTAIN))
            low_pass_.reset();
        own_quality_ = s.quality;
    }
    put_tared(s);
    judge_magnitude(s);
    follow_rest(s);
    keep(s);
    return s;
}

// Keeps the sample with what is appended to it.
inline void Sensor::keep(tactiled_sample& s) noexcept {
    if (s.quality == TACTILED_BAD) tactiled_invalidate(&s, 0);
    placed_.sample = s;
    if (s.quality == TACTILED_BAD) return tactiled_forget_appended(&placed_, 0);
    put_parts(estimate_, sd_, placed_.budget);
    put_correlations(*estimate_.correlations, estimate_.wrench_S, placed_.budget);
}

// A value whose age is not proved may be arbitrarily old.
inline void Sensor::judge_age(Frame::Age age, tactiled_sample& s) const noexcept {
    if (age == Frame::Age::proved) return;
    if (age == Frame::Age::arrival_only) {
        if (!tuning_->accept_unproved_age) s.reasons |= TACTILED_ARRIVAL_ONLY;
        return;
    }
    s.reasons |= TACTILED_UNPROVED_AGE;
}

// A device that starts may have another zero, unless its force is that before.
inline void Sensor::follow_device(const Frame& frame, bool has_all) noexcept {
    constexpr std::uint64_t kStart_ns = 1'000'000'000;  // a device needs this time to start
    const std::uint64_t t_ns = frame.t_ns + suspended_ns_, gap_ns = tuning_->stale_ns + kStart_ns;
    if (continuity_.goes_on(frame, has_all, t_ns, double(stream_.rate_Hz()), gap_ns)) return;
    if (!std::exchange(may_be_another_, true)) {
        jumps_.mark();
        may_have_started_ = false;
    }
    may_have_started_ |= !continuity_.has_proof();
}

// A value that has left the motion may be wrong until the next one confirms it.
inline void Sensor::judge_jump(std::uint32_t lost, tactiled_sample& s) noexcept {
    if (s.quality == TACTILED_BAD) return jumps_.miss();
    const Wrench raw_S = wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm), sd = wrench_of(s.sd_force_N, s.sd_torque_Nm);
    const bool agrees = !may_be_another_ || (!tuning_->forgets_zero && jumps_.agrees(raw_S, lost));
    if (!jumps_.confirm(raw_S, sd, s.t_ns, lost))
        s.reasons |= TACTILED_STEPPED;
    else if (std::exchange(may_be_another_, false))
        zero_.judge(agrees, may_have_started_ ? jumps_.marked().tolerance : Wrench{});
    if (jumps_.is_frequent()) s.reasons |= TACTILED_GLITCHES;
}

// A frame that is older than stale_ms gives a BAD sample, as if the frame had not arrived.
inline tactiled_sample Sensor::late_sample(const Frame& frame, std::uint64_t now_ns) noexcept {
    stream_.arrive_late(frame);
    if (!is_of_another_device(frame)) follow_device(frame, true);
    tactiled_sample s = marker(now_ns);
    s.t_ns = frame.t_ns;
    s.device_sequence = frame.has_sequence ? frame.sequence : 0;
    own_quality_ = s.quality;
    keep(s);
    return s;
}

inline tactiled_sample Sensor::next_sample(std::uint64_t t_ns, std::uint64_t now_ns) noexcept {
    tactiled_sample s{};
    s.sequence = sequence_++;
    s.t_ns = t_ns;
    s.t_published_ns = now_ns;
    s.lost = stream_.lost();
    s.temperature_C = std::numeric_limits<float>::quiet_NaN();
    return s;
}

// A frame without the number of its device counts as a frame of another device.
bool Sensor::is_of_another_device(const Frame& frame) const noexcept {
    if (frame.n_channels != setup_.frame_channels) return true;
    if (setup_.serial_of_frame < 0) return false;
    const auto i = std::size_t(setup_.serial_of_frame);
    return (frame.missing >> i & 1u) != 0 || frame.channel[i] != setup_.serial;
}

// A small array in the channels of a frame: all values of the first taxel, then those of the next one.
inline Taxels Sensor::taxels_of(const Frame& frame, const TaxelShape& shape, std::span<float> value) noexcept {
    for (std::size_t k = 0; k < shape.size(); ++k) {
        float& of_taxel = value[k % shape.values * shape.taxels + k / shape.values];
        of_taxel = (frame.missing >> k & 1u) != 0     ? std::numeric_limits<float>::quiet_NaN()
                   : (frame.saturated >> k & 1u) != 0 ? std::numeric_limits<float>::infinity()
                                                      : float(frame.channel[k]);
    }
    return {shape, value.first(shape.size())};
}

Estimate Sensor::estimate(const Frame& frame, const Taxels& taxels, tactiled_sample& s) noexcept {
    if (is_of_another_device(frame)) {
        if (setup_.decoupler != nullptr) setup_.decoupler->forget();
        Estimate wrong;
        wrong.reasons = TACTILED_WRONG_DEVICE;
        return wrong;
    }
    std::array<double, kMaxChannels> raw;
    Reading reading = read(frame, raw);
    std::array<float, kMaxChannels> of_channels;
    reading.taxels = patch_ != nullptr && frame.n_channels > 0 ? taxels_of(frame, patch_->shape(), of_channels) : taxels;
    if (patch_ == nullptr) follow_device(frame, reading.missing == 0);
    const std::size_t n = reading.channel.size();
    const auto all = std::uint32_t((std::uint64_t(1) << n) - 1);
    std::uint32_t dead = 0;
    const std::uint32_t of_stream = stream_.judge({raw.data(), n}, all & ~(reading.missing | reading.saturated), dead);
    const bool is_complete = reading.missing == 0;
    reading.temperature_C = temperature_C(frame);
    s.temperature_C = float(reading.temperature_C);
    for (std::size_t k = 0; dead != 0 && k < n; ++k)
        if ((dead >> k & 1u) != 0) channel_[k] = kNaN;
    reading.missing |= dead & all;
    s.missing = reading.missing;
    s.saturated = reading.saturated;
    if (setup_.automatic != nullptr) put_method(s);
    Estimate estimate = setup_.automatic == nullptr ? setup_.decoupler->decouple(reading) : decouple(reading);
    if (patch_ != nullptr) follow_device(frame, estimate.has_value);
    // A dead channel has the reason FROZEN or IDLE_BUS, and not MISSING_CHANNEL as well.
    if (dead != 0 && is_complete) estimate.reasons &= ~std::uint32_t(TACTILED_MISSING_CHANNEL);
    estimate.reasons |= of_stream | tuning_->reasons;
    return estimate;
}

// Returns the channels of the model, in the model's order and unit. `raw` receives the same channels as numbers of the
// frame.
inline Reading Sensor::read(const Frame& frame, std::array<double, kMaxChannels>& raw) noexcept {
    Reading reading;
    const std::size_t n = setup_.channel_of_frame.size();
    for (std::size_t k = 0; k < n; ++k) {
        const auto i = std::size_t(setup_.channel_of_frame[k]);
        const double value = frame.channel[i];
        const bool missing = (frame.missing >> i & 1u) != 0 || !std::isfinite(value);
        const bool saturated = !missing && ((frame.saturated >> i & 1u) != 0 || value <= tuning_->saturates_at[0] ||
                                            value >= tuning_->saturates_at[1]);
        raw[k] = value;
        channel_[k] = missing ? kNaN : value / setup_.counts_per_unit;
        if (missing) reading.missing |= 1u << k;
        if (saturated) reading.saturated |= 1u << k;
    }
    reading.channel = {channel_.data(), n};
    reading.t_ns = frame.t_ns;
    reading.zero_S = zero_S();
    return reading;
}

// Returns NaN if the temperature is unknown.
inline double Sensor::temperature_C(const Frame& frame) noexcept {
    double t_C = others_temperature_C_;
    if (setup_.temperature_of_sensor < 0) {
        if (setup_.temperature_of_frame < 0) return kNaN;
        const auto i = std::size_t(setup_.temperature_of_frame);
        const bool is_valid = ((frame.missing | frame.saturated) >> i & 1u) == 0;
        t_C = is_valid ? setup_.temperature_at_0_C + setup_.temperature_per_unit_K * frame.channel[i] : kNaN;
    }
    return thermometer_.judge(t_C, frame.t_ns);
}

// ---- method "auto" -----------------------------------------------------------------------------------------------------

// Measures the computing time in one of kTimedEvery samples, but not during a tare, whose samples must be of one method.
Estimate Sensor::decouple(const Reading& reading) noexcept {
    if (sequence_ % kTimedEvery != 0 || zero_.tare() == Tare::running) return setup_.automatic->decouple(reading);
    const std::uint64_t begun_ns = setup_.clock_ns();
    const Estimate estimate = setup_.automatic->decouple(reading);
    const std::uint64_t ns = setup_.clock_ns() - begun_ns;
    // a BAD estimate returns early, so its time would be too short
    if (estimate.has_value) setup_.automatic->took(ns, reading.t_ns);
    return estimate;
}

// Uses the method that MethodChoice has selected, from this sample on.
void Sensor::take_over_method() noexcept {
    const std::size_t now = setup_.automatic->choice().now();
    if (now == method_) return;
    method_ = now;
    low_pass_.reset();
    latency_.forget();
    zero_.forget_rests();
    break_rest();
}

void Sensor::put_method(tactiled_sample& s) const noexcept {
    const MethodChoice& choice = setup_.automatic->choice();
    s.state |= std::uint32_t(method_ + 1) << 16 | std::min(choice.steps(), 4095u) << 20;
    if (method_ > choice.first()) s.state |= TACTILED_STEPPED_DOWN;
    if (choice.is_over_budget()) s.state |= TACTILED_OVER_BUDGET;
}

// ---- tare, filter, magnitude -------------------------------------------------------------------------------------------

// The sample that completes a tare is the first sample with the new zero.
inline void Sensor::follow_tare(tactiled_sample& s) noexcept {
    const std::size_t n_channels = setup_.channel_of_frame.size();
    if (zero_.has_more_to_find()) zero_.find_other(*setup_.automatic, method_, n_channels);
    if (zero_.tare() == Tare::running) {
        const std::size_t n_methods = setup_.automatic != nullptr ? setup_.automatic->front().size() : 1;
        const unsigned samples = zero_.tare_samples();
        const bool is_done = zero_.advance(s, {channel_.data(), n_channels}, method_, n_methods);
        if (patch_ != nullptr && zero_.tare_samples() != samples) patch_->add_to_tare();
        if (is_done) low_pass_.reset();
        if (is_done && patch_ != nullptr) of_model_ = patch_->end_tare(true);
    }
    if (zero_.tare() == Tare::removing) zero_.end_removal();
    if (zero_.tare() == Tare::running) s.reasons |= TACTILED_TARING;
    s.tare_count = zero_.tare_count();
}

// The error of the force is unknown if the zero of the tare is lost or unknown for this method.
inline void Sensor::judge_zero(tactiled_sample& s) noexcept {
    if (s.quality == TACTILED_BAD) return;
    zero_.follow(true_ns(s.t_ns));
    sd_.of_model = sd_.with_zero = wrench_of(s.sd_force_N, s.sd_torque_Nm);
    if (zero_.is_known(method_)) {
        if (zero_.widen(sd_.with_zero)) s.reasons |= TACTILED_ZERO_OLD;
        return put_wrench(sd_.with_zero, s.sd_force_N, s.sd_torque_Nm);
    }
    if (zero_.is_missing()) s.reasons |= TACTILED_ZERO_UNKNOWN;
    s.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    for (std::size_t i = 0; i < 3; ++i) s.sd_force_N[i] = s.sd_torque_Nm[i] = kNaN;
}

// While the force changes, the delay of the chain contributes to the standard deviation.
inline void Sensor::judge_latency(tactiled_sample& s) noexcept {
    if (s.quality == TACTILED_BAD) return latency_.forget();
    Wrench sd = wrench_of(s.sd_force_N, s.sd_torque_Nm);
    latency_.widen(wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm), s.t_ns, sd);
    put_wrench(sd, s.sd_force_N, s.sd_torque_Nm);
}

// Sets force and torque to the raw wrench minus the zero, after the low pass.
void Sensor::put_tared(tactiled_sample& s) noexcept {
    const Wrench zero = zero_S();
    Wrench tared = wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm);
    for (std::size_t i = 0; i < tared.size(); ++i) tared[i] -= zero[i];
    if (s.quality != TACTILED_BAD) {
        Wrench sd = wrench_of(s.sd_force_N, s.sd_torque_Nm);
        if (is_confirmed(s))
            low_pass_.apply(tared, sd, s.t_ns);
        else
            low_pass_.hold(tared, sd);
        put_wrench(sd, s.sd_force_N, s.sd_torque_Nm);
        sd_.published = sd;
        put_place(tared, sd, s);
    }
    put_wrench(tared, s.force_S_N, s.torque_S_Nm);
}

// The place of the published force. A model that finds a place by itself states that of the raw force; only an array
// subtracts the zero of a tare from its taxels.
inline void Sensor::put_place(const Wrench& tared, const Wrench& sd, tactiled_sample& s) noexcept {
    const bool is_of_model = patch_ != nullptr || (s.tare_count == 0 && std::isfinite(of_model_.cop_S_m[0]));
    const PressPlace place = is_of_model ? published(of_model_, tared, sd, sd_.of_model)
                                         : place_of(tared, sd, covariance_of(*estimate_.correlations, sd_.of_model));
    std::copy_n(place.cop_S_m.begin(), 2, s.cop_S_m);
    std::copy_n(place.sd_m.begin(), 2, placed_.cop_sd_m);
}

// Sets contact, overload and peak from the measured components. Contact and overload do not wait for a confirmation, but
// leave no trace without it. Without a value there is no contact, so the contact of the last sample is not kept.
void Sensor::judge_magnitude(tactiled_sample& s) noexcept {
    s.peak_N = peak_N_;
    if (s.quality == TACTILED_BAD) {
        has_contact_ = false;
        return;
    }
    double squares = 0;
    for (const double f : s.force_S_N)
        if (std::isfinite(f)) squares += f * f;
    const double magnitude_N = std::sqrt(squares);
    const SensorSettable& at = in_force_;
    if (magnitude_N >= (has_contact_ ? at.contact_off_N : at.contact_on_N)) s.state |= TACTILED_CONTACT;
    if (at.overload_N > 0 && magnitude_N > at.overload_N) s.state |= TACTILED_OVERLOAD;
    if (low_pass_.is_on()) s.state |= TACTILED_LOW_PASS;
    if (!is_confirmed(s)) return;
    has_contact_ = (s.state & TACTILED_CONTACT) != 0;
    peak_N_ = s.peak_N = std::max(peak_N_, float(magnitude_N));
}

// A second without contact is a rest. One without motion, doubt or a held object is a free rest, which shows the zero.
inline void Sensor::follow_rest(tactiled_sample& s) noexcept {
    constexpr auto kRestNs = std::uint64_t(ZeroError::kRest_ns);
    if ((s.state & TACTILED_CONTACT) != 0 || s.quality == TACTILED_BAD) {
        rest_begins_ = true;
    } else if (is_confirmed(s)) {
        if (std::exchange(rest_begins_, false)) {
            rest_.begin(s.t_ns, kRestNs);
            is_free_ = true;
        }
        is_free_ = is_free_ && !may_hold_ && Zero::can_be_zero(s) && zero_.tare() == Tare::none;
        has_rested_ = rest_.add(wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm), s.t_ns);
        rest_begins_ = has_rested_;
    }
    if (tuning_->drift_limit_N > 0 && rest_N_ > tuning_->drift_limit_N) s.reasons |= TACTILED_DRIFTED;
}

// A rest ends with the next sample, so that the zero of a sample is the one that it was published with.
inline void Sensor::end_rest() noexcept {
    Wrench rest_S = rest_.mean_S();
    double squares = 0;
    for (std::size_t i = 0; i < 3; ++i)
        if (std::isfinite(rest_S[i])) squares += rest_S[i] * rest_S[i];
    rest_N_ = std::sqrt(squares);
    if (!is_free_ || rest_.has_moved(sd_.of_model)) return;
    const Wrench zero = zero_S();
    for (std::size_t i = 0; i < rest_S.size(); ++i) rest_S[i] -= zero[i];
    zero_.rest(rest_S, sd_.of_model);
}

const tactiled_sample& Sensor::compare(const tactiled_sample& others) noexcept {
    tactiled_sample& last = placed_.sample;
    const bool differed = agreement_.differs(), differs = agreement_.compare(last, others);
    if (differed && !differs) {  // a doubtful value must not contribute to a GOOD value, either
        low_pass_.reset();
        put_tared(last);
        keep(last);
    }
    if (!differs || last.quality == TACTILED_BAD) return last;
    last.reasons |= TACTILED_SENSORS_DIFFER;
    tactiled_put_verdict(&last, true);
    return last;
}

// ---- no frame ----------------------------------------------------------------------------------------------------------

tactiled_sample Sensor::marker(std::uint64_t now_ns) noexcept {
    tactiled_sample s = next_sample(stream_.last_frame_ns(), now_ns);
    s.epoch = epoch();
    s.tare_count = zero_.tare_count();
    s.peak_N = peak_N_;
    has_contact_ = false;
    tactiled_invalidate(&s, stream_.broken());
    keep(s);
    return s;
}

// ---- start, settings, reload -------------------------------------------------------------------------------------------

void Sensor::notice_suspension(std::uint64_t now_ns) noexcept {
    constexpr std::uint64_t kSuspended_ns = 5'000'000;
    // CLOCK_BOOTTIME is read first, so that an interruption between the two calls makes the difference smaller, not larger.
    const std::uint64_t boot_ns = setup_.boot_ns(), monotonic = tactiled::now_ns();
    const std::uint64_t suspended_ns = boot_ns > monotonic ? boot_ns - monotonic : 0;
    if (suspended_ns > suspended_ns_ + kSuspended_ns && is_started_) stream_.suspended(now_ns);
    is_started_ = true;
    suspended_ns_ = std::max(suspended_ns_, suspended_ns);
}

void Sensor::start(std::uint32_t daemon_epoch, std::uint64_t now_ns) noexcept {
    daemon_epoch_ = daemon_epoch;
    stream_.start(now_ns);
    notice_suspension(now_ns);
    zero_.start(true_ns(now_ns));
}

void Sensor::restore_zero(const TaredZero& zero, std::int64_t age_ns, const std::optional<LastForce>& last) noexcept {
    zero_.restore(zero, age_ns);
    if (patch_ != nullptr) patch_->lose_zeros();
    if (!last) return zero_.doubt();
    zero_.step(last->stepped);
    jumps_.mark(*last);
    may_be_another_ = may_have_started_ = true;
}

void Sensor::set(const SensorSettable& settable) noexcept {
    requested_ = settable;
    in_force_.filter_Hz = or_configured(settable.filter_Hz, tuning_->filter_hz);
    in_force_.contact_on_N = or_configured(settable.contact_on_N, tuning_->contact_on_N);
    in_force_.contact_off_N =
        std::min(or_configured(settable.contact_off_N, tuning_->contact_off_N), in_force_.contact_on_N);
    in_force_.overload_N = or_configured(settable.overload_N, tuning_->overload_N);
    if (in_force_.filter_Hz != low_pass_.cutoff_Hz()) low_pass_.set_cutoff(in_force_.filter_Hz);
}

void Sensor::retune(Sensor& other) noexcept {
    static_assert(std::is_nothrow_swappable_v<Tuning>);
    const int compared_with = agreement_.other();
    std::swap(*tuning_, *other.tuning_);
    if (agreement_.other() != compared_with) agreement_ = Agreement(tuning_->pair);
    set_delay();
    set(requested_);
}

void Sensor::succeed(const Sensor& before) noexcept {
    sequence_ = before.sequence_;
    daemon_epoch_ = before.daemon_epoch_;
    stream_.succeed(before.stream_, setup_.channel_of_frame == before.setup_.channel_of_frame);
    agreement_.succeed(before.agreement_);
    jumps_.succeed(before.jumps_);
    if (setup_.temperature_of_frame == before.setup_.temperature_of_frame &&
        setup_.temperature_of_sensor == before.setup_.temperature_of_sensor)
        thermometer_.succeed(before.thermometer_);
    suspended_ns_ = before.suspended_ns_;
    is_started_ = before.is_started_;
    continuity_ = before.continuity_;
    zero_.succeed(before.zero_);
    if (before.zero_.tare_count() != 0 || before.zero_.is_lost()) zero_.lose();
    if (before.zero_.is_doubted() || before.may_be_another_) zero_.doubt();
    set(before.requested_);
}

}  // namespace tactiled
