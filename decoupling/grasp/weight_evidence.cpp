// Checks a weight: agreement of the jaws with each other, and of the weight with its earlier values.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "decoupling/grasp/weight.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kShare = 0.25;  // tolerance of a share, relative to a jaw's load, where share_sd is small
// The same with a sensor in each jaw: an object held off its centre loads two jaws with 20 and 80 %.
constexpr double kSplit = 0.6;
constexpr double kShareSds = 6;             // tolerance in share_sd, where that is large
constexpr double kShareInSd = 0.5;          // part of a difference beyond 3 share_sd that the weight's sd contains
constexpr double kShareCreeps = 0.05;       // tolerance of a share within one grasp
constexpr double kCreeps = 0.02;            // relative change since the first stable value
constexpr double kAnother = 0.2;            // minimum relative immediate change for another load
constexpr double kPressGain_sd = 0.03;      // relative difference between the calibrations of two jaws
constexpr double kPressRepeats_sd = 0.015;  // the same, after a known weight
constexpr double kUnbalanced_sds = 3.5;
constexpr double kBalanceInSd = 0.35;  // part of the unbalanced presses that the weight's sd contains
constexpr double kNegative_sds = 3;
constexpr double kMoves = 0.03;                      // relative change from window to window
constexpr double kRamps = 0.002;                     // the same, after a change of the load while it was held
constexpr double kNoisy = 0.0025;                    // larger relative noise would hide a swing in a short window
constexpr std::size_t kEnough = 48;                  // blocks of 5 ms: a swing bends by more than the noise in this time
constexpr double kBends = 0.002, kTrends = 0.005;    // relative changes within one window; larger ones are a swing
constexpr std::uint64_t kLook_ns = 100'000'000;      // length of such a window
constexpr std::uint64_t kTogether_ns = 100'000'000;  // the load reaches all jaws within this time
constexpr double kSlopeBlocks = 60;                  // 0.3 s: noise hides a slope in a shorter time
constexpr double kSlopeNoises = 1;                   // sd of a slope that noise explains
constexpr double kSeen = 6;                          // in sd of a sensor: the time of a smaller load is not determined

}  // namespace

double max_hidden_swing_m_s2(double frequency_Hz, double weigh_window_ms) noexcept {
    constexpr double kStandard_m_s2 = 9.80665;
    const double phase = 2 * std::numbers::pi * frequency_Hz * weigh_window_ms * 1e-3;
    // A whole window permits a bend and the noise that may hide the bend; its newest part permits less over a shorter time.
    const double allowed = std::max(std::hypot(kBends, kNoisy), kBends / Weight::kNewest);
    const double of_load = 16 * allowed / (phase * phase);  // the load at the crest is 1 + a / g
    return of_load < 1 ? of_load / (1 - of_load) * kStandard_m_s2 : std::numeric_limits<double>::infinity();
}

// Returns the mean forces of the jaws over the blocks newer than `from_ns`.
std::span<const JawForces> Weight::forces_since(std::uint64_t from_ns, std::span<const Contact> jaws) noexcept {
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        JawForces& out = forces_[j];
        Eigen::Vector3d sum_S_N = Eigen::Vector3d::Zero();
        std::size_t n = 0;
        while (n < n_ && block(n).t_ns > from_ns)
            sum_S_N += block_forces_S_N_[(newest_ + kBlocks - n++) % kBlocks][j].cast<double>();
        out.force_S_N = n > 0 ? Eigen::Vector3d(sum_S_N / double(n)) : jaws_[j].last_S_N;
        const Eigen::Array3d sensor = jaws[j].observation().sd_N.array(), zero = jaws[j].zero_sd_N().array();
        out.sd_N = (sensor * sensor + zero * zero).sqrt().matrix();
        out.axis_S = jaws_[j].axis_S.head<2>();
        out.carries_m_s2 = jaws_[j].carries_m_s2;
        out.rest_S_N = jaws_[j].rest.force_S_N;
    }
    return std::span(forces_).first(n_jaws_);
}

// `unknown_m_s2`: a possible acceleration of the hand that is not reported and that may explain unbalanced presses.
Weight::Findings Weight::examine(std::span<const JawForces> forces, double mass_kg, double sd_kg,
                                 double unknown_m_s2) const noexcept {
    Findings found;
    const bool shown = check_.done && check_.carrying == carrying();
    const std::array<double, kMaxJaws> even{};
    // The sum of all jaws is the weight, whatever their shares are; only a jaw without a sensor is inferred from these.
    const bool infers = std::popcount(carrying()) < int(n_all_);
    const double tolerance = std::max(infers ? kShare : kSplit, kShareSds * share_sd_);
    const Shares shares = shares_of(forces, shown ? check_.off : even, tolerance);
    if (shares.known) {
        found.off = shares.off;
        found.jaws |= shares.jaws;
        if (shares.jaws != 0)
            found.doubts |= std::uint32_t(shares.dead != 0 ? TACTILED_DOUBT_DEAD_SHEAR : TACTILED_DOUBT_SHARES);
        if (infers || shares.dead != 0)
            found.sd_kg = kShareInSd * std::max(0.0, shares.max_off - 3 * share_sd_) * std::abs(mass_kg);
    }
    if (all_face_) {
        const bool reported = acceleration_reported_ && block(0).acceleration_known;
        const Eigen::Vector3d reference_G = shown ? check_.balance_off_G : Eigen::Vector3d(Eigen::Vector3d::Zero());
        const double expected_N = std::abs(mass_kg) * (reported ? acceleration_G_.norm() : unknown_m_s2);
        const Balance balance =
            balance_of(forces, gravity_G_, reference_G, shown ? kPressRepeats_sd : kPressGain_sd, expected_N);
        if (balance.sds > kUnbalanced_sds) {
            found.doubts |= TACTILED_DOUBT_BALANCE;
            found.jaws |= balance.jaws;
        }
        if (balance.presses_N > 0) {
            // A wrong gain changes the weight as much as the presses; a tilt that is not reported changes it by 1 -
            // cos.
            const double weight_N = std::max(1e-9, std::abs(mass_kg) * gravity_G_.norm());
            const double tilt = std::hypot(1, balance.across_N / weight_N) - 1;
            found.sd_kg = std::hypot(found.sd_kg, std::abs(mass_kg) * kBalanceInSd * balance.across_N / balance.presses_N,
                                     std::abs(mass_kg) * tilt);
        }
    }
    if (mass_kg < -kNegative_sds * std::hypot(sd_kg, found.sd_kg)) found.doubts |= TACTILED_DOUBT_NEGATIVE;
    const Shares since = shares_of(forces, first_.off, kShareCreeps);
    if (first_.known && since.known && since.jaws != 0) {
        found.doubts |= TACTILED_DOUBT_CREEPS;
        found.jaws |= since.jaws;
    }
    found.sd_kg = std::hypot(found.sd_kg, unexplained_kg(mass_kg));
    if (!first_.weighed) return found;
    const double crept_kg = std::abs(mass_kg - first_.mass_kg);
    if (crept_kg > std::hypot(kCreeps * mass_kg, 3 * first_.sd_kg)) found.doubts |= TACTILED_DOUBT_CREEPS;
    found.sd_kg = std::hypot(found.sd_kg, crept_kg);
    return found;
}

// Returns the time at which the load reached the last jaw: `first_ns`, the time of the sum, unless one jaw was late.
std::uint64_t Weight::last_lift_off(std::span<const JawForces> forces, std::uint64_t first_ns,
                                    std::uint32_t& late) const noexcept {
    std::uint64_t last_ns = first_ns;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        if (jaws_[j].carries_m_s2 <= 0) continue;
        const Eigen::Vector2f axis = forces[j].axis_S.cast<float>();
        const Eigen::Vector2d rest = forces[j].rest_S_N.array().isFinite().select(forces[j].rest_S_N, 0);
        const double rest_N = rest.dot(forces[j].axis_S),
                     load_N = forces[j].force_S_N.head<2>().dot(forces[j].axis_S) - rest_N;
        if (!(std::abs(load_N) > kSeen * forces[j].sd_N.head<2>().norm())) continue;
        std::uint64_t first_of_jaw_ns = begun_ns_;
        for (std::size_t b = 0; b < n_ && block(b).t_ns >= begun_ns_; ++b) {
            const double then_N =
                double(block_forces_S_N_[(newest_ + kBlocks - b) % kBlocks][j].head<2>().dot(axis)) - rest_N;
            if (then_N / load_N >= 0.9) first_of_jaw_ns = block(b).t_ns;
        }
        const bool forgotten = n_ == kBlocks && first_of_jaw_ns <= block(n_ - 1).t_ns;
        if (forgotten || first_of_jaw_ns <= first_ns + kTogether_ns) continue;
        late |= 1u << j;
        last_ns = std::max(last_ns, first_of_jaw_ns);
    }
    return last_ns;
}

// Returns true if the means of 100 ms since `from_ns` differ by more than those of a load at rest.
bool Weight::moved(const Mean& window, std::uint64_t from_ns, std::uint64_t now_ns) const noexcept {
    constexpr std::size_t kWindows = 8;
    std::array<double, kWindows> sum_kg{};
    std::array<std::size_t, kWindows> n{};
    for (std::size_t b = 0; b < n_ && block(b).t_ns > from_ns; ++b) {
        const std::uint64_t k = (now_ns - std::min(now_ns, block(b).t_ns)) / kLook_ns;
        if (k >= kWindows) break;
        sum_kg[k] += block(b).mass_kg;
        ++n[k];
    }
    const double weight_kg = std::max(std::abs(window.mass_kg), contact_N_ / gravity_G_.norm());
    const double allowed_kg = again_ ? std::hypot(kRamps * weight_kg, 4 * window.jitter_kg / std::sqrt(double(window.n)))
                                     : std::hypot(kMoves * weight_kg, window.blocks_sd_kg);
    for (std::size_t k = 1; k < kWindows; ++k)
        if (n[k] > 0 && now_ns >= from_ns + (k + 1) * kLook_ns &&
            std::abs(sum_kg[k] / double(n[k]) - window.mass_kg) > allowed_kg)
            return true;
    return false;
}

// A load that changes steadily may be caused by a drift of the zero since it was learnt. Returns the slope of the blocks
// newer than `from_ns`, minus the part that noise explains, times the age of the zeros.
double Weight::drifted_kg(std::span<const Contact> jaws, std::uint64_t from_ns) const noexcept {
    double n = 0, t = 0, m = 0, tt = 0, tm = 0, jitter = 0;
    for (std::size_t b = 0; b < n_ && block(b).t_ns > from_ns; ++b, ++n) {
        const double t_s = double(block_ns_ - std::min(block_ns_, block(b).t_ns)) * -1e-9;
        t += t_s, m += block(b).mass_kg, tt += t_s * t_s, tm += t_s * block(b).mass_kg;
        if (b > 0) jitter += std::pow(block(b).mass_kg - block(b - 1).mass_kg, 2) / 2;
    }
    const double spread = n > 0 ? tt - t * t / n : 0;
    if (n < kSlopeBlocks || !(spread > 0)) return 0;
    const double slope = (tm - t * m / n) / spread, noise = std::sqrt(jitter / (n - 1) / spread);
    double age_s = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j)
        if (jaws_[j].carries_m_s2 > 0) age_s = std::max(age_s, jaws[j].zero_age_s());
    return std::max(0.0, std::abs(slope) - kSlopeNoises * noise) * age_s;
}

void Weight::take_first(const Findings& found) noexcept {
    if (!first_.known) first_.off = found.off;  // also after a slip
    if (!first_.weighed) {
        unexplained_kg_ = unexplained_kg(held_kg_);
        departed_kg_ = kNaN;
        first_.mass_kg = held_kg_;
        first_.sd_kg = held_sd_kg_;
    }
    first_.known = first_.weighed = true;
}

// A large immediate change is another load. A small change may come from the creep of a sensor, and remains in the standard
// deviation.
double Weight::unexplained_kg(double mass_kg) const noexcept {
    const double change_kg = std::abs(mass_kg - departed_kg_);
    return unexplained_kg_ + (change_kg <= kAnother * std::abs(departed_kg_) ? change_kg : 0);  // false for NaN
}

void Weight::forget_first() noexcept {
    first_.known = first_.weighed = false;
    unexplained_kg_ = 0;
    departed_kg_ = kNaN;
}

// Returns false for a window with a trend or a bend above its noise, which may be a part of a swing.
bool Weight::flat(const Mean& mean) const noexcept {
    const double noise_kg = 3 * mean.jitter_kg / std::sqrt(double(mean.n) / 4);
    const double weight_kg = std::max(std::abs(mean.mass_kg), contact_N_ / gravity_G_.norm());
    if (noise_kg > kNoisy * weight_kg && mean.n < kEnough) return false;
    return std::abs(mean.trend_kg) <= std::hypot(kTrends * weight_kg, noise_kg) &&
           std::abs(mean.bend_kg) <= std::hypot(kBends * weight_kg, noise_kg);
}

// Does the same as flat() for a part of a window. A swing trends in proportion to the length and bends in proportion to its
// square. The limits are smaller by one more power, as a shorter mean has more noise, and noise does not raise them.
bool Weight::part_is_flat(const Mean& mean, double part) const noexcept {
    const double noise_kg = 3 * mean.jitter_kg / std::sqrt(double(mean.n) / 4);
    const double weight_kg = part * part * std::max(std::abs(mean.mass_kg), contact_N_ / gravity_G_.norm());
    return noise_kg <= kNoisy * weight_kg && std::abs(mean.trend_kg) <= kTrends * weight_kg &&
           std::abs(mean.bend_kg) <= part * kBends * weight_kg;
}

}  // namespace tactiled::grasp
