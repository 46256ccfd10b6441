#include "decoupling/grasp/weight.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tactiled::grasp {
namespace {

constexpr std::uint64_t kFresh_ns = 100'000'000;  // age up to which a reported acceleration is used
// accepted lengths of gravity: those on Earth, with rounding
constexpr double kMinG_m_s2 = 9.69, kMaxG_m_s2 = 9.91;
constexpr double kObservable = 0.3;  // least tangential part of the weight: gravity 17 degrees off the skin's normal

// An overload is reported before an unknown temperature, because it may damage the sensor.
tactiled_weight_state more_severe(tactiled_weight_state a, tactiled_weight_state b) noexcept {
    return a == TACTILED_WEIGHT_NONE || b == TACTILED_WEIGHT_OVERLOAD ? b : a;
}

}  // namespace

Weight::Weight(const Setup& setup)
    : n_jaws_(setup.jaws.size()),
      n_all_(std::max<std::size_t>(setup.jaws_of_gripper, setup.jaws.size())),
      share_sd_(setup.share_sd),
      max_acceleration_m_s2_(setup.lift_acceleration_m_s2),
      accelerates_ns_(std::uint64_t(setup.lift_accelerates_ms * 1e6)) {
    central_ = n_all_ >= 3;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const JawSetup& s = setup.jaws[j];
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c) jaws_[j].S_from_G(r, c) = s.S_from_G[std::size_t(r)][std::size_t(c)];
        contact_N_ += s.contact_off_N;
        jaws_[j].errs_by_gain = s.errs_by_gain;
        jaws_[j].share = s.share > 0 ? s.share : 1 / double(n_all_);
    }
    for (std::size_t j = 0; j < n_jaws_; ++j) forces_[j].S_from_G = jaws_[j].S_from_G;
    all_face_ = n_jaws_ == n_all_ && jaws_face_each_other(std::span(forces_).first(n_jaws_));
    window(setup.weigh_window_ms);
    gravity(Eigen::Vector3d(setup.gravity_G.data()));
    end();
}

void Weight::window(double ms) noexcept {
    if (ms >= 10 && ms <= 1000) window_ns_ = std::uint64_t(ms * 1e6);
}

void Weight::gravity(const Eigen::Vector3d& gravity_G_m_s2) noexcept {
    const double size = gravity_G_m_s2.norm();
    const bool known = size > kMinG_m_s2 && size < kMaxG_m_s2;  // false for NaN
    const Eigen::Vector3d to = known ? gravity_G_m_s2 : Eigen::Vector3d::Zero();
    if (known && gravity_G_.norm() > 0 && to.dot(gravity_G_) > 0.9999 * to.norm() * gravity_G_.norm()) {
        gravity_G_ = to;  // a change of about 0.1 degree keeps the weight
        return aim();
    }
    gravity_G_ = to;
    aim();
    n_ = 0;
    held_known_ = false;
    forget_first();
}

void Weight::acceleration(const Eigen::Vector3d& acceleration_G_m_s2, std::uint64_t t_ns) noexcept {
    acceleration_reported_ = acceleration_G_m_s2.norm() < 1000;  // false for NaN
    if (acceleration_reported_) acceleration_G_ = acceleration_G_m_s2;
    acceleration_ns_ = t_ns;
}

// Computes the direction and the share of the load of each jaw. The sum of what all jaws exert on the object is m (a
// - g), so the object exerts m (g - a) on the jaws. Only the tangential part counts, as the normal direction contains
// the squeeze.
void Weight::aim() noexcept {
    const Eigen::Vector3d pull_G = central_ ? Eigen::Vector3d(0, 0, gravity_G_.z()) : gravity_G_;
    double along = 0, across = 0;
    carries_ = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        Jaw& jaw = jaws_[j];
        Eigen::Vector3d t = jaw.S_from_G * pull_G;
        t.z() = 0;
        const double size = t.norm();
        jaw.axis_S = size > kObservable * gravity_G_.norm() ? Eigen::Vector3d(t / size) : Eigen::Vector3d::Zero();
        jaw.carries_m_s2 = jaw.axis_S.norm() > 0 ? jaw.share * size : 0;
        carries_ += jaw.carries_m_s2;
        along += jaw.carries_m_s2;
        across += jaw.share * std::sqrt(std::max(0.0, gravity_G_.squaredNorm() - size * size));
    }
    tilt_ = along > 0 ? across / along : 0;
}

void Weight::take(std::size_t jaw, const Observation& observation) noexcept {
    Jaw& j = jaws_[jaw];
    j.t_ns = observation.t_ns;
    j.refusal = more_severe(j.refusal, observation.refusal);
    double force_N = 0;
    for (int k = 0; k < 2; ++k)
        if (std::abs(j.axis_S[k]) > kNoPart)
            force_N += j.axis_S[k] * observation.force_S_N[k];  // the other component may not be measured
    j.blind = !std::isfinite(force_N);
    if (j.blind) return;
    j.sum_N += force_N;
    j.sum_S_N += observation.force_S_N;
    j.n = std::min(j.n + 1, 1 << 20);
}

void Weight::begin(std::uint64_t t_ns) noexcept {
    weighing_ = true;
    held_known_ = again_ = false;
    forget_first();
    begun_ns_ = t_ns;
    now_ = {TACTILED_WEIGHT_ESTIMATING, kNaN, kNaN, 0};
}

void Weight::end() noexcept {
    weighing_ = held_known_ = false;
    now_ = {TACTILED_WEIGHT_NONE, kNaN, kNaN, 0};
}

const Weight::Block& Weight::block(std::size_t back) const noexcept { return blocks_[(newest_ + kBlocks - back) % kBlocks]; }

void Weight::close_block(std::uint64_t now_ns) noexcept {
    if (now_ns > block_ns_ + kBreak_ns) n_ = 0;
    block_ns_ = now_ns;
    double force_N = 0, carries_now = 0;
    const bool reported =
        acceleration_reported_ && now_ns < acceleration_ns_ + kFresh_ns && acceleration_ns_ < now_ns + kFresh_ns;
    Eigen::Vector3d pull_G = reported ? Eigen::Vector3d(gravity_G_ - acceleration_G_) : gravity_G_;
    if (central_) pull_G.head<2>().setZero();
    refusal_ = TACTILED_WEIGHT_NONE;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        Jaw& jaw = jaws_[j];
        refusal_ = more_severe(refusal_, std::exchange(jaw.refusal, TACTILED_WEIGHT_NONE));
        if (jaw.carries_m_s2 > 0) carries_now += jaw.share * jaw.axis_S.dot(jaw.S_from_G * pull_G);
        if (jaw.n > 0) {  // a slower sensor's value is kept
            jaw.last_N = jaw.sum_N / jaw.n;
            jaw.last_S_N = jaw.sum_S_N / jaw.n;
        }
        jaw.sum_N = jaw.n = 0;
        jaw.sum_S_N.setZero();
        force_N += jaw.last_N;
    }
    if (carries_ <= 0) return;
    newest_ = (newest_ + 1) % kBlocks;
    n_ = std::min(n_ + 1, kBlocks);
    blocks_[newest_] = {now_ns, scale_ * force_N / std::max(0.1 * carries_, carries_now), reported,
                        reported ? acceleration_G_.norm() : 0};
    for (std::size_t j = 0; j < n_jaws_; ++j) block_forces_S_N_[newest_][j] = jaws_[j].last_S_N.cast<float>();
}

bool Weight::zero() noexcept {
    if (now_.state != TACTILED_WEIGHT_STABLE || !held_known_) return false;
    tare_kg_ = held_kg_;
    now_.mass_kg = 0;
    return true;
}

bool Weight::known(double mass_kg, std::span<const Contact> jaws) noexcept {
    if (mass_kg == 0) {
        rescale(1 / scale_);
        check_ = {};
        if (now_.state == TACTILED_WEIGHT_STABLE)
            now_.state = TACTILED_WEIGHT_ESTIMATING;  // its standard deviation was computed with the old scale
        return true;
    }
    if (now_.state != TACTILED_WEIGHT_STABLE || !held_known_ || !(mass_kg > 0) || !std::isfinite(mass_kg)) return false;
    if (tare_kg_ != 0) return false;  // the tare would contain a leak of the press, and the scale would not
    const double factor = mass_kg / now_.mass_kg;
    if (!(factor > 1 / kKnownFactor && factor < kKnownFactor))
        return false;  // a jaw with no load or with all of it has no share to correct
    // The known weight corrects the uncertainty of the shares only; any other error would enter every later weight.
    if (now_.sd_kg > std::hypot(kKnownSure * now_.mass_kg, held_kg_ * share_sd())) return false;
    if (!(std::abs(rest_kg(jaws)) <= kKnownSure * now_.mass_kg))
        return false;  // a force may still be present; NaN: not measured
    rescale(factor);
    const std::span<const JawForces> forces = forces_since(block_ns_ - std::min(block_ns_, window_ns_), jaws);
    const Balance balance = balance_of(forces, gravity_G_, Eigen::Vector3d::Zero(), 0, 0);
    check_ = {.done = true,
              .mass_kg = mass_kg,
              .rest_kg = rest_kg(jaws),
              .was_force = std::abs(rest_kg(jaws)) > max_leak_kg(jaws),
              .carrying = carrying(),
              .sd = std::hypot(std::hypot(held_sd_kg_, zeros_kg(jaws)) / held_kg_, tilt_ * kDown_rad),
              .off = first_.off,
              .balance_off_G = balance.off_G};
    return true;
}

void Weight::rescale(double factor) noexcept {
    scale_ *= factor;
    held_kg_ *= factor;
    held_sd_kg_ *= factor;
    held_blocks_sd_kg_ *= factor;
    tare_kg_ *= factor;
    now_.mass_kg *= factor;
    now_.sd_kg *= factor;
    first_.mass_kg *= factor;
    first_.sd_kg *= factor;
    unexplained_kg_ *= factor;
    departed_kg_ *= factor;
    for (Block& b : blocks_) b.mass_kg *= factor;
}

}  // namespace tactiled::grasp
