// The centre of pressure: the place on the plane z = 0 of frame S at which a force without a torque of its own has the
// moments of the wrench.
//
//     x = -my / fz,    y = mx / fz
//     fz^2 var x = var my + 2 x cov(fz, my) + x^2 var fz,    fz^2 var y = var mx - 2 y cov(fz, mx) + y^2 var fz
//
// A place is a ratio of two random numbers, and its error is not normal. The error of my + x fz is, for the true x, so that
// |my + x fz| <= z sd(my + x fz) holds with the probability of z standard deviations (Fieller 1954). The x that fulfil it
// lie in an interval only if |fz| > z sd(fz); below, the interval has no ends, and z sd of the place is no statement. Errors
// beyond 5 sd are this project's measure of a wrong value, so that a place is stated for a press above 5 sd. There, the sd
// above differs by at most 4 % (1 / 5^2) from half of Fieller's interval for z = 1, the bias is at most a fifth of the sd,
// and noise alone shows a place once in three million samples.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "decoupling/decoupler.hpp"

namespace tactiled {

inline constexpr double kPlace_sd = 5;

struct PressPlace {
    std::array<double, 2> cop_S_m{kNaN, kNaN};
    std::array<double, 2> sd_m{kNaN, kNaN};  // one standard deviation
};

// Returns the centre of pressure of a wrench. A coordinate is NaN if its moment is not measured; both are if the press is
// not above kPlace_sd standard deviations, or these are unknown. `covariance`: of the errors of fz with those of mx and of
// my, N Nm. rt: wait-free
[[nodiscard]] inline PressPlace place_of(const Wrench& wrench_S, const Wrench& sd,
                                         const std::array<double, 2>& covariance) noexcept {
    PressPlace place;
    const double fz = wrench_S[2];
    if (!(-fz > kPlace_sd * sd[2])) return place;
    for (std::size_t i = 0; i < 2; ++i) {
        const std::size_t moment = 4 - i;         // my gives x, mx gives y
        const double sign = i == 0 ? -1.0 : 1.0;  // mx = y fz, my = -x fz
        if (std::isnan(wrench_S[moment])) continue;
        const double at_m = sign * wrench_S[moment] / fz, of_force = at_m * sd[2];
        if (!(std::abs(at_m) <= std::numeric_limits<double>::max())) continue;
        const double squared = sd[moment] * sd[moment] - 2 * sign * at_m * covariance[1 - i] + of_force * of_force;
        place.cop_S_m[i] = at_m;
        place.sd_m[i] = std::sqrt(std::max(squared, 0.0)) / -fz;
    }
    return place;
}

// Returns the covariances of fz with mx and with my. rt: wait-free
[[nodiscard]] inline std::array<double, 2> covariance_of(const Correlations& correlations, const Wrench& sd) noexcept {
    const auto of = [&](std::size_t moment) {
        return double(correlations.between[Correlations::index(2, moment)]) * sd[2] * sd[moment];
    };
    return {of(3), of(4)};
}

// Returns the place that a model has found by itself with its `sd_of_model` of the wrench, for the published wrench and sd:
// none below the same limit, and with what zero, delay and filter add to the sd of the moments about that place.
// rt: wait-free
[[nodiscard]] inline PressPlace published(PressPlace place, const Wrench& wrench_S, const Wrench& sd,
                                          const Wrench& sd_of_model) noexcept {
    if (!(-wrench_S[2] > kPlace_sd * sd[2])) return {};
    const auto added = [&](std::size_t c) { return std::max(sd[c] * sd[c] - sd_of_model[c] * sd_of_model[c], 0.0); };
    for (std::size_t i = 0; i < 2; ++i) {
        const double x = place.cop_S_m[i], more = (added(4 - i) + x * x * added(2)) / (wrench_S[2] * wrench_S[2]);
        if (more > 0) place.sd_m[i] = std::sqrt(place.sd_m[i] * place.sd_m[i] + more);
    }
    return place;
}

}  // namespace tactiled
