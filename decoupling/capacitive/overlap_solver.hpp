// Computes gap and shift of the pad from the readings of the electrodes with the exact overlap. With closeness u = 1
// + v = d0 / d, the shift (dx, dy) of the upper electrode and A_k the overlap (sector_overlap.hpp), each electrode
// reads, minus its zero,
//
//     r_k = active_k ((1 + v) A_k(dx, dy) / A_k(0) - 1) = active_k (v + (1 + v) dA_k / A_k(0)),   k = C1 C2 C3 C4 Cn
//
// active = zero minus stray. Gauss-Newton with the exact derivatives, by QR. Lengths are in disc radii, so that the
// unknowns have similar sizes.
#pragma once
#include <Eigen/Core>
#include <array>

#include "decoupling/capacitive/electrodes.hpp"

namespace tactiled {

class OverlapSolver {
public:
    static constexpr int kMaxSteps = 8;  // measured: 3 are enough up to a shift of 0.3 disc radii
    using Electrodes = Eigen::Matrix<double, kElectrodes, 1>;
    using Jacobian = Eigen::Matrix<double, kElectrodes, 3>;
    struct State {
        double v, x, y;  // closeness - 1; shift in disc radii
    };
    struct Solved {
        State state;
        Electrodes rest;         // reading - model; 0 for electrodes that are not used
        bool converged = false;  // the last step was below 1e-8
        bool cut = false;        // a part of the state was beyond the limits of any pad
    };

    // setup
    OverlapSolver(const std::array<double, kElectrodes>& active, const ElectrodeGeometry& geometry);

    // Returns the first-order solution: u from Cn (else from the sum of the sectors), the shift from each pair, or from the
    // remaining electrode of the pair. `set`: bit e = electrode e is used. rt: wait-free
    [[nodiscard]] State start(const Electrodes& reading, unsigned set) const noexcept;
    // rt: wait-free, at most `max_steps`, one or more
    [[nodiscard]] Solved solve(const Electrodes& reading, unsigned set, const State& from,
                               int max_steps = kMaxSteps) const noexcept;
    // Computes rest = reading - model, and the model's derivatives by v, x, y; rows of electrodes outside of `set`
    // are 0.
    // rt: wait-free
    void linearise(const State& state, const Electrodes& reading, unsigned set, Electrodes& rest,
                   Jacobian& j) const noexcept;

private:
    std::array<double, kElectrodes> active_;
    std::array<Sector, kElectrodes> sector_{};
    std::array<double, kElectrodes> rest_area_{};
    double pair_gain_ = 0;  // relative change of C1 by a shift of one disc radius, first order
};

}  // namespace tactiled
