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
        std::array<double, kMostLoads> load{};
        std::uint32_t used = 0;  // bit k: gauge k; 0 = these gauges do not determine the loads
        // Root mean square of what the loads leave unexplained, a degree of freedom, in standard deviations of noise
        // and a gain error of 1 % together; NaN where there are no more gauges than loads.
        double residual = 0;
        bool dead = false;      // a gauge that delivers 0 although the others demand a reading was left out
        bool doubtful = false;  // gauges disagree, and which is wrong is not known
    };
    // `r` less its zero; `zero` of the gauges, to know a reading of 0. rt: wait-free
    [[nodiscard]] Solved solve(std::span<const double> r, std::span<const double> zero, std::uint32_t usable) const noexcept;

    // Standard deviation of load j with the gauges `used`, as a multiple of that with all. rt: wait-free
    [[nodiscard]] double sd_factor(std::size_t j, std::uint32_t used) const noexcept {
        return subsets_[used].sd[j] / subsets_.back().sd[j];
    }
    // Of load j under the stated noise alone, with all gauges. setup
    [[nodiscard]] double sd(std::size_t j) const noexcept { return subsets_.back().sd[j]; }
    [[nodiscard]] bool solvable(std::uint32_t usable) const noexcept { return subsets_[usable].solvable; }
    [[nodiscard]] double condition() const noexcept { return subsets_.back().condition; }
    // The loads that all gauges together cannot tell apart; empty where they can. setup
    [[nodiscard]] const std::vector<std::size_t>& confused() const noexcept { return confused_; }

private:
    struct Subset {
        std::array<std::array<double, kMostGauges>, kMostLoads> inverse{};  // loads x gauges; 0 where not used
        std::array<double, kMostLoads> sd{};                                // of the loads
        double condition = 0;
        bool solvable = false;
    };
    Subset prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const;
    std::array<double, kMostLoads> loads(const double* r, std::uint32_t usable) const noexcept;
    double predicted(std::size_t k, const std::array<double, kMostLoads>& load) const noexcept;
    double residual(const std::array<double, kMostLoads>& load, const double* r, std::uint32_t usable) const noexcept;

    std::size_t n_gauges_, n_loads_;
    std::array<std::array<double, kMostLoads>, kMostGauges> gains_{};
    std::array<double, kMostGauges> noise_{};
    std::vector<Subset> subsets_;  // index: bit k set where gauge k is usable
    std::vector<std::size_t> confused_;
};

}  // namespace tactiled
