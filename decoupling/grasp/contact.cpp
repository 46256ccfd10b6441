#include "decoupling/grasp/contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tactiled::grasp {
namespace {

constexpr double kMax_N = 1e6;  // a larger press is a fault, and its square may overflow
// 6 sd in two samples in a row: less than one false contact in 1e17 samples
constexpr double kOnNoises = 6, kOffNoises = 4;
constexpr double kOnOverOff = 1.2;  // minimum ratio of the two thresholds
constexpr int kInARow = 2;          // a single outlier is no contact
constexpr std::uint64_t kBucket_ns = 20'000'000;
// after a contact, for the filters and the quick part of a skin's relaxation
constexpr std::uint64_t kSettles_ns = 60'000'000;
constexpr int kNewZero = 15;                      // buckets: 0.3 s
constexpr double kDrift_1_s = 0.05;               // part of the threshold, each second
constexpr double kZeroTime_s = 0.3;               // the zero is a mean over this time
constexpr std::uint64_t kLeaves_ns = 25'000'000;  // opening jaws take longer: 0.1 N at 1 N/s
constexpr double kPressTime_s = 1;                // the time over which an earlier press is remembered

}  // namespace

bool Contact::take(const JawSample& sample) noexcept {
    const auto& f = sample.force_S_N;
    if (sample.quality == TACTILED_BAD || !(std::abs(f[2]) < kMax_N) || std::abs(f[0]) > kMax_N || std::abs(f[1]) > kMax_N) {
        zero_known_ = false;  // the zero may have changed meanwhile
        held_blind_ |= touching_;
        max_blind_N_ = -kMax_N;
        buckets_ = 0;
        touching_ = left_at_once_ = false;
        against_ = 0;
        observation_ = {.t_ns = std::max(observation_.t_ns, sample.t_ns)};
        filling_ = waiting_[0] = waiting_[1] = {};
        differences_ = 0;
        return false;
    }
    if (observation_.known && sample.t_ns <= observation_.t_ns) return false;
    const double elapsed_s = observation_.known ? double(sample.t_ns - observation_.t_ns) * 1e-9 : 0;
    const Eigen::Vector3d raw(f[0], f[1], f[2]);
    const Eigen::Vector3d was = observation_.force_S_N + zero_N_;
    const bool follows = observation_.known;
    observation_.t_ns = sample.t_ns;
    observation_.known = true;
    observation_.force_S_N = raw - zero_N_;
    observation_.sd_N = {sample.sd_N[0], sample.sd_N[1], sample.sd_N[2]};
    observation_.press_N = -observation_.force_S_N.z();
    observation_.shear_N = std::hypot(observation_.force_S_N.x(), observation_.force_S_N.y());
    // Outside its domain a calibration's sd does not hold, so no weight is computed with it.
    bool overload = (sample.reasons & (TACTILED_SATURATED | TACTILED_OUTSIDE_DOMAIN)) != 0;
    for (int k = 0; k < 3; ++k) overload |= setup_.full_scale_N[k] > 0 && std::abs(raw[k]) > setup_.full_scale_N[k];
    observation_.refusal = overload                                       ? TACTILED_WEIGHT_OVERLOAD
                           : (sample.reasons & TACTILED_TEMPERATURE) != 0 ? TACTILED_WEIGHT_TEMPERATURE
                                                                          : TACTILED_WEIGHT_NONE;
    judge_touch();
    max_blind_N_ = std::max(max_blind_N_, observation_.press_N);
    if (touching_ || observation_.press_N < max_blind_N_ - setup_.contact_off_N) held_blind_ = false;
    if (touching_) {
        const double keep = std::exp(-elapsed_s / kPressTime_s);
        held_press_N_ = std::max(observation_.press_N, held_press_N_ * keep);
        if (observation_.press_N >= held_press_N_ / 2) half_ns_ = sample.t_ns;
        return true;
    }
    if (follows && observation_.press_N < setup_.contact_off_N) {  // from differences of neighbours, which exclude drift
        const Eigen::Vector3d step_N = raw - was;
        const double newest = 1.0 / std::min(++differences_, 200);
        for (int k = 0; k < 3; ++k) {
            const double square = step_N[k] * step_N[k] / 2;
            if (!std::isfinite(square)) continue;
            noise_N_[k] = std::sqrt(noise_N_[k] * noise_N_[k] * (1 - newest) + square * newest);
        }
    }
    learn_zero(raw);
    return true;
}

void Contact::judge_touch() noexcept {
    const double off = std::max(setup_.contact_off_N, kOffNoises * noise_N_.z());
    const double on = std::max({setup_.contact_on_N, kOnNoises * noise_N_.z(), kOnOverOff * off});
    const bool says = touching_ ? observation_.press_N > off : observation_.press_N >= on;
    against_ = says == touching_ ? 0 : against_ + 1;
    if (against_ < kInARow) return;
    against_ = 0;
    touching_ = says;
    if (touching_) {
        held_press_N_ = observation_.press_N;
        half_ns_ = observation_.t_ns;
        filling_ = waiting_[0] = waiting_[1] = {};
    } else {
        left_at_once_ = observation_.t_ns - half_ns_ < kLeaves_ns;
        free_since_ns_ = observation_.t_ns;
        buckets_ = 0;  // hysteresis: the zero differs from the one before the contact
    }
}

void Contact::learn_zero(const Eigen::Vector3d& raw_N) noexcept {
    if (held_blind_) return;
    if (free_since_ns_ > 0 && observation_.t_ns - free_since_ns_ < kSettles_ns) return;
    if (filling_.n == 0) bucket_ns_ = observation_.t_ns;
    for (int k = 0; k < 3; ++k)
        if (std::isfinite(raw_N[k])) filling_.sum_N[k] += raw_N[k];  // a component that is not measured has no zero
    if (++filling_.n > 1 && observation_.t_ns - bucket_ns_ >= kBucket_ns) close_bucket();
}

void Contact::close_bucket() noexcept {
    const Bucket oldest = waiting_[0];
    waiting_ = {waiting_[1], filling_};
    filling_ = {};
    if (oldest.n == 0) return;
    const Eigen::Vector3d mean = oldest.sum_N / oldest.n;
    const double elapsed_s = double(observation_.t_ns - zero_ns_) * 1e-9;
    // jaws do not pull, so a negative press shows a zero that was taken under a press
    const bool pulls = mean.z() - zero_N_.z() > setup_.contact_on_N;
    if (!zero_known_ || buckets_ == 0 || pulls) {
        zero_N_ = mean;
        buckets_ = 1;
        zero_known_ = true;
    } else {
        const double part = std::max(1.0 / ++buckets_, -std::expm1(-double(kBucket_ns) * 1e-9 / kZeroTime_s));
        const Eigen::Vector3d off = mean - zero_N_;
        // A slow change is partly drift and partly a soft touch; drift is slower than this limit.
        const double max_N = buckets_ <= kNewZero ? kMax_N : kDrift_1_s * setup_.contact_off_N * double(kBucket_ns) * 1e-9;
        zero_N_ += (part * off).cwiseMax(-max_N).cwiseMin(max_N);
        buckets_ = std::min(buckets_, 1000);
        if (elapsed_s < 1) {  // such a difference from the mean of 0.3 s took about that time
            const Eigen::Vector3d square = (off.array() * off.array() / kZeroTime_s).matrix();
            walk_N2_s_ += std::max(1.0 / buckets_, 0.02) * (square - walk_N2_s_);
        }
    }
    zero_ns_ = observation_.t_ns;
}

double Contact::zero_age_s() const noexcept {
    return zero_ns_ == 0 ? 0 : double(observation_.t_ns - std::min(zero_ns_, observation_.t_ns)) * 1e-9;
}

Eigen::Vector3d Contact::zero_sd_N() const noexcept {
    if (!zero_known_) return Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    return (walk_N2_s_ * (zero_age_s() + kZeroTime_s)).array().sqrt().matrix();
}

}  // namespace tactiled::grasp
