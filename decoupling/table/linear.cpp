// Model "table", method "linear": the table-shaped sensor of Lee, Kim, Shikida and Sato, four inner gauges R1 R3 R5
// R7 and, if they are wired, four outer gauges R2 R4 R6 R8. With N = -fz > 0 under a press,
//
//     r = G (Fx, Fy, N),    rows of G by the sign table:    R1 (-ti  0  ni)   R5 (+ti  0  ni)
//                                                           R3 ( 0 -ti ni)   R7 ( 0 +ti ni)
//                                                           R2 (+to  0  no)   R6 (-to  0  no)
//                                                           R4 ( 0 +to no)   R8 ( 0 -to no)
//
// For the inner four the least-squares solution is Lee et al., eq. 1-3, with the signs of their table and not of
// their eq. 2 and 3 (decoupling/table/README.md, "Errata"): Fx = (r5 - r1) / 2 ti, Fy = (r7 - r3) / 2 ti, N = (r1 +
// r3 + r5 + r7) / 4 ni. The redundancy of four gauges and three forces is the parity r1 - r3 + r5 - r7 = 0; eight
// gauges have five such sums.
#include <fmt/format.h>

#include <algorithm>

#include "decoupling/solve/checked.hpp"
#include "decoupling/table/gauge_solver.hpp"
#include "decoupling/table/methods.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

class TableLinear final : public CheckedModel {
public:
    TableLinear(const Calibration& calibration, GaugeSolver solver)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0), solver_(std::move(solver)) {}
    [[nodiscard]] std::string_view method() const noexcept override { return "linear"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const auto solved = solver_.solve(input.r.data(), input.usable);
        if (solved.used == 0) return;  // BAD
        estimate.residual = solved.residual;
        if (solved.dead) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
        // The wrong gauge is unknown, and therefore also the error of the forces.
        if (solved.doubtful) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        if (solved.dead) input.outside = is_outside(input.r, solved.used);
        for (std::size_t c = 0; c < 3; ++c) {
            estimate.wrench_S[c] = solved.load[c] + 0.0;  // never -0
            input.sd_factor[c] = solved.sd_factor[c];
        }
        estimate.wrench_S[2] = 0.0 - solved.load[2];
    }

    GaugeSolver solver_;
};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    fault = fault_of_linear(data);
    if (!fault.empty()) return nullptr;
    auto solver = solver_of_signs(data, fault);
    if (!solver) return nullptr;
    return std::make_unique<TableLinear>(data.calibration(), std::move(*solver));
}

// The fit of "nonlinear" contains that of this method.
const MethodEntry entry{.model = "table",
                        .method = "linear",
                        .place = 10,
                        .parameters = kLinearParameters,
                        .make = make,
                        .takes_fit_of = "nonlinear"};

}  // namespace
}  // namespace tactiled
