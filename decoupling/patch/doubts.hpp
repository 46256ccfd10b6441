// Taxels whose press contradicts that of their neighbours: weak, stuck, exchanged or shifted ones, which nobody declared.
//
// The press of one body is log-concave: that of a punch, of an edge and of Hertz, and its mean over a taxel as well (the
// product of two such functions, summed over a convex set, is one). Along a line of taxels none is then below both
// of those beside it: there is no valley. A ring, or two bodies that are one taxel apart, do have one.
//
// Upwards there is a limit only if the calibration states the narrowest contact, 2 a. The largest share of one taxel is then
// that of a ball with the half axis a over its middle, whose mean press exceeds that over the next taxel by the ratio
// `most_above`; without a statement a press on one taxel alone may be a needle.
//
// A contradiction counts where it exceeds z sd of the taxels that are compared, z as for the contact: contact.hpp.
#pragma once
#include <span>
#include <string>

#include "decoupling/patch/sums.hpp"

namespace tactiled {

class Doubts {
public:
    // `z`: sd that noise alone exceeds in 1 of 100 frames. `narrowest_m`: 0 = any. setup
    Doubts(const TaxelPlaces& places, const TaxelNoise& noise, float z, double narrowest_m);

    // Returns by how much the press of taxel i, N, is above (positive) or below what its neighbours allow; 0 = not. Taxels
    // without a force of their own prove nothing. rt: wait-free
    [[nodiscard]] float contradiction(std::span<const float> press, std::span<const std::uint8_t> states,
                                      std::size_t i) const noexcept;

private:
    // Variance of the force of taxel i under this press, N^2.
    [[nodiscard]] float variance(std::size_t i, float press) const noexcept {
        const float of_gain = noise_.gain[i] * press;
        return noise_.sd[2] * noise_.sd[2] + of_gain * of_gain;
    }

    const TaxelPlaces& places_;
    TaxelNoise noise_;
    float z2_, most_above_;  // 0 = any
};

inline constexpr std::array<Parameter, 1> kDoubtParameters{
    {{"narrowest_contact_mm", "least width of a contact, 2 pitches or more; 0 = any", 0, 1e3, 0}}};

// Returns what is wrong with the parameter, or "". setup
std::string fault_of_narrowest(const TaxelPlaces& places, double narrowest_m);

}  // namespace tactiled
