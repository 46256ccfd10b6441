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
#include "decoupling/solve/pairs.hpp"

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
        bool dead = false;      // a gauge that delivers 0 although the others demand a reading was left out
        bool doubtful = false;  // gauges disagree, and which is wrong is not known
    };
    // Of kMaxGauges readings, less their zeros, finite, 0 where not usable; `kLoads` as in the constructor or more.
    // rt: wait-free
    template <std::size_t kLoads = kMaxLoads>
    [[nodiscard]] Solved solve(const double* r, std::uint32_t usable) const noexcept;
    // Its two halves: where the gauges agree, which nearly all readings do, else used = 0; and for the others. rt: wait-free
    template <std::size_t kLoads = kMaxLoads>
    [[nodiscard]] Solved solve_agreeing(const double* r, std::uint32_t usable) const noexcept;
    [[nodiscard]] Solved solve_disagreeing(const double* r, std::uint32_t usable) const noexcept;

    // Standard deviation of each load with the gauges `used`, as a multiple of that with all; kMaxLoads + 1 of them.
    // rt: wait-free
    [[nodiscard]] const double* sd_factors(std::uint32_t used) const noexcept { return subsets_.data()[used].sd_factor; }
    [[nodiscard]] double sd_factor(std::size_t j, std::uint32_t used) const noexcept { return sd_factors(used)[j]; }
    // Of load j under the stated noise alone, with all gauges. setup
    [[nodiscard]] double sd(std::size_t j) const noexcept { return subsets_.back().sd[j]; }
    [[nodiscard]] bool solvable(std::uint32_t usable) const noexcept { return subsets_[usable].solvable; }
    [[nodiscard]] double condition() const noexcept { return subsets_.back().condition; }
    // The loads that all gauges together cannot tell apart; empty where they can. setup
    [[nodiscard]] const std::vector<std::size_t>& confused() const noexcept { return confused_; }

private:
    static constexpr std::size_t kPairs = kMaxGauges / 2;
    using Gauges = Pair[kPairs];
    struct Subset {
        Gauges inverse[kMaxLoads]{};  // a row a load; 0 where not used
        Gauges gains[kMaxLoads]{};    // likewise
        alignas(16) double sd_factor[kMaxLoads + 1]{};
        double gain_error2_per_read2 = 0, per_freedom = 0;  // kGainError^2 / gauges, 1 / (gauges - loads)
        bool solvable = false, can_disagree = false;        // there are more gauges than loads
        double free[kMaxGauges]{};  // the part of a gauge's prediction that is not made of its own reading
        double sd[kMaxLoads]{};     // of the loads
        double condition = 0;
    };
    Subset prepare(std::uint32_t usable, std::vector<std::size_t>* confused) const;
    void find_any(const Subset& subset, const double* r, Solved& solved) const noexcept;
    Solved without_dead(const double* r, std::uint32_t usable, const Solved& all) const noexcept;
    template <std::size_t kLoads>
    void find(const Subset& subset, const double* r, Solved& solved) const noexcept;

    Gauges noise2_{};  // squared; 1 where there is no gauge
    bool same_noise_ = true;
    std::vector<Subset> subsets_;  // index: bit k set where gauge k is usable
    std::size_t n_gauges_, n_loads_;
    std::vector<double> zero_;
    double gains_[kMaxLoads][kMaxGauges]{};  // a row a load; 0 where there is no gauge
    std::vector<std::size_t> confused_;
};

// The loads and what they leave unexplained, two gauges at a time.
template <std::size_t kLoads>
inline void GaugeSolver::find(const Subset& subset, const double* r, Solved& solved) const noexcept {
    const Pair read[kPairs] = {load(r), load(r + 2), load(r + 4), load(r + 6)};
    const auto sum_of = [](Pair a, Pair b, Pair c, Pair d) {
        const Pair sum = (a + b) + (c + d);
        return sum[0] + sum[1];
    };
#pragma GCC unroll 5
    for (std::size_t j = 0; j < kLoads; ++j) {
        const Gauges& row = subset.inverse[j];
        solved.load[j] = sum_of(row[0] * read[0], row[1] * read[1], row[2] * read[2], row[3] * read[3]);
    }
    if (!subset.can_disagree) [[unlikely]] {
        solved.residual = std::numeric_limits<double>::quiet_NaN();
        return;
    }
    Pair rest[kPairs] = {read[0], read[1], read[2], read[3]};
#pragma GCC unroll 5
    for (std::size_t j = 0; j < kLoads; ++j)
#pragma GCC unroll 4
        for (std::size_t k = 0; k < kPairs; ++k) rest[k] -= subset.gains[j][k] * both(solved.load[j]);
    const double read2 = sum_of(read[0] * read[0], read[1] * read[1], read[2] * read[2], read[3] * read[3]);
    const double gain_error2 = subset.gain_error2_per_read2 * read2;
#pragma GCC unroll 4
    for (std::size_t k = 0; k < kPairs; ++k) rest[k] *= rest[k];
    double unexplained;
    if (same_noise_) [[likely]] {
        unexplained = sum_of(rest[0], rest[1], rest[2], rest[3]) / (noise2_[0][0] + gain_error2);
    } else {
#pragma GCC unroll 4
        for (std::size_t k = 0; k < kPairs; ++k) rest[k] /= noise2_[k] + both(gain_error2);
        unexplained = sum_of(rest[0], rest[1], rest[2], rest[3]);
    }
    solved.residual = std::sqrt(unexplained * subset.per_freedom);
    // Readings of 1e154 and more overflow: doubtful, not undecided.
    if (!(gain_error2 + unexplained <= std::numeric_limits<double>::max())) [[unlikely]]
        solved.residual = std::numeric_limits<double>::infinity();
}

template <std::size_t kLoads>
inline GaugeSolver::Solved GaugeSolver::solve_agreeing(const double* r, std::uint32_t usable) const noexcept {
    Solved solved;
    const Subset& subset = subsets_.data()[usable];
    if (!subset.solvable) [[unlikely]]
        return solved;
    find<kLoads>(subset, r, solved);
    solved.used = solved.residual > kDoubtful ? 0 : usable;
    return solved;
}

template <std::size_t kLoads>
inline GaugeSolver::Solved GaugeSolver::solve(const double* r, std::uint32_t usable) const noexcept {
    const Solved solved = solve_agreeing<kLoads>(r, usable);
    return solved.used != 0 ? solved : solve_disagreeing(r, usable);
}

}  // namespace tactiled
