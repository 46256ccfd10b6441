// Model "table", method "linear": the table-shaped sensor of Lee, Kim, Shikida and Sato, four inner gauges R1 R3 R5 R7
// and, where they are wired, four outer gauges R2 R4 R6 R8. With N = -fz > 0 while pressing,
//
//     r = G (Fx, Fy, N),    rows of G by the sign table:    R1 (-ti  0  ni)   R5 (+ti  0  ni)
//                                                           R3 ( 0 -ti ni)   R7 ( 0 +ti ni)
//                                                           R2 (+to  0  no)   R6 (-to  0  no)
//                                                           R4 ( 0 +to no)   R8 ( 0 -to no)
//
// For the inner four the least-squares solution is Lee et al., eq. 1-3, with the signs of their table and not of their
// eq. 2 and 3 (table.md, "Errata"): Fx = (r5 - r1) / 2 ti, Fy = (r7 - r3) / 2 ti, N = (r1 + r3 + r5 + r7) / 4 ni.
// What four gauges say more than three forces is the parity r1 - r3 + r5 - r7 = 0; with eight, five such sums.
#include <fmt/format.h>

#include <algorithm>

#include "decoupling/checked_loop.hpp"
#include "decoupling/gauge_solver.hpp"
#include "decoupling/table_methods.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

class Table final : public CheckedModel {
public:
    Table(const Calibration& calibration, GaugeSolver solver)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0), solver_(std::move(solver)) {}
    [[gnu::flatten]] Estimate decouple(const Reading& reading) noexcept override {
        return checked(reading, [this](Input& input, Estimate& estimate) { solve(input, estimate); });
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "linear"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const auto solved = solver_.solve_agreeing<3>(input.r.data(), input.usable);
        if (solved.used == 0) [[unlikely]]
            return solve_doubtful(input, estimate);
        put(solved, input, estimate);
    }

    [[gnu::noinline]] void solve_doubtful(Input& input, Estimate& estimate) noexcept {
        const auto solved = solver_.solve_disagreeing(input.r.data(), input.usable);
        if (solved.used == 0) return;  // BAD
        if (solved.doubtful || solved.dead) estimate.reasons |= TACTILED_DISAGREEMENT;
        // Which gauge is wrong is not known, so neither is how wrong the forces are.
        if (solved.doubtful) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        if (solved.dead) estimate.reasons |= TACTILED_MISSING_CHANNEL;
        if (solved.dead) input.outside = is_outside(input.r, solved.used);
        put(solved, input, estimate);
    }

    // fz = -N, and 0 rather than -0 at rest. In pairs, as they are read again: a load that spans two stores waits for both.
    void put(const GaugeSolver::Solved& solved, Input& input, Estimate& estimate) const noexcept {
        estimate.residual = solved.residual;
        store(estimate.wrench_S.data(), Pair{solved.load[0], solved.load[1]} + both(0));
        store(estimate.wrench_S.data() + 2, Pair{0.0 - solved.load[2], kNaN});
        store(input.sd_factor.data(), load(solver_.sd_factors(solved.used)));
        store(input.sd_factor.data() + 2, load(solver_.sd_factors(solved.used) + 2));
    }

    GaugeSolver solver_;
};

}  // namespace

std::unique_ptr<Decoupler> make_table_linear(const Calibration& calibration, std::string& fault) {
    // The tables are those of "nonlinear", whose fit serves this method, too.
    const TableNeeds needs{kLinearParameters, {"normal_curve", "hysteresis"}, {"fx", "fy", "fz"}, true};
    fault = fault_of_table(calibration, needs);
    if (fault.empty()) fault = fault_of_gains(calibration);
    if (!fault.empty()) return nullptr;
    auto solver = solver_of_signs(calibration, fault);
    if (!solver) return nullptr;
    return std::make_unique<Table>(calibration, std::move(*solver));
}

}  // namespace tactiled
