#include "node/sensor.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace tactiled {
namespace {

// What may be wrong with a value that is nevertheless fit to be a zero: a mounted sensor may well rest outside the
// calibrated domain, but a saturated or incomplete one has no known zero.
constexpr std::uint32_t kTareMayHave = TACTILED_TARING | TACTILED_UNKNOWN_UNCERTAINTY | TACTILED_OUTSIDE_DOMAIN |
                                       TACTILED_UNCALIBRATED | TACTILED_WRONG_RATE | TACTILED_DRIFTED |
                                       TACTILED_SENSORS_DIFFER;
// A zero that a method without a past finds of one reading is to be sure.
constexpr std::uint32_t kOtherZeroMayHave = TACTILED_OUTSIDE_DOMAIN | TACTILED_UNCALIBRATED;
constexpr std::uint64_t kTareLimitNs = 2'000'000'000;  // beyond the averaging time: a slow or halting sensor fails
// Method "auto" is timed in one sample of so many: two looks at the clock take as long as a fast method.
constexpr std::uint64_t kTimedEvery = 8;

}  // namespace

void Sensor::start(std::uint32_t daemon_epoch, std::uint64_t now_ns) noexcept {
    daemon_epoch_ = daemon_epoch;
    stream_.start(now_ns);
}

tactiled_sample Sensor::sample(const Frame& frame, std::uint64_t now_ns) noexcept {
    if (stream_.arrive(frame)) low_pass_.reset();

    tactiled_sample s{};
    s.sequence = sequence_++;
    s.t_ns = frame.t_ns;
    s.t_published_ns = now_ns;
    s.device_sequence = frame.has_sequence ? frame.sequence : 0;
    s.lost = stream_.lost();
    s.rate_Hz = stream_.rate_Hz();
    s.temperature_C = std::numeric_limits<float>::quiet_NaN();
    if (setup_.automatic != nullptr) take_over_method();
    const Estimate e = estimate(frame, s);
    s.epoch = epoch();
    s.quality = std::uint32_t(e.quality);
    s.reasons = e.reasons;
    s.residual = e.residual;
    s.state |= (e.direction & 31u) << 8;
    std::copy_n(e.cop_S_m.begin(), 2, s.cop_S_m);
    for (std::size_t i = 0; i < 3; ++i) {
        s.raw_force_S_N[i] = e.wrench_S[i];
        s.raw_torque_S_Nm[i] = e.wrench_S[i + 3];
        s.sd_force_N[i] = e.sd[i];
        s.sd_torque_Nm[i] = e.sd[i + 3];
    }
    if (zeros_to_find_ != 0) find_other_zero();
    if (tare_ == Tare::running) advance_tare(s);  // the sample that completes a tare is the first that it applies to
    if (tare_ == Tare::removing) tare_ = Tare::done;
    if (tare_ == Tare::running) s.reasons |= TACTILED_TARING;
    if (zero_unknown_ != 0) judge_zero(s);
    // What was doubtful, a rail for instance, is not to be in what is GOOD.
    if (s.quality == TACTILED_BAD || (s.quality == TACTILED_GOOD && own_quality_ == TACTILED_UNCERTAIN)) low_pass_.reset();
    put_tared(s);
    s.tare_count = tare_count_;
    judge_magnitude(s);
    if (drift_.has_drifted(s.raw_force_S_N, (s.state & TACTILED_CONTACT) == 0 && s.quality != TACTILED_BAD, s.t_ns))
        s.reasons |= TACTILED_DRIFTED;
    if (s.quality == TACTILED_BAD) tactiled_invalidate(&s, 0);
    own_quality_ = s.quality;
    last_ = s;
    return s;
}

void Sensor::set(const SensorSettable& settable) noexcept {
    const auto or_configured = [](double requested, double configured) {
        return std::isnan(requested) ? configured : requested;
    };
    requested_ = settable;
    const SensorSettable& configured = setup_.settable;
    in_force_.filter_Hz = or_configured(settable.filter_Hz, configured.filter_Hz);
    in_force_.contact_on_N = or_configured(settable.contact_on_N, configured.contact_on_N);
    in_force_.contact_off_N =
        std::min(or_configured(settable.contact_off_N, configured.contact_off_N), in_force_.contact_on_N);
    in_force_.overload_N = or_configured(settable.overload_N, configured.overload_N);
    if (in_force_.filter_Hz != low_pass_.cutoff_Hz()) low_pass_.set_cutoff(in_force_.filter_Hz);
}

void Sensor::retune(const Sensor& other) noexcept {
    setup_.saturates_below = other.setup_.saturates_below;
    setup_.saturates_above = other.setup_.saturates_above;
    setup_.tare_ns = other.setup_.tare_ns;
    setup_.tare_limit_N = other.setup_.tare_limit_N;
    setup_.settable = other.setup_.settable;
    stream_.judge_by(other.setup_.stream);
    drift_.judge_by(other.setup_.drift_N);
    agreement_.judge_by(other.setup_.agreement);
    set(requested_);
}

void Sensor::succeed(const Sensor& before) noexcept {
    sequence_ = before.sequence_;
    daemon_epoch_ = before.daemon_epoch_;
    stream_.succeed(before.stream_, setup_.channel_of_frame == before.setup_.channel_of_frame);
    agreement_.succeed(before.agreement_);
    set(before.requested_);
}

// The raw wrench less the zero, low-passed.
void Sensor::put_tared(tactiled_sample& s) noexcept {
    Wrench tared;
    for (std::size_t i = 0; i < 3; ++i) {
        tared[i] = s.raw_force_S_N[i] - zero_[i];
        tared[i + 3] = s.raw_torque_S_Nm[i] - zero_[i + 3];
    }
    if (s.quality != TACTILED_BAD) low_pass_.apply(tared, s.t_ns);
    std::copy_n(tared.begin(), 3, s.force_S_N);
    std::copy_n(tared.begin() + 3, 3, s.torque_S_Nm);
}

const tactiled_sample& Sensor::compare(const tactiled_sample& others) noexcept {
    const bool differed = agreement_.differs(), differs = agreement_.compare(last_, others);
    if (differed && !differs) {  // here, too, nothing doubtful is to be in what is GOOD
        low_pass_.reset();
        put_tared(last_);
    }
    if (!differs || last_.quality == TACTILED_BAD) return last_;
    last_.reasons |= TACTILED_SENSORS_DIFFER;
    last_.quality = TACTILED_UNCERTAIN;
    return last_;
}

// Contact, overload and peak, from the components that the sensor sees. No value, no contact: the last one is not kept.
void Sensor::judge_magnitude(tactiled_sample& s) noexcept {
    s.peak_N = peak_N_;
    if (s.quality == TACTILED_BAD) {
        contact_ = false;
        return;
    }
    double squares = 0;
    for (const double f : s.force_S_N)
        if (std::isfinite(f)) squares += f * f;
    const double magnitude_N = std::sqrt(squares);
    const SensorSettable& at = in_force_;
    contact_ = magnitude_N >= (contact_ ? at.contact_off_N : at.contact_on_N);
    peak_N_ = s.peak_N = std::max(peak_N_, float(magnitude_N));
    if (contact_) s.state |= TACTILED_CONTACT;
    if (at.overload_N > 0 && magnitude_N > at.overload_N) s.state |= TACTILED_OVERLOAD;
    if (low_pass_.is_on()) s.state |= TACTILED_LOW_PASS;
}

Estimate Sensor::estimate(const Frame& frame, tactiled_sample& s) noexcept {
    Reading reading;
    const std::size_t n = setup_.channel_of_frame.size();
    if (frame.n_channels != setup_.frame_channels) {
        Estimate wrong;
        wrong.reasons = TACTILED_WRONG_DEVICE;
        return wrong;
    }
    for (std::size_t k = 0; k < n; ++k) {
        const auto i = std::size_t(setup_.channel_of_frame[k]);
        const double raw = frame.channel[i];
        const bool missing = (frame.missing >> i & 1u) != 0 || !std::isfinite(raw);
        const bool saturated =
            !missing && ((frame.saturated >> i & 1u) != 0 || raw <= setup_.saturates_below || raw >= setup_.saturates_above);
        raw_[k] = raw;
        channel_[k] = missing ? kNaN : raw / setup_.counts_per_unit;
        if (missing) reading.missing |= 1u << k;
        if (saturated) reading.saturated |= 1u << k;
    }
    std::uint32_t dead = 0;
    const std::uint32_t usable = all_ & ~(reading.missing | reading.saturated);
    const std::uint32_t of_stream = stream_.judge({raw_.data(), n}, usable, dead);
    const std::uint32_t missing = reading.missing;  // before the dead: a cause of its own
    reading.missing |= dead & all_;
    for (std::size_t k = 0; dead != 0 && k < n; ++k)
        if ((dead >> k & 1u) != 0) channel_[k] = kNaN;
    reading.channel = {channel_.data(), n};
    reading.t_ns = frame.t_ns;
    s.missing = reading.missing;
    s.saturated = reading.saturated;
    if (setup_.automatic != nullptr) say_method(s);
    Estimate of_model = setup_.automatic == nullptr ? setup_.decoupler->decouple(reading) : decouple(reading);
    if (dead != 0 && missing == 0) of_model.reasons &= ~std::uint32_t(TACTILED_MISSING_CHANNEL);
    judge(of_stream, of_model);
    return of_model;
}

// What the stream says of a value that the model may have found good. WRONG_RATE alone does not touch it.
void Sensor::judge(std::uint32_t of_stream, Estimate& e) const noexcept {
    e.reasons |= of_stream;
    if ((of_stream & ~std::uint32_t(TACTILED_WRONG_RATE)) != 0 && e.quality == TACTILED_GOOD) e.quality = TACTILED_UNCERTAIN;
}

// Method "auto", timed now and then. Not while a tare is measured: its samples are of one method.
Estimate Sensor::decouple(const Reading& reading) noexcept {
    if (sequence_ % kTimedEvery != 0 || tare_ == Tare::running) return setup_.automatic->decouple(reading);
    const std::uint64_t begun_ns = setup_.clock_ns();
    const Estimate estimate = setup_.automatic->decouple(reading);
    const std::uint64_t ns = setup_.clock_ns() - begun_ns;
    if (estimate.quality != TACTILED_BAD) setup_.automatic->took(ns, reading.t_ns);  // BAD returns early
    return estimate;
}

// Another method begins with this sample.
void Sensor::take_over_method() noexcept {
    const std::size_t now = setup_.automatic->choice().now();
    if (now == method_) return;
    method_ = now;
    zero_ = zero_of_method_[now];
    low_pass_.reset();
}

void Sensor::say_method(tactiled_sample& s) const noexcept {
    const MethodChoice& choice = setup_.automatic->choice();
    s.state |= std::uint32_t(method_ + 1) << 16 | std::min(choice.steps(), 4095u) << 20;
    if (method_ > choice.first()) s.state |= TACTILED_STEPPED_DOWN;
    if (choice.is_over_budget()) s.state |= TACTILED_OVER_BUDGET;
}

// With a tare in force whose zero this method does not know, the force is off by nobody knows what.
void Sensor::judge_zero(tactiled_sample& s) const noexcept {
    if ((zero_unknown_ >> method_ & 1u) == 0 || s.quality == TACTILED_BAD) return;
    s.quality = TACTILED_UNCERTAIN;
    s.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    for (std::size_t i = 0; i < 3; ++i) s.sd_force_N[i] = s.sd_torque_Nm[i] = kNaN;
}

// What a method that does not run makes of the mean reading of the last tare; one of them a sample. One that has begun to
// run meanwhile keeps its past, and is asked when it does not run any more.
void Sensor::find_other_zero() noexcept {
    const std::uint32_t idle = zeros_to_find_ & ~(1u << method_);
    if (idle == 0) return;
    const auto i = std::size_t(std::countr_zero(idle));
    zeros_to_find_ &= ~(1u << i);
    std::array<double, kMaxChannels> mean{};
    Reading reading;
    const std::size_t n = setup_.channel_of_frame.size();
    for (std::size_t k = 0; k < n; ++k) {
        mean[k] = tare_channel_sum_[k] / tare_window_.samples();
        if (!std::isfinite(mean[k])) reading.missing |= 1u << k;
    }
    reading.channel = {mean.data(), n};
    reading.t_ns = tare_end_ns_;
    const Estimate e = setup_.automatic->decouple_anew(i, reading);
    if (e.quality == TACTILED_BAD || (e.reasons & ~kOtherZeroMayHave) != 0) return;
    for (std::size_t c = 0; c < zero_.size(); ++c) zero_of_method_[i][c] = std::isfinite(e.wrench_S[c]) ? e.wrench_S[c] : 0;
    zero_unknown_ &= ~(1u << i);
}

tactiled_sample Sensor::marker(std::uint64_t now_ns) noexcept {
    tactiled_sample s{};
    s.sequence = sequence_++;
    s.t_ns = stream_.last_frame_ns();
    s.t_published_ns = now_ns;
    s.epoch = epoch();
    s.tare_count = tare_count_;
    s.lost = stream_.lost();
    s.peak_N = peak_N_;
    s.rate_Hz = 0;
    s.temperature_C = std::numeric_limits<float>::quiet_NaN();
    tactiled_invalidate(&s, stream_.broken());
    contact_ = false;
    last_ = s;
    return s;
}

bool Sensor::can_tare() const noexcept {
    return is_delivering() && last_.quality != TACTILED_BAD && (last_.reasons & ~kTareMayHave) == 0 && tare_ == Tare::none;
}

void Sensor::begin_tare(std::uint64_t now_ns) noexcept {
    tare_ = Tare::running;
    tare_window_.begin(now_ns, setup_.tare_ns);
    tare_channel_sum_ = {};
    tare_is_unsure_ = false;
    zeros_to_find_ = 0;
}

void Sensor::begin_untare() noexcept {
    zero_ = {};
    zero_of_method_ = {};
    zero_unknown_ = zeros_to_find_ = 0;
    tare_count_ = 0;
    low_pass_.reset();
    tare_ = is_delivering() ? Tare::removing : Tare::done;
}

void Sensor::advance_tare(const tactiled_sample& s) noexcept {
    if (s.quality == TACTILED_BAD || (s.reasons & ~kTareMayHave) != 0) {
        tare_ = Tare::failed;
        return;
    }
    if (s.t_ns < tare_window_.begin_ns()) return;  // measured before the command
    const double *f = s.raw_force_S_N, *m = s.raw_torque_S_Nm;
    const bool complete = tare_window_.add({f[0], f[1], f[2], m[0], m[1], m[2]}, s.t_ns);
    for (std::size_t k = 0; k < setup_.channel_of_frame.size(); ++k) tare_channel_sum_[k] += channel_[k];
    tare_is_unsure_ |= (s.reasons & TACTILED_UNKNOWN_UNCERTAINTY) != 0;  // the method's own: judge_zero() comes later
    if (!complete) return;
    tare_ = verdict(s);
    if (tare_ != Tare::done) return;
    const Wrench mean = tare_window_.mean_S();
    for (std::size_t i = 0; i < zero_.size(); ++i) zero_[i] = std::isfinite(mean[i]) ? mean[i] : 0;
    ++tare_count_;
    low_pass_.reset();
    zero_unknown_ = tare_is_unsure_ ? 1u << method_ : 0;
    if (setup_.automatic != nullptr) {
        zero_of_method_ = {};
        zero_of_method_[method_] = zero_;
        zeros_to_find_ = ((1u << setup_.automatic->front().size()) - 1) & ~(1u << method_);
        zero_unknown_ |= zeros_to_find_;
        tare_end_ns_ = s.t_ns;
    }
}

// Whether what was averaged is fit to be a zero.
Sensor::Tare Sensor::verdict(const tactiled_sample& last) const noexcept {
    const double *f = last.sd_force_N, *m = last.sd_torque_Nm;
    if (tare_window_.has_moved({f[0], f[1], f[2], m[0], m[1], m[2]})) return Tare::moved;
    if (setup_.tare_limit_N <= 0) return Tare::done;
    const Wrench mean = tare_window_.mean_S();
    double squares = 0;
    for (std::size_t i = 0; i < 3; ++i)
        if (std::isfinite(mean[i])) squares += mean[i] * mean[i];
    return squares > setup_.tare_limit_N * setup_.tare_limit_N ? Tare::loaded : Tare::done;
}

Sensor::Tare Sensor::poll_tare(std::uint64_t now_ns) noexcept {
    if (tare_ == Tare::running && (!is_delivering() || now_ns > tare_window_.begin_ns() + setup_.tare_ns + kTareLimitNs))
        tare_ = Tare::failed;
    if (tare_ == Tare::removing && !is_delivering()) tare_ = Tare::done;
    const Tare reported = tare_;
    if (tare_ != Tare::running && tare_ != Tare::removing) tare_ = Tare::none;
    return reported;
}

}  // namespace tactiled
