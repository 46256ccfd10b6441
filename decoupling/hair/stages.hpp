// The steps of the hair sensor of Cao et al., each a separate function. Hair i is at the azimuth of 0, 90, 180, 270
// degrees (H1 .. H4), so a pair is H1 H3 along x, H2 H4 along y. r = dR/R0 of a hair minus its zero.
//
//     r_i = D_sigma sigma - D_tau tau cos(alpha - alpha_i)      (their eq. 14, with the signs of their text)
//
// sigma: normal stress, positive under a press; tau_x, tau_y: shear stress that the environment exerts, frame S; all
// in Pa.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

namespace tactiled {

// Returns 0 .. 3 for "H1" .. "H4", 4 for an unknown name.
constexpr std::size_t hair_index(std::string_view name) noexcept {
    return name.size() == 2 && name[0] == 'H' && name[1] >= '1' && name[1] <= '4' ? std::size_t(name[1] - '1') : 4;
}

// An unloaded hair, which shows the temperature of the others: decoupling/temperature.hpp.
inline constexpr std::string_view kHairDummy = "H0";

// cos and sin of the azimuth of hair i: the shares of tau_x and tau_y that lower its resistance.
inline constexpr std::array<double, 4> kHairCos{1, 0, -1, 0}, kHairSin{0, 1, 0, -1};

// Step 1 of Cao et al.: DIFF = r_far - r_near = S_d tau, with H1 (H2) near and H3 (H4) far. S_d in 1/Pa is that of the pair,
// twice that of a hair. The difference is taken first: 0.5 Pa of shear under 2 kPa is 4e-7 in readings of 7e-4.
constexpr double shear_from_diff_Pa(double r_near, double r_far, double diff_per_Pa) noexcept {
    return (r_far - r_near) / diff_per_Pa;
}

// sigma, tau_x, tau_y, each relative to its full scale.
using HairLoad = std::array<double, 3>;

// The terms of second and third order: exponents of sigma, tau_x, tau_y. The last seven have no sigma.
inline constexpr std::size_t kLeakTerms = 16, kInterceptTerms = 7;
inline constexpr std::array<std::array<int, 3>, kLeakTerms> kLeakExponents{{{2, 0, 0},
                                                                            {1, 1, 0},
                                                                            {1, 0, 1},
                                                                            {3, 0, 0},
                                                                            {2, 1, 0},
                                                                            {2, 0, 1},
                                                                            {1, 2, 0},
                                                                            {1, 1, 1},
                                                                            {1, 0, 2},
                                                                            {0, 2, 0},
                                                                            {0, 1, 1},
                                                                            {0, 0, 2},
                                                                            {0, 3, 0},
                                                                            {0, 2, 1},
                                                                            {0, 1, 2},
                                                                            {0, 0, 3}}};
using LeakTerms = std::array<double, kLeakTerms>;

// Returns the products of kLeakExponents at a load. rt: wait-free
constexpr LeakTerms leak_terms(const HairLoad& load) noexcept {
    const auto [s, x, y] = load;
    const double ss = s * s, xx = x * x, xy = x * y, yy = y * y;
    return {ss, s * x, s * y, ss * s, ss * x, ss * y, s * xx, s * xy, s * yy, xx, xy, yy, xx * x, xx * y, x * yy, yy * y};
}

// Returns their derivatives by sigma, tau_x or tau_y (axis 0, 1, 2). rt: wait-free
constexpr LeakTerms leak_slopes(const HairLoad& load, std::size_t axis) noexcept {
    LeakTerms slopes{};
    for (std::size_t i = 0; i < kLeakTerms; ++i) {
        double product = kLeakExponents[i][axis];
        for (std::size_t j = 0; j < 3; ++j)
            for (int n = kLeakExponents[i][j] - (j == axis ? 1 : 0); n > 0; --n) product *= load[j];
        slopes[i] = product;
    }
    return slopes;
}

constexpr double leak(const LeakTerms& coefficient, const LeakTerms& terms) noexcept {
    double sum = 0;
    for (std::size_t i = 0; i < kLeakTerms; ++i) sum += coefficient[i] * terms[i];
    return sum;
}

// Step 2: g(tau), the contribution of shear alone to SUM (their "initial value of SUM"; they print no formula):
// linear if the hairs differ, plus the terms without sigma. `gain_x`, `gain_y`: of SUM in 1/Pa; `coefficient` in
// dR/R0 at full scale.
constexpr double intercept_of_sum(double tau_x_Pa, double tau_y_Pa, double gain_x, double gain_y,
                                  const LeakTerms& coefficient, const LeakTerms& terms) noexcept {
    double sum = gain_x * tau_x_Pa + gain_y * tau_y_Pa;
    for (std::size_t i = kLeakTerms - kInterceptTerms; i < kLeakTerms; ++i) sum += coefficient[i] * terms[i];
    return sum;
}

// Step 3: SUM = S_s sigma + g(tau). S_s in 1/Pa is the sum over all hairs in SUM.
constexpr double normal_from_sum_Pa(double sum, double intercept, double sum_per_Pa) noexcept {
    return (sum - intercept) / sum_per_Pa;
}

}  // namespace tactiled
