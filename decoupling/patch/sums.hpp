// The wrench of an array: the sum of its taxels' forces and of their moments about the origin of S, with its standard
// deviation.
//
//     var F = n sd^2 + sum (g f)^2 + ...,    M = sum r x f,    var M likewise with the arms r
//
// with the noise sd of a taxel and the sd g of each gain, which are its own; what all taxels of a calibration have in common
// is in `sd` and `sd_slope` of the calibration. Taxels with models state their sd: with a calibration of each, var F is the
// sum of their variances; with one for all, whose errors may be the same everywhere, sd F is the sum of their sd.
#pragma once
#include <array>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/patch/taxel_law.hpp"

namespace tactiled {

// A taxel without a force of its own.
struct TaxelOut {
    std::uint16_t taxel = 0;
    bool is_supported = false;        // at least half of its neighbours have forces
    std::array<float, 3> variance{};  // variance of the predicted force, N^2
};

// The sd of a taxel's force without a load, N in its components, and the relative sd of the gain of each.
struct TaxelNoise {
    std::array<float, 3> sd{};
    std::vector<float> gain;
    [[nodiscard]] TaxelNoise times(float factor) const {
        TaxelNoise noise = *this;
        for (float& component : noise.sd) component *= factor;
        return noise;
    }
};

// Gives each taxel in `out` the mean force of its neighbours, in `forces`, and the error that the same prediction has at
// these neighbours in this frame. `zero` is subtracted from all forces first, and added again.
// rt: wait-free
void predict(const TaxelPlaces& places, const TaxelNoise& noise, const TaxelForces& zero, TaxelForces& forces,
             std::vector<TaxelOut>& out) noexcept;

class Sums {
public:
    // Keeps references. setup
    Sums(const TaxelPlaces& places, const TaxelNoise& noise, bool is_common);
    // Sums all forces, which are finite. rt: wait-free
    void add(const TaxelForces& forces, const std::vector<TaxelOut>& out) noexcept;
    [[nodiscard]] const Wrench& wrench() const noexcept { return wrench_; }
    [[nodiscard]] const Wrench& variance() const noexcept { return variance_; }
    [[nodiscard]] const Wrench& variance_at_rest() const noexcept { return of_noise_; }

private:
    void add_gains(const std::array<const float*, 3>& force) noexcept;
    void add_stated(const TaxelForces& forces) noexcept;

    const TaxelPlaces& places_;
    TaxelNoise noise_;
    bool is_common_;
    std::vector<float> none_;                // a component that is not measured
    std::array<std::vector<float>, 3> arm_;  // r g
    Wrench of_noise_{};                      // variance without a load
    Wrench wrench_{}, variance_{};
};

}  // namespace tactiled
