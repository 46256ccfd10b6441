// Decides if the load is a stable weight, and computes its standard deviation.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "decoupling/grasp/weight.hpp"

namespace tactiled::grasp {
namespace {

constexpr std::uint64_t kBlock_ns = 5'000'000, kGlance_ns = 20'000'000;
constexpr std::uint64_t kLongest_ns = 1'200'000'000;
constexpr double kStill = 0.01;     // relative change within a stable value
constexpr double kDeparts = 0.015;  // a larger relative change is an acceleration or another weight
constexpr double kUnchecked = 0.1;  // relative sd of a share by symmetry, before a known weight confirms it
// kAlike: part of the errors that sensors of one kind have in common, because they bend, yield and soften alike. The others:
// for errors by gain, the part that remains after a known weight at its own load, and its growth at other loads. Chosen with
// grasp_bench weigh, seed 1, for a correct published standard deviation, and checked with other seeds.
constexpr double kAlike = 0.6, kLeftByCheck = 0.1, kOffCheck = 0.88;
constexpr double kLeftOfOthers = 0.5;  // the same for other sensors, for which no measurement exists
constexpr double kReported = 0.05;     // relative error of a reported acceleration: delay and scale
// an object that is dragged over a table with a force F presses on the table with up to F / 0.3
constexpr double kTableFriction = 0.3;
constexpr double kFollows_s = 1;  // a stable value follows creep with this time constant
constexpr double kShaken = 0.2;   // relative rms of 5 ms; above it the load itself changes
constexpr double kSure = 0.2;     // relative standard deviation above which no weight is good
// From half of the load to nine tenths of it; lifts in the tests take 0.05 to 0.3 s in all.
constexpr std::uint64_t kSlowly_ns = 250'000'000;
constexpr std::uint64_t kQuiet_ns = 500'000'000;  // half a period of a swing of 1 Hz
constexpr std::size_t kMinNewest = 8;             // blocks of 5 ms that show noise and bend

double square(double x) noexcept { return x * x; }

std::uint32_t bit_if(bool is, tactiled_weight_doubt doubt) noexcept { return is ? std::uint32_t(doubt) : 0u; }

}  // namespace

Weight::Mean Weight::mean_since(std::uint64_t from_ns) const noexcept {
    Mean m;
    while (m.n < n_ && block(m.n).t_ns > from_ns) m.mass_kg += block(m.n++).mass_kg;
    if (m.n == 0) return m;
    m.mass_kg /= double(m.n);
    // The scatter of a few long parts is used, because vibration and filters make neighbours similar.
    const std::size_t parts = std::min<std::size_t>(m.n, 4);
    std::array<double, 4> part{};
    for (std::size_t p = 0; p < parts; ++p) {
        const std::size_t begin = p * m.n / parts, end = (p + 1) * m.n / parts;
        for (std::size_t b = begin; b < end; ++b) part[p] += block(b).mass_kg / double(end - begin);
    }
    for (std::size_t b = 0; b < m.n; ++b) {
        m.blocks_sd_kg += square(block(b).mass_kg - m.mass_kg);
        if (b > 0) m.jitter_kg += square(block(b).mass_kg - block(b - 1).mass_kg) / 2;
        m.accelerations_known &= block(b).acceleration_known;
        m.max_acceleration_m_s2 = std::max(m.max_acceleration_m_s2, block(b).acceleration_m_s2);
    }
    m.blocks_sd_kg = std::sqrt(m.blocks_sd_kg / double(m.n));
    m.jitter_kg = std::sqrt(m.jitter_kg / double(m.n));
    if (parts < 4) {
        m.sd_kg = std::abs(m.mass_kg);
        return m;
    }
    double squares = 0;
    for (const double p : part) squares += square(p - m.mass_kg);
    m.sd_kg = 1.2 * std::sqrt(squares / 3 / 4);  // 1.2: Student's 68 % of three degrees of freedom
    m.trend_kg = (part[0] + part[1] - part[2] - part[3]) / 2;
    m.bend_kg = (part[0] - part[1] - part[2] + part[3]) / 2;
    return m;
}

// Returns the time at which the load first reached `mass_kg`; with vibration the last time would be too late.
std::uint64_t Weight::first_above(double mass_kg) const noexcept {
    std::uint64_t first_ns = begun_ns_;
    for (std::size_t b = 0; b < n_ && block(b).t_ns >= begun_ns_; ++b)
        if (block(b).mass_kg >= mass_kg) first_ns = block(b).t_ns;
    return first_ns;
}

// Returns the time at which the load first reached nine tenths of `mass_kg`.
std::uint64_t Weight::lift_off(double mass_kg) const noexcept {
    const std::uint64_t first_ns = first_above(0.9 * mass_kg);
    const bool forgotten = n_ == kBlocks && now_.lift_off_ns >= begun_ns_ && now_.lift_off_ns < block(n_ - 1).t_ns;
    return forgotten ? now_.lift_off_ns : first_ns;
}

std::uint32_t Weight::carrying() const noexcept {
    std::uint32_t mask = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) mask |= std::uint32_t(jaws_[j].carries_m_s2 > 0) << j;
    return mask;
}

// Returns the relative error of the sum of n of all jaws, each with an equal share within share_sd_. A known weight was
// measured with the same error, and does not correct other jaws.
double Weight::share_sd() const noexcept {
    const auto n = double(std::popcount(carrying())), all = double(n_all_);
    if (check_.done && carrying() != check_.carrying) return kUnchecked;
    if (n == all) return 0;
    return check_.done ? share_sd_ * std::sqrt(2 * (all - n) / (all * n)) : kUnchecked;
}

// Returns true if the standard deviation is small enough. A load below the contact threshold counts as no load, which may be
// reported.
bool Weight::sure(double mass_kg, double sd_kg) const noexcept {
    return sd_kg <= kSure * std::max(std::abs(mass_kg), contact_N_ / gravity_G_.norm());  // false for NaN
}

// Returns the weight that the reading before the lift corresponds to, scaled by the growth of the press since; NaN if
// it was not measured.
double Weight::rest_kg(std::span<const Contact> jaws) const noexcept {
    double force_N = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const Jaw& jaw = jaws_[j];
        if (jaw.carries_m_s2 <= 0) continue;
        const double grown = std::max(1.0, jaws[j].observation().press_N / jaw.rest.press_N);
        for (int k = 0; k < 2; ++k)
            if (std::abs(jaw.axis_S[k]) > kNoPart) force_N += grown * jaw.axis_S[k] * jaw.rest.force_S_N[k];
    }
    return scale_ * force_N / carries_;
}

double Weight::max_leak_kg(std::span<const Contact> jaws) const noexcept {
    double max_N = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j)
        if (jaws_[j].carries_m_s2 > 0) max_N += kLeak * std::max(0.0, jaws[j].observation().press_N);
    return scale_ * max_N / carries_;
}

double Weight::zeros_kg(std::span<const Contact> jaws) const noexcept {
    double squares_N2 = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const Eigen::Vector2d axis = jaws_[j].axis_S.head<2>();
        if (axis.norm() > 0) squares_N2 += (axis.array() * jaws[j].zero_sd_N().head<2>().array()).matrix().squaredNorm();
    }
    return scale_ / carries_ * std::sqrt(squares_N2);
}

// Returns the sensors' own standard deviation in the weight. A known weight fixes their curve at its load, and the zero
// before each grasp at 0; between the two the curve deviates, and above them the error grows with the load.
double Weight::sensors_kg(double mass_kg, std::span<const Contact> jaws) const noexcept {
    double squares_N2 = 0, sum_N = 0;
    bool by_gain = true;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const Eigen::Vector2d axis = jaws_[j].axis_S.head<2>();
        if (axis.norm() == 0) continue;
        const double one_N = (axis.array() * jaws[j].observation().sd_N.head<2>().array()).matrix().norm();
        squares_N2 += square(one_N);
        sum_N += one_N;
        by_gain &= jaws_[j].errs_by_gain;
    }
    const double all_kg = scale_ / carries_ * std::sqrt((1 - kAlike) * squares_N2 + kAlike * square(sum_N));
    if (!check_.done) return all_kg;
    const double u = std::abs(mass_kg) / check_.mass_kg;
    if (!by_gain) return std::max(kLeftOfOthers, u < 1 ? 1 - u : u - kLeftOfOthers) * all_kg;
    return std::hypot(kLeftByCheck, kOffCheck * (u < 1 ? u * (1 - u) : u - 1)) * all_kg;
}

// The reading before the lift may be a leak of the press. The weight then contains it, except for the part in the
// scale of a known weight. A reading above the largest leak is a force, and a leak may be present in addition.
double Weight::leaks_kg(double mass_kg, std::span<const Contact> jaws) const noexcept {
    const double now_kg = rest_kg(jaws), max_kg = max_leak_kg(jaws);
    const double then_kg = check_.done ? std::abs(mass_kg) / check_.mass_kg * check_.rest_kg : 0;
    if (std::abs(now_kg) <= max_kg && !check_.was_force) return std::abs(now_kg - then_kg);
    return (std::abs(now_kg) <= max_kg ? std::abs(now_kg) : max_kg) + std::abs(then_kg);  // false for NaN
}

double Weight::systematic_kg(double mass_kg, std::span<const Contact> jaws) const noexcept {
    const double parts = std::hypot(share_sd(), tilt_ * kDown_rad, check_.sd);
    const double seen_kg = std::hypot(leaks_kg(mass_kg, jaws), zeros_kg(jaws));
    return std::hypot(sensors_kg(mass_kg, jaws), seen_kg, mass_kg * parts);
}

// Returns the tangential force perpendicular to the axis, beyond the part of a tilted weight and of a leak of the
// press, as a mass that may rest on the surface below the object.
double Weight::off_axis_kg(std::span<const Contact> jaws, double mass_kg, std::uint32_t& found) const noexcept {
    double max_kg = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const Jaw& jaw = jaws_[j];
        if (jaw.carries_m_s2 <= 0) continue;
        const Observation& observation = jaws[j].observation();
        const Eigen::Vector2d axis = jaw.axis_S.head<2>(), force = observation.force_S_N.head<2>();
        const double across_N = std::abs(axis.x() * force.y() - axis.y() * force.x());
        Eigen::Vector3d weight_S = jaw.S_from_G * gravity_G_ * (jaw.share * mass_kg);
        const double explained_N = std::abs(axis.x() * weight_S.y() - axis.y() * weight_S.x()) +
                                   kLeak * (observation.press_N + observation.shear_N) +
                                   3 * observation.sd_N.head<2>().maxCoeff();
        if (across_N > explained_N) found |= 1u << j;
        max_kg = std::max(max_kg, (across_N - explained_N) / jaw.carries_m_s2 / kTableFriction);
    }
    return max_kg;
}

void Weight::judge(std::span<const Contact> jaws, std::uint64_t now_ns) noexcept {
    if (now_ns < block_ns_ + kBlock_ns) return;
    close_block(now_ns);
    if (!weighing_) return;
    const auto fails = [&](tactiled_weight_state state) { now_ = {state, kNaN, kNaN, now_.lift_off_ns}; };
    if (carries_ <= 0) return fails(TACTILED_WEIGHT_NOT_OBSERVABLE);
    const auto begins_anew = [&](tactiled_weight_state state) {
        held_known_ = false;
        begun_ns_ = now_ns;
        fails(state);
    };
    if (refusal_ != TACTILED_WEIGHT_NONE) return begins_anew(refusal_);
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const Jaw& jaw = jaws_[j];
        if (jaw.carries_m_s2 <= 0) continue;
        if (jaw.blind || now_ns > jaw.t_ns + kBreak_ns) return begins_anew(TACTILED_WEIGHT_NOT_OBSERVABLE);
    }
    const std::uint64_t window_begin_ns = now_ns - std::min(now_ns, window_ns_);
    for (const Contact& jaw : jaws)
        if (!jaw.zero_sd_N().allFinite())
            return fails(TACTILED_WEIGHT_ESTIMATING);  // after a discontinuity, until the next free phase
    const Mean window = mean_since(std::max({window_begin_ns, begun_ns_, held_known_ ? rests_ns_ : 0}));
    if (window.n == 0) return;
    if (held_known_)
        publish_held(window, jaws, now_ns);
    else
        publish_first(window, jaws, now_ns);
}

// Publishes a weight between lift-off and the first stable value.
void Weight::publish_first(const Mean& window, std::span<const Contact> jaws, std::uint64_t now_ns) noexcept {
    const std::uint64_t lift_off_ns = lift_off(window.mass_kg);
    std::uint32_t late = 0;
    const std::uint64_t last_ns =
        last_lift_off(forces_since(now_ns - std::min(now_ns, window_ns_), jaws), lift_off_ns, late);
    // Without a reported acceleration, a steady value within the longest duration of an acceleration is no weight.
    const std::uint64_t from_ns = window.accelerations_known ? last_ns : last_ns + accelerates_ns_;
    std::uint64_t since_ns = std::max(from_ns, now_ns - std::min(now_ns, window_ns_));
    Mean mean = mean_since(since_ns);
    if (now_ns < from_ns - (last_ns - lift_off_ns) + window_ns_) late = 0;  // without this step there would be no weight yet
    const bool after = mean.n >= 4 && now_ns >= from_ns + window_ns_;
    bool newest_rests = false;
    if (after && (mean.sd_kg > kStill * std::abs(mean.mass_kg) || !flat(mean))) {
        const std::uint64_t newest_ns = now_ns - std::min(now_ns, std::uint64_t(kNewest * double(window_ns_)));
        const Mean newest = mean_since(newest_ns);
        newest_rests = !mean.accelerations_known && !again_ && now_ns < from_ns + window_ns_ + window_ns_ / 2 &&
                       newest.n >= kMinNewest && newest.sd_kg <= kStill * std::abs(newest.mass_kg) &&
                       part_is_flat(newest, kNewest);
        // with vibration or noise the mean is longer
        since_ns = newest_rests ? newest_ns : std::max(from_ns, now_ns - std::min(now_ns, kLongest_ns));
        mean = newest_rests ? newest : mean_since(since_ns);
    }
    if (!after) mean = window;
    const double unknown_m_s2 = mean.accelerations_known ? kReported * mean.max_acceleration_m_s2
                                : after                  ? 0
                                                         : max_acceleration_m_s2_ / std::sqrt(3.0);
    std::uint32_t across = 0;
    const double dragged_kg = off_axis_kg(jaws, mean.mass_kg, across);
    const double moving_kg =
        std::hypot(mean.sd_kg, mean.mass_kg * unknown_m_s2 / gravity_G_.norm(), after ? 0 : mean.trend_kg);
    const double fixed_kg = systematic_kg(mean.mass_kg, jaws);
    const Findings found =
        after ? examine(forces_since(since_ns, jaws), mean.mass_kg, std::hypot(moving_kg, fixed_kg), 0) : Findings{};
    const std::uint64_t excused_ns = std::max(accelerates_ns_ / 2, std::min(accelerates_ns_, kQuiet_ns));
    const std::uint64_t quiet_ns = now_ns - std::min(now_ns, kQuiet_ns);
    // A load that took long to rise from half to nine tenths of the mass was not lifted, but swings.
    const std::uint64_t half_ns = first_above(mean.mass_kg / 2),
                        lifted_ns = last_ns > half_ns + kSlowly_ns ? half_ns : last_ns;
    const double drifted_kg = after ? this->drifted_kg(jaws, std::max(quiet_ns, lifted_ns + excused_ns)) : 0;
    const double sd_kg =
        std::hypot(std::hypot(moving_kg, fixed_kg), std::hypot(std::max(0.0, dragged_kg), drifted_kg), found.sd_kg);
    const bool still = mean.blocks_sd_kg <= std::hypot(kShaken * mean.mass_kg, fixed_kg) &&
                       mean.sd_kg <= std::hypot(kStill * mean.mass_kg, fixed_kg / 2) &&
                       std::abs(mean.trend_kg) <= 2 * std::hypot(kStill * mean.mass_kg, fixed_kg / 2) &&
                       (mean.accelerations_known ||
                        ((newest_rests || flat(mean)) &&
                         !moved(window, again_ ? quiet_ns : std::max(quiet_ns, lifted_ns + excused_ns), now_ns)));
    const bool stable = after && dragged_kg <= 0 && sure(mean.mass_kg, sd_kg) && still && found.doubts == 0;
    now_ = {stable ? TACTILED_WEIGHT_STABLE : TACTILED_WEIGHT_ESTIMATING, mean.mass_kg - tare_kg_,
            std::isfinite(sd_kg) ? sd_kg : kNaN, lift_off_ns};
    if (!stable) {
        const bool dragged = after && dragged_kg > 0;
        now_.doubts = found.doubts | bit_if(dragged, TACTILED_DOUBT_ACROSS) | bit_if(after && !still, TACTILED_DOUBT_MOVES) |
                      bit_if(late != 0, TACTILED_DOUBT_LATE);
        now_.jaws = found.jaws | (dragged ? across : 0u) | late;
    }
    if (!stable) return;
    held_known_ = true;
    held_kg_ = mean.mass_kg;
    held_sd_kg_ = moving_kg;
    held_blocks_sd_kg_ = mean.blocks_sd_kg;
    rests_ns_ = since_ns;
    agreed_ns_ = balanced_ns_ = block_before_ns_ = now_ns;
    take_first(found);
}

// Returns the largest departure from the held value among the blocks of the newest 20 ms.
double Weight::newest_departs_kg() const noexcept {
    double max_kg = 0;
    for (std::size_t b = 0; b < n_ && block(b).t_ns + kGlance_ns > block(0).t_ns; ++b)
        max_kg = std::max(max_kg, std::abs(block(b).mass_kg - held_kg_));
    return max_kg;
}

// Publishes a weight after the first stable value. A deceleration of the arm is not another weight, unless it lasts longer
// than accelerations of arms do.
void Weight::publish_held(const Mean& window, std::span<const Contact> jaws, std::uint64_t now_ns) noexcept {
    const double systematic = systematic_kg(held_kg_, jaws), off_kg = window.mass_kg - held_kg_;
    const std::span<const JawForces> forces = forces_since(std::max(now_ns - std::min(now_ns, window_ns_), rests_ns_), jaws);
    const double held_sd_kg = std::hypot(systematic, held_sd_kg_);
    Findings found = examine(forces, held_kg_, held_sd_kg, 0);
    if ((found.doubts & TACTILED_DOUBT_BALANCE) == 0)
        balanced_ns_ = now_ns;
    else if (now_ns < balanced_ns_ + accelerates_ns_ + 2 * window_ns_)
        found = examine(forces, held_kg_, held_sd_kg, max_acceleration_m_s2_);
    const std::uint64_t excused_ns = std::max(accelerates_ns_ / 2, std::min(accelerates_ns_, kQuiet_ns));
    const double drifted_kg =
        this->drifted_kg(jaws, std::max(now_ns - std::min(now_ns, 2 * kQuiet_ns), now_.lift_off_ns + excused_ns));
    const double fixed_kg = std::hypot(systematic, found.sd_kg, drifted_kg);
    const double departs_kg = kDeparts * std::abs(held_kg_);
    // A change of the load within the window also adds scatter, which is limited so that it cannot hide the change.
    const double window_sd_kg = std::min(window.sd_kg, departs_kg);
    const double fixed_sd_kg = std::hypot(fixed_kg, std::max(held_sd_kg_, window_sd_kg));
    const bool stays = std::abs(off_kg) <= std::hypot(departs_kg, 3 * held_sd_kg_, 3 * window_sd_kg) &&
                       newest_departs_kg() <= std::hypot(3 * departs_kg, 3 * held_sd_kg_, 4 * held_blocks_sd_kg_);
    std::uint32_t across = 0;
    const bool agrees =
        stays && off_axis_kg(jaws, held_kg_, across) <= 0 && sure(held_kg_, fixed_sd_kg) && found.doubts == 0;
    // the first disagreement separates another load from a creeping jaw
    if (agreed_ns_ == block_before_ns_) changed_ = !stays;
    block_before_ns_ = now_ns;
    if (agrees) {
        take_first(found);
        held_kg_ += off_kg * std::min(1.0, double(kBlock_ns) * 1e-9 / kFollows_s);
        held_sd_kg_ = std::max(0.1 * kStill * std::abs(held_kg_), held_sd_kg_ * 0.999);
        agreed_ns_ = now_ns;
    } else if (now_ns > agreed_ns_ + accelerates_ns_ + 2 * window_ns_) {
        held_known_ = false;  // another object is weighed
        again_ = true;
        if (changed_ && first_.weighed) {
            unexplained_kg_ += std::abs(held_kg_ - first_.mass_kg);
            departed_kg_ = held_kg_;
            first_.weighed = false;
        }
        begun_ns_ = now_ns - std::min(now_ns, window_ns_);
    }
    const double sd_kg = std::hypot(fixed_sd_kg, agrees ? 0 : off_kg);
    now_ = {agrees ? TACTILED_WEIGHT_STABLE : TACTILED_WEIGHT_ESTIMATING, held_kg_ - tare_kg_,
            std::isfinite(sd_kg) ? sd_kg : kNaN, now_.lift_off_ns};
    if (agrees) return;
    now_.doubts = found.doubts | bit_if(across != 0, TACTILED_DOUBT_ACROSS) | bit_if(!stays, TACTILED_DOUBT_MOVES);
    now_.jaws = found.jaws | across;
}

}  // namespace tactiled::grasp
