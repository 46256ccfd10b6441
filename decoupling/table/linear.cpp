// Model "table", method "linear": the table-shaped sensor of Lee, Kim, Shikida and Sato, four inner gauges R1 R3 R5 R7
// and, where they are wired, four outer gauges R2 R4 R6 R8. With N = -fz > 0 while pressing,
//
//     r = G (Fx, Fy, N),    rows of G by the sign table:    R1 (-ti  0  ni)   R5 (+ti  0  ni)
//                                                           R3 ( 0 -ti ni)   R7 ( 0 +ti ni)
//                                                           R2 (+to  0  no)   R6 (-to  0  no)
//                                                           R4 ( 0 +to no)   R8 ( 0 -to no)
//
// For the inner four the least-squares solution is Lee et al., eq. 1-3, with the signs of their table and not of their
// eq. 2 and 3 (decoupling/table/README.md, "Errata"): Fx = (r5 - r1) / 2 ti, Fy = (r7 - r3) / 2 ti, N = (r1 + r3 + r5 + r7)
// / 4 ni. What four gauges say more than three forces is the parity r1 - r3 + r5 - r7 = 0; with eight, five such sums.
#include <fmt/format.h>

#include <algorithm>

#include "decoupling/solve/checked_loop.hpp"
#include "decoupling/table/gauge_solver.hpp"
#include "decoupling/table/methods.hpp"
#include "decoupling/table/sign_table.hpp"

namespace tactiled {
namespace {

// `kGauges`: 4 or 8, whose good readings have a way of their own; 0 = any number.
template <std::size_t kGauges>
class Table final : public CheckedModel {
public:
    Table(const Calibration& calibration, GaugeSolver solver)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0), solver_(std::move(solver)) {}
    [[gnu::flatten]] Estimate decouple(const Reading& reading) noexcept override {
        if constexpr (kGauges != 0) {
            alignas(16) double r[kMaxGauges];
            if (reading.channel.size() != kGauges || !is_plain<kGauges>(reading, r)) [[unlikely]]
                return decouple_any(reading);
            const auto solved = solver_.solve_agreeing<3>(r, kAll);
            if (solved.used == 0) [[unlikely]]
                return decouple_any(reading);
            return finished<2>({fx_fy(solved), fz_mx(solved)}, solver_.sd_factors(kAll), solved.residual);
        } else {
            return decouple_any(reading);
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "linear"; }

private:
    static constexpr std::uint32_t kAll = (1u << kGauges) - 1;

    // The same for any reading. rt: wait-free
    [[gnu::flatten, gnu::noinline]] Estimate decouple_any(const Reading& reading) noexcept {
        return checked(reading, [this](Input& input, Estimate& estimate) { solve(input, estimate); });
    }
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

    // fz = -N, and 0 rather than -0 at rest.
    static Pair fx_fy(const GaugeSolver::Solved& solved) noexcept { return Pair{solved.load[0], solved.load[1]} + both(0); }
    static Pair fz_mx(const GaugeSolver::Solved& solved) noexcept { return Pair{0.0 - solved.load[2], kNaN}; }

    // In pairs, as they are read again: a load that spans two stores waits for both.
    void put(const GaugeSolver::Solved& solved, Input& input, Estimate& estimate) const noexcept {
        estimate.residual = solved.residual;
        store(estimate.wrench_S.data(), fx_fy(solved));
        store(estimate.wrench_S.data() + 2, fz_mx(solved));
        store(input.sd_factor.data(), load(solver_.sd_factors(solved.used)));
        store(input.sd_factor.data() + 2, load(solver_.sd_factors(solved.used) + 2));
    }

    GaugeSolver solver_;
};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    fault = fault_of_linear(data);
    if (!fault.empty()) return nullptr;
    auto solver = solver_of_signs(data, fault);
    if (!solver) return nullptr;
    const Calibration& calibration = data.calibration();
    if (calibration.channels.size() == 8) return std::make_unique<Table<8>>(calibration, std::move(*solver));
    if (calibration.channels.size() == 4) return std::make_unique<Table<4>>(calibration, std::move(*solver));
    return std::make_unique<Table<0>>(calibration, std::move(*solver));
}

// The fit of "nonlinear" is that of this method and more.
const MethodEntry entry({.model = "table",
                         .method = "linear",
                         .place = 10,
                         .parameters = kLinearParameters,
                         .make = make,
                         .takes_fit_of = "nonlinear"});

}  // namespace
}  // namespace tactiled
