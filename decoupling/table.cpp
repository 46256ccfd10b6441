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

#include "decoupling/checked.hpp"
#include "decoupling/gauge_solver.hpp"
#include "decoupling/pairs.hpp"
#include "decoupling/table_methods.hpp"
#include "decoupling/table_signs.hpp"

namespace tactiled {
namespace {

class Table final : public CheckedModel {
public:
    Table(const Calibration& calibration, GaugeSolver solver)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0),
          zero_(calibration.zero),
          solver_(std::move(solver)) {}
    [[nodiscard]] std::string_view method() const noexcept override { return "linear"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const auto solved = solver_.solve(input.r.data(), zero_, input.usable);
        if (solved.used == 0) return;  // BAD
        estimate.residual = solved.residual;
        if (solved.doubtful || solved.dead) doubt(solved, input, estimate);
        // In pairs, as they are read again: a load that spans two stores waits for both. fz = -N, and 0 rather than -0 at
        // rest.
        store(estimate.wrench_S.data(), load(solved.load) + both(0));
        store(estimate.wrench_S.data() + 2, Pair{0.0 - solved.load[2], kNaN});
        store(estimate.wrench_S.data() + 4, both(kNaN));
        store(input.sd_factor.data(), load(solver_.sd_factors(solved.used)));
        store(input.sd_factor.data() + 2, load(solver_.sd_factors(solved.used) + 2));
    }

    // Its own function: the good reading does not pay for it.
    [[gnu::noinline]] void doubt(const GaugeSolver::Solved& solved, Input& input, Estimate& estimate) const noexcept {
        estimate.reasons |= TACTILED_DISAGREEMENT;
        if (solved.doubtful) {  // which gauge is wrong is not known, so neither is how wrong the forces are
            estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
            return;
        }
        estimate.reasons |= TACTILED_MISSING_CHANNEL;
        std::array<double, kMostGauges> channel{};
        for (std::size_t k = 0; k < n_channels(); ++k) channel[k] = input.r[k] + zero_[k];
        input.outside = domain().outside({channel.data(), n_channels()}, solved.used);
    }

    std::vector<double> zero_;
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
