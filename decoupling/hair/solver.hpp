// Computes loads from any hairs that determine them: weighted least squares, and leak terms subtracted by a
// fixed-point iteration, or by Newton's method if that iteration would take long.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "decoupling/hair/stages.hpp"

namespace tactiled {

// Response of each of H1 .. H4: r_i = gain_i . load + leak_i . leak_terms(load), all in dR/R0 at a load of 1 (full scale).
struct HairResponse {
    std::array<HairLoad, 4> gain{};
    std::array<LeakTerms, 4> leak{};
    std::array<double, 4> noise{1, 1, 1, 1};  // sd of dR/R0, for the weights; must be above 0
    HairLoad min{0, -1, -1}, max{1, 1, 1};    // range of the calibrated loads: beyond it, the leak is constant

    // Returns the load at which the leak is evaluated: `load`, or the nearest calibrated load (plus 5 %). rt: wait-free
    [[nodiscard]] HairLoad nearest(const HairLoad& load) const noexcept;
    // Returns the reading of hair i at a load. rt: wait-free
    [[nodiscard]] double reading(std::size_t i, const HairLoad& load, const LeakTerms& terms) const noexcept;
};

class HairSolver {
public:
    // `hairs`: bit i: hair i is wired; `unknowns`: bits of sigma, tau_x, tau_y; the others are 0. setup
    HairSolver(const HairResponse& response, std::uint32_t hairs, std::uint32_t unknowns);

    [[nodiscard]] bool solvable(std::uint32_t hairs) const noexcept { return subsets_[hairs].solvable; }
    // Returns the largest share of an error in the leak that remains after one step; the iteration needs less than
    // kSlowest.
    [[nodiscard]] double contraction(std::uint32_t hairs) const noexcept { return subsets_[hairs].contraction; }
    // Returns the sd of sigma, tau_x, tau_y by these hairs' noise, relative to full scale.
    [[nodiscard]] const HairLoad& noise_gain(std::uint32_t hairs) const noexcept { return subsets_[hairs].noise_gain; }
    // Returns the load that these (solvable) hairs measure. rt: bounded by kSteps
    [[nodiscard]] HairLoad solve(const std::array<double, 4>& r, std::uint32_t hairs) const noexcept;
    [[nodiscard]] const HairResponse& response() const noexcept { return response_; }

    // Up to kFixedPoint the fixed-point iteration is used: 0.5^40 is 1e-12. A leak of a few per cent has a
    // contraction of about 0.1 and ends after a dozen steps. Between kFixedPoint and kSlowest Newton's method is
    // used, which ends after three to six steps; the load is unique, and the derivative regular, as long as the
    // contraction is below 1.
    static constexpr double kFixedPoint = 0.5, kSlowest = 0.95;
    static constexpr int kSteps = 40;

private:
    struct Subset {
        std::array<std::array<double, 4>, 3> inverse{};  // maps readings to load; 0 if a hair is not in the subset
        HairLoad noise_gain{};
        double contraction = 0;
        bool solvable = false;
    };
    // Returns the load minus the load of the readings without the leak at that load: 0 at the solution. rt: wait-free
    HairLoad excess(const std::array<double, 4>& r, std::uint32_t hairs, const HairLoad& load) const noexcept;
    HairLoad solve_by_newton(const std::array<double, 4>& r, std::uint32_t hairs) const noexcept;
    Subset prepare(std::uint32_t hairs, std::uint32_t unknowns) const;

    HairResponse response_;
    bool leaks_ = false;
    std::array<Subset, 16> subsets_{};
};

}  // namespace tactiled
