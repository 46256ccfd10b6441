// Loads from gauges that answer them linearly, r = G load: weighted least squares for any usable subset of at most eight
// gauges, all subsets prepared at set-up.
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
    // `gains`: a row a gauge, a column a load. `noise`: one standard deviation of each gauge; `zero`: what it reads at rest.
    // `inner`: bit k: gauge k is one of R1 R3 R5 R7; a subset needs `inner_needed` of them. setup
    GaugeSolver(const std::vector<std::vector<double>>& gains, const std::vector<double>& noise,
                const std::vector<double>& zero, std::uint32_t inner, int inner_needed);

    struct Solved {
        double load[kMaxLoads]{};
        std::uint32_t used = 0;  // bit k: gauge k; 0 = these gauges do not determine the loads
        // Root mean square of what the loads leave unexplained, a degree of freedom, in standard deviations of noise
        // and a gain error of 1 % together; NaN where there are no more gauges than loads.
        double residual = 0;
        // Standard deviation of each load, as a multiple of that with all gauges.
        const double* sd_factor = nullptr;
        bool dead = false;      // a gauge that delivers 0 although the others demand a reading was left out
        bool doubtful = false;  // gauges disagree, and which is wrong is not known
    };
    // From kMaxGauges readings, less their zeros, finite, 0 where not usable. rt: wait-free
    [[nodiscard]] Solved solve(const double* readings, std::uint32_t usable) const noexcept;

    // The sd of load j under the stated noise alone, with all gauges. setup
    [[nodiscard]] double sd(std::size_t j) const noexcept { return subsets_.back().sd[j]; }
    [[nodiscard]] bool solvable(std::uint32_t usable) const noexcept { return subsets_[usable].solvable; }
    [[nodiscard]] double condition() const noexcept { return subsets_.back().condition; }
    // The loads that all gauges together cannot tell apart; empty where they can. setup
    [[nodiscard]] const std::vector<std::size_t>& confused() const noexcept { return confused_; }

private:
    // A number for each gauge, 0 where there is none. Arithmetic is element by element: g++ and clang++ make vector
    // instructions of it on every processor that has them, at every optimisation level.
    using Gauges __attribute__((vector_size(kMaxGauges * sizeof(double)), aligned(16))) = double;
    static double sum_of(const Gauges& a) noexcept;

    struct Subset {
        Gauges inverse[kMaxLoads]{};  // a row a load; 0 where not used
        Gauges gains[kMaxLoads]{};    // likewise
        double sd_factor[kMaxLoads]{};
        double gain_error2_per_read2 = 0, per_freedom = 0;  // kGainError^2 / gauges, 1 / (gauges - loads)
        bool solvable = false, can_disagree = false;        // there are more gauges than loads
        double free[kMaxGauges]{};  // the part of a gauge's prediction that is not made of its own reading
        double sd[kMaxLoads]{};     // of the loads
        double condition = 0;
    };
    Subset prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const;
    void find(const Subset& subset, const Gauges& r, Solved& solved) const noexcept;
    Solved without_dead(const Gauges& r, std::uint32_t usable, const Solved& all) const noexcept;

    Gauges noise2_{};  // squared; 1 where there is no gauge
    bool same_noise_ = true;
    std::vector<Subset> subsets_;  // index: bit k set where gauge k is usable
    std::size_t n_gauges_, n_loads_;
    std::vector<double> zero_;
    Gauges gains_[kMaxLoads]{};  // a row a load
    std::vector<std::size_t> confused_;
};

}  // namespace tactiled
