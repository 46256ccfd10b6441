#include "decoupling/capacitive/overlap_solver.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/capacitive/pad.hpp"

namespace tactiled {
namespace {

constexpr double kConverged = 1e-8;  // change of u, or of the shift in disc radii; the next step is 1e-14

OverlapSolver::State inside(OverlapSolver::State state, bool& cut) noexcept {
    state.v = within(state.v, kMinCloseness - 1, kMaxCloseness - 1, cut);
    const double shift = std::hypot(state.x, state.y);
    if (shift > kLargestShift) {
        cut = true;
        state.x *= kLargestShift / shift;
        state.y *= kLargestShift / shift;
    }
    return state;
}

}  // namespace

OverlapSolver::OverlapSolver(const std::array<double, kElectrodes>& active, const ElectrodeGeometry& geometry)
    : active_(active) {
    const double R = geometry.disc_radius_m;
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        sector_[e] = geometry.sector(e);
        sector_[e].inner /= R;
        sector_[e].outer /= R;
        rest_area_[e] = area_at_rest(sector_[e], 1);
    }
    pair_gain_ = 2 * std::sin(geometry.opening_rad / 2) / rest_area_[0];
}

OverlapSolver::State OverlapSolver::start(const Electrodes& reading, unsigned set) const noexcept {
    bool cut = false;  // the following steps determine it
    const auto has = [&](std::size_t e) { return (set >> e & 1u) != 0; };
    const auto relative = [&](std::size_t e) { return reading[Eigen::Index(e)] / active_[e]; };
    State state{0, 0, 0};
    if (has(kCentre)) {
        state.v = relative(kCentre);
    } else {
        int n = 0;
        for (const std::size_t plus : {0u, 2u})
            if (has(plus) && has(plus + 1)) {
                state.v += 0.5 * (relative(plus) + relative(plus + 1));
                ++n;
            }
        if (n > 0) state.v /= n;
    }
    state.v = within(state.v, kMinCloseness - 1, kMaxCloseness - 1, cut);
    const auto shift = [&](std::size_t plus) {
        const std::size_t minus = plus + 1;
        const auto grown = [&](std::size_t e) { return (relative(e) - state.v) / (1 + state.v) / pair_gain_; };
        if (has(plus) && has(minus)) return 0.5 * (grown(plus) - grown(minus));
        return has(plus) ? grown(plus) : has(minus) ? -grown(minus) : 0.0;
    };
    state.x = within(shift(0), -0.6, 0.6, cut);
    state.y = within(shift(2), -0.6, 0.6, cut);
    return state;
}

OverlapSolver::Solved OverlapSolver::solve(const Electrodes& reading, unsigned set, const State& from,
                                           int max_steps) const noexcept {
    Solved solved;
    solved.state = from;
    Jacobian j;
    for (int step = 0; step < max_steps && !solved.converged; ++step) {
        linearise(solved.state, reading, set, solved.rest, j);
        const Eigen::Vector3d move = j.householderQr().solve(solved.rest);
        solved.cut = false;
        solved.state = inside({solved.state.v + move[0], solved.state.x + move[1], solved.state.y + move[2]}, solved.cut);
        solved.converged = move.cwiseAbs().maxCoeff() < kConverged;  // false for a NaN
    }
    linearise(solved.state, reading, set, solved.rest, j);
    return solved;
}

void OverlapSolver::linearise(const State& state, const Electrodes& reading, unsigned set, Electrodes& rest,
                              Jacobian& j) const noexcept {
    rest.setZero();
    j.setZero();
    for (std::size_t e = 0; e < kElectrodes; ++e) {
        if ((set >> e & 1u) == 0) continue;
        const Overlap area = overlap(sector_[e], 1, state.x, state.y);
        const double grown = area.change / rest_area_[e], per = active_[e] * (1 + state.v) / rest_area_[e];
        const auto row = Eigen::Index(e);
        rest[row] = reading[row] - active_[e] * (state.v + (1 + state.v) * grown);
        j(row, 0) = active_[e] * (1 + grown);
        j(row, 1) = per * area.d_dx;
        j(row, 2) = per * area.d_dy;
    }
}

}  // namespace tactiled
