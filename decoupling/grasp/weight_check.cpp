// What a known weight teaches: the scale of the shares, and what each jaw's press leaks into its shear.
#include <algorithm>
#include <cmath>

#include "decoupling/grasp/weight.hpp"

namespace tactiled::grasp {
namespace {

constexpr double kKnownSure = 0.05;  // of a known weight: the scale cannot be set by noise

}  // namespace

bool Weight::known(double mass_kg, std::span<const Closing> closings, std::span<const Contact> jaws) noexcept {
    if (mass_kg == 0) {
        forget_check();
        return true;
    }
    if (now_.state != TACTILED_WEIGHT_STABLE || !(mass_kg > 0) || !std::isfinite(mass_kg)) return false;
    // The share's deviation is what it corrects; the rest would go into every weight from now on.
    if (now_.sd_kg > std::hypot(kKnownSure * now_.mass_kg, held_kg_ * share_sd())) return false;
    bool shown = true;
    for (std::size_t j = 0; j < n_jaws_; ++j) shown &= jaws_[j].carries_m_s2 <= 0 || closings[j].leak().press_N > 0;
    const auto leak_of = [&](std::size_t j) { return shown && jaws_[j].carries_m_s2 > 0 ? closings[j].leak() : Leak{}; };
    double leak_kg = 0;  // of what is held now, beyond what is taken off already
    for (std::size_t j = 0; j < n_jaws_; ++j) {
        if (jaws_[j].carries_m_s2 <= 0) continue;
        const double press_N = jaws[j].feel().press_N;
        const Eigen::Vector2d more_N = shear_at(leak_of(j), press_N) - shear_at(jaws_[j].leak, press_N);
        leak_kg += scale_ / carries_ * jaws_[j].axis_S.head<2>().dot(more_N);
    }
    const double factor = mass_kg / (now_.mass_kg - leak_kg);
    if (!(factor > 0.2 && factor < 5)) return false;  // a jaw that carries nothing, or everything: no share to correct
    for (std::size_t j = 0; j < n_jaws_; ++j) jaws_[j].leak = leak_of(j);
    shift(-leak_kg);
    rescale(factor);
    checked_ = true;
    checked_kg_ = mass_kg;
    check_ns_ = block_ns_;
    check_age_s_ = 0;
    return true;
}

// What hangs at this moment is told as before until the next block.
void Weight::forget_check() noexcept {
    rescale(1 / scale_);
    checked_ = false;
    checked_kg_ = 0;
    forget_leak();
}

void Weight::forget_leak() noexcept {
    for (Jaw& jaw : jaws_) jaw.leak = {};
}

double Weight::check_age_s() const noexcept {
    return check_age_s_ + double(block_ns_ - std::min(check_ns_, block_ns_)) * 1e-9;
}

Check Weight::check() const noexcept {
    Check c;
    if (!checked_) return c;
    c.mass_kg = checked_kg_;
    c.scale = scale_;
    c.age_s = check_age_s();
    for (std::size_t j = 0; j < n_jaws_; ++j) c.leak[j] = jaws_[j].leak;
    return c;
}

void Weight::restore(const Check& check) noexcept {
    forget_check();
    if (!(check.mass_kg > 0)) return;
    rescale(check.scale);
    checked_ = true;
    checked_kg_ = check.mass_kg;
    check_ns_ = 0;
    check_age_s_ = check.age_s;
    for (std::size_t j = 0; j < n_jaws_; ++j) jaws_[j].leak = check.leak[j];
}

// Of each jaw that carries as the hand is turned now.
bool Weight::leaks_known() const noexcept {
    bool known = carries_ > 0;
    for (std::size_t j = 0; j < n_jaws_; ++j) known &= jaws_[j].carries_m_s2 <= 0 || jaws_[j].leak.press_N > 0;
    return known;
}

// Mass is scale * (force - leak): a leak less is a shift of all that was weighed under the press of now.
void Weight::shift(double by_kg) noexcept {
    held_kg_ += by_kg;
    now_.mass_kg += by_kg;
    for (Block& b : blocks_) b.mass_kg += by_kg;
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
