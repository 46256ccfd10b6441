#include "decoupling/patch/doubts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tactiled {
namespace {

double pitch_of(const TaxelPlaces& places) { return double(std::max(places.pitch_m[0], places.pitch_m[1])); }

// Mean over a taxel whose middle is `taxels` beside that of a ball, whose contact has the half axis `a`, in taxels.
double mean_press(double taxels, double a) {
    constexpr int kParts = 24;
    double sum = 0;
    for (int m = 0; m < kParts; ++m)
        for (int n = 0; n < kParts; ++n) {
            const double x = taxels + (m + 0.5) / kParts - 0.5, y = (n + 0.5) / kParts - 0.5;
            sum += std::sqrt(std::max(0., 1 - (x * x + y * y) / (a * a)));
        }
    return sum;
}

}  // namespace

std::string fault_of_narrowest(const TaxelPlaces& places, double narrowest_m) {
    if (narrowest_m == 0 || narrowest_m >= 2 * pitch_of(places)) return "";
    return fmt::format("narrowest_contact_mm = {} is less than two pitches, {:.4g} mm; it may be 0 (any)", narrowest_m * 1e3,
                       pitch_of(places) * 2e3);
}

Doubts::Doubts(const TaxelPlaces& places, const TaxelNoise& noise, float z, double narrowest_m)
    : places_(places), noise_(noise), z2_(z * z), most_above_(0) {
    const double a = narrowest_m / 2 / pitch_of(places);
    if (narrowest_m > 0) most_above_ = float(mean_press(0, a) / mean_press(1, a));
}

float Doubts::contradiction(std::span<const float> press, std::span<const std::uint8_t> states,
                            std::size_t i) const noexcept {
    if (!has_force(states[i])) return 0;
    const TaxelPlaces::Neighbours& beside = places_.neighbours[i];
    const float p = press[i];
    float below = 0, largest = 0;
    std::size_t highest = i;
    for (std::size_t k = 0; k < beside.n_between; ++k) {
        const auto [a, b] = beside.between[k];
        const std::size_t lower = press[a] < press[b] ? a : b;
        const float least = press[lower], deficit = least - p;
        if (!(deficit > below) || !has_force(states[a]) || !has_force(states[b])) continue;
        if (deficit * deficit > z2_ * (variance(lower, least) + variance(i, p))) below = deficit;
    }
    if (below > 0 || most_above_ == 0 || beside.n < TaxelPlaces::kNeighbours) return -below;
    for (std::size_t k = 0; k < beside.n; ++k) {
        if (!has_force(states[beside.of[k]])) return 0;
        if (press[beside.of[k]] > largest) highest = beside.of[k], largest = press[highest];
    }
    const float above = p - most_above_ * largest;
    const bool is_above =
        above > 0 && above * above > z2_ * (variance(i, p) + most_above_ * most_above_ * variance(highest, largest));
    return is_above ? p - largest : 0;
}

}  // namespace tactiled
