// Loads from gauges that answer them linearly, r = G load: weighted least squares for any usable subset of at most eight
// gauges, all subsets prepared at set-up.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace tactiled {

inline constexpr std::size_t kMostGauges = 8, kMostLoads = 5;

class GaugeSolver {
public:
    // `gains`: a row a gauge, a column a load. `noise`: one standard deviation of each gauge. `inner`: bit k: gauge k is
    // one of R1 R3 R5 R7; a subset needs `inner_needed` of them. setup
    GaugeSolver(const std::vector<std::vector<double>>& gains, const std::vector<double>& noise, std::uint32_t inner,
                int inner_needed);

    struct Solved {
        alignas(16) double load[kMostLoads + 1]{};  // and 0: they are read in pairs
        std::uint32_t used = 0;                     // bit k: gauge k; 0 = these gauges do not determine the loads
        // Root mean square of what the loads leave unexplained, a degree of freedom, in standard deviations of noise
        // and a gain error of 1 % together; NaN where there are no more gauges than loads.
        double residual = 0;
        bool dead = false;      // a gauge that delivers 0 although the others demand a reading was left out
        bool doubtful = false;  // gauges disagree, and which is wrong is not known
    };
    // `r` less its zero, finite; kMostGauges of them may be read. `zero` of the
    // gauges, to know a reading of 0. rt: wait-free
    [[nodiscard]] Solved solve(const double* r, std::span<const double> zero, std::uint32_t usable) const noexcept;

    // Standard deviation of each load with the gauges `used`, as a multiple of that with all; kMostLoads + 1 of them.
    // rt: wait-free
    [[nodiscard]] const double* sd_factors(std::uint32_t used) const noexcept { return subsets_[used].sd_factor; }
    [[nodiscard]] double sd_factor(std::size_t j, std::uint32_t used) const noexcept { return sd_factors(used)[j]; }
    // Of load j under the stated noise alone, with all gauges. setup
    [[nodiscard]] double sd(std::size_t j) const noexcept { return subsets_.back().sd[j]; }
    [[nodiscard]] bool solvable(std::uint32_t usable) const noexcept { return subsets_[usable].solvable; }
    [[nodiscard]] double condition() const noexcept { return subsets_.back().condition; }
    // The loads that all gauges together cannot tell apart; empty where they can. setup
    [[nodiscard]] const std::vector<std::size_t>& confused() const noexcept { return confused_; }

private:
    using Loads = double[kMostLoads + 1];
    using Gauges = double[kMostGauges];
    struct alignas(16) Subset {
        double inverse[kMostGauges][kMostLoads + 1]{};  // 0 where not used
        Gauges used{};                                  // 1 or 0
        Gauges free{};                          // the part of a gauge's prediction that is not made of its own reading
        double per_gauge = 0, per_freedom = 0;  // 1 / gauges, 1 / (gauges - loads)
        Loads sd_factor{};
        std::array<double, kMostLoads> sd{};  // of the loads
        double condition = 0;
        bool solvable = false, can_disagree = false;  // there are more gauges than loads
    };
    Subset prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const;
    Solved without_dead(const double* r, std::span<const double> zero, std::uint32_t usable,
                        const Solved& all) const noexcept;
    void find(const Subset& subset, const double* r, Solved& solved) const noexcept;
    template <std::size_t kLoads>  // so many at most
    void find(const Subset& subset, const double* r, Solved& solved) const noexcept;

    std::size_t n_gauges_, n_loads_;
    alignas(16) double gains_[kMostLoads][kMostGauges]{};  // a row a load; 0 where there is no gauge
    alignas(16) Gauges noise2_{};                          // squared; 1 where there is no gauge
    bool same_noise_ = true;
    std::vector<Subset> subsets_;  // index: bit k set where gauge k is usable
    std::vector<std::size_t> confused_;
};

}  // namespace tactiled
