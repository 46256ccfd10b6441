// What a known weight teaches: the scale of the shares, and what each jaw's press leaks into its shear.
#include <algorithm>
#include <cmath>

#include "decoupling/grasp/weight.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kKnownSure = 0.05;  // of a known weight: the scale cannot be set by noise
// Of what a jaw carries of the known weight: a leak that is known no better is none, for half of a slow lift may be in it;
constexpr double kLeakSure = 0.01;
// and with a larger one the known weight is none, for what was there before the lift may as well be a force.
constexpr double kLeakOfWeight = 0.05;
constexpr std::size_t kLeastBlocks = 8;  // two for each of the four quarters that say how a mean scatters
constexpr double kPressKept = 0.2;       // of the clamped press: with another one it is not the leak that was seen

}  // namespace

bool Weight::known(double mass_kg, std::span<const Closing> closings, std::span<const Contact> jaws) noexcept {
    if (mass_kg == 0) {
        forget_check(jaws);
        return true;
    }
    if (now_.state != TACTILED_WEIGHT_STABLE || !(mass_kg > 0) || !std::isfinite(mass_kg)) return false;
    if (tare_kg_ != 0) return false;  // a leak is in what was tared, too
    // The share's deviation is what it corrects; the rest would go into every weight from now on.
    if (now_.sd_kg > std::hypot(kKnownSure * now_.mass_kg, held_kg_ * share_sd())) return false;
    bool learnt = true;
    double leak_N = 0, leak_sd_N = 0, load_N = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        if (jaws_[j].carries_m_s2 <= 0) continue;
        const Leak& leak = closings[j].leak();
        const double carried_N = jaws_[j].carries_m_s2 * std::abs(held_kg_), press_N = jaws[j].feel().press_N;
        const double sd_N = std::hypot(leak.sd_N, shape_sd_N(leak, press_N));
        load_N += carried_N;
        leak_N += jaws_[j].axis_S.head<2>().dot(shear_at(leak, press_N));
        leak_sd_N += sd_N;
        learnt &= leak.press_N > 0 && sd_N <= kLeakSure * carried_N &&
                  std::abs(press_N - leak.press_N) <= kPressKept * leak.press_N;
    }
    if (std::abs(leak_N) - 2 * leak_sd_N > kLeakOfWeight * load_N) return false;
    std::array<Leak, kMostJaws> leaks{};
    for (std::size_t j = 0; j < n_jaws_ && learnt; ++j)
        if (jaws_[j].carries_m_s2 > 0) leaks[j] = closings[j].leak();
    // All that was weighed since it was stable says more than the window that is held.
    const Mean all = mean_since(steady_ns_);
    const bool longer = all.n >= kLeastBlocks && all.sd_kg < held_sd_kg_;
    const double factor = mass_kg / ((longer ? all.mass_kg : held_kg_) + shift_of(leaks, jaws));
    if (!(factor > 0.2 && factor < 5)) return false;  // a jaw that carries nothing, or everything: no share to correct
    if (longer) {
        held_kg_ = now_.mass_kg = all.mass_kg;
        held_sd_kg_ = all.sd_kg;
    }
    take_off(leaks, jaws);
    rescale(factor);
    checked_ = true;
    leaks_shown_ = learnt;
    checked_kg_ = mass_kg;
    // In every weight from now on: what moved in this one, and its zeros and the leak's shape at this press.
    check_sd_ =
        std::hypot(held_sd_kg_, scale_ / carries_ * std::sqrt(of_this_grasp_N2(jaws, 1)), mass_kg * tilt_ * kDown_rad) /
        mass_kg;
    return true;
}

void Weight::forget_check(std::span<const Contact> jaws) noexcept {
    take_off({}, jaws);
    rescale(1 / scale_);
    checked_ = leaks_shown_ = false;
    checked_kg_ = check_sd_ = 0;
}

void Weight::forget_leak(std::span<const Contact> jaws) noexcept { take_off({}, jaws); }

Check Weight::check() const noexcept {
    Check c;
    if (!checked_) return c;
    c.mass_kg = checked_kg_;
    c.scale = scale_;
    c.scale_sd = check_sd_ * scale_;
    for (std::size_t j = 0; j < n_jaws_; ++j) c.leak[j] = jaws_[j].leak;
    return c;
}

Weight::Leaks Weight::leaks() const noexcept {
    if (!leaks_shown_) return Leaks::none;
    bool all = carries_ > 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) all &= jaws_[j].carries_m_s2 <= 0 || jaws_[j].leak.press_N > 0;
    return all ? Leaks::known : Leaks::of_others;
}

// Mass is scale * (force - leak): with other leaks all that was weighed under the press of now is shifted by so much.
double Weight::shift_of(const std::array<Leak, kMostJaws>& leaks, std::span<const Contact> jaws) const noexcept {
    double less_N = 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        const double press_N = jaws[j].feel().press_N;
        less_N += jaws_[j].axis_S.head<2>().dot(shear_at(leaks[j], press_N) - shear_at(jaws_[j].leak, press_N));
    }
    return carries_ > 0 ? -scale_ / carries_ * less_N : 0;
}

void Weight::take_off(const std::array<Leak, kMostJaws>& leaks, std::span<const Contact> jaws) noexcept {
    const double by_kg = shift_of(leaks, jaws);
    held_kg_ += by_kg;
    now_.mass_kg += tare_kg_ != 0 ? 0 : by_kg;  // a tare has the same leak in it
    tare_kg_ += tare_kg_ != 0 ? by_kg : 0;
    for (Block& b : blocks_) b.mass_kg += by_kg;
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        Jaw& jaw = jaws_[j];
        const double press_N = jaws[j].feel().press_N;
        const double more_N = jaw.axis_S.head<2>().dot(shear_at(jaw.leak, press_N) - shear_at(leaks[j], press_N));
        jaw.last_N += more_N;  // of the block that is not closed yet, too
        jaw.sum_N += jaw.n * more_N;
        jaw.leak = leaks[j];
    }
}

void Weight::rescale(double factor) noexcept {
    scale_ *= factor;
    held_kg_ *= factor;
    held_sd_kg_ *= factor;
    held_blocks_sd_kg_ *= factor;
    tare_kg_ *= factor;
    now_.mass_kg *= factor;
    now_.sd_kg *= factor;
    for (Block& b : blocks_) b.mass_kg *= factor;
}

}  // namespace tactiled::grasp
