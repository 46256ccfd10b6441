// Computes loads from gauges with a linear response, r = G load: weighted least squares for any usable subset of at
// most eight gauges, with all subsets prepared at set-up.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "decoupling/solve/consistency.hpp"

namespace tactiled {

inline constexpr std::size_t kMaxGauges = 8, kMaxLoads = 5;

class GaugeSolver {
public:
    // `gains`: one row per gauge, one column per load. `noise`: one standard deviation of each gauge; `zero`: its
    // reading at rest. `inner`: bit k: gauge k is one of R1 R3 R5 R7; a subset needs `inner_needed` of them. setup
    GaugeSolver(const std::vector<std::vector<double>>& gains, const std::vector<double>& noise,
                const std::vector<double>& zero, std::uint32_t inner, int inner_needed);

    struct Solved {
        double load[kMaxLoads]{};
        std::uint32_t used = 0;  // bit k: gauge k; 0 = these gauges do not determine the loads
        // Root mean square of the residual, per degree of freedom, in standard deviations of noise and a gain error
        // of 1 % together; NaN if there are no more gauges than loads.
        double residual = 0;
        // Standard deviation of each load, as a multiple of that with all gauges.
        const double* sd_factor = nullptr;
        bool dead = false;      // a gauge that delivers 0 although the others require another reading was left out
        bool doubtful = false;  // gauges disagree, and the wrong one is unknown
    };
    // Solves from kMaxGauges readings minus their zeros, finite, 0 if not usable. rt: wait-free
    [[nodiscard]] Solved solve(const double* readings, std::uint32_t usable) const noexcept;

    // Returns the sd of load j under the stated noise alone, with all gauges. setup
    [[nodiscard]] double sd(std::size_t j) const noexcept { return subsets_.back().sd[j]; }
    [[nodiscard]] bool solvable(std::uint32_t usable) const noexcept { return subsets_[usable].solvable; }
    [[nodiscard]] double condition() const noexcept { return subsets_.back().condition; }
    // Returns the loads that all gauges together cannot separate; empty if they can. setup
    [[nodiscard]] const std::vector<std::size_t>& confused() const noexcept { return confused_; }

private:
    // One number per gauge, 0 if there is none. Arithmetic is element by element: g++ and clang++ use vector
    // instructions for it on every processor that has them, at every optimisation level.
    using Gauges __attribute__((vector_size(kMaxGauges * sizeof(double)), aligned(16))) = double;
    static double sum_of(const Gauges& a) noexcept;

    struct Subset {
        Gauges inverse[kMaxLoads]{};  // one row per load; 0 if not used
        Gauges gains[kMaxLoads]{};    // one row per load; 0 if not used
        double sd_factor[kMaxLoads]{};
        double gain_error2_per_read2 = 0, per_freedom = 0;  // kGainError^2 / gauges, 1 / (gauges - loads)
        bool solvable = false, can_disagree = false;        // can_disagree: there are more gauges than loads
        double free[kMaxGauges]{};  // the share of a gauge's prediction that is not from its own reading
        double sd[kMaxLoads]{};     // standard deviations of the loads
        double condition = 0;
    };
    Subset prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const;
    void find(const Subset& subset, const Gauges& r, Solved& solved) const noexcept;
    Solved without_dead(const Gauges& r, std::uint32_t usable, const Solved& all) const noexcept;

    Gauges noise2_{};  // squared; 1 if there is no gauge
    bool same_noise_ = true;
    std::vector<Subset> subsets_;  // index: bit k is set if gauge k is usable
    std::size_t n_gauges_, n_loads_;
    std::vector<double> zero_;
    Gauges gains_[kMaxLoads]{};  // one row per load
    std::vector<std::size_t> confused_;
};

}  // namespace tactiled
