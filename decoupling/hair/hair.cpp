// Model "hair": the embedded hairs of Cao et al., H1 .. H4 or one pair of them. Frame, signs and steps: stages.hpp,
// decoupling/hair/README.md.
//
//     sum_diff   DIFF of a pair gives its shear, the shear gives the intercept of SUM, SUM gives the normal stress
//     matrix     weighted least squares of all hairs, with leak terms of second and third order
//     physics    the same without leak terms, gains from the hair's geometry
//
// This file is the decoupler; each method has a file that reads its parts of a calibration.
//
// Forces are stresses times the area of the cap: fx = tau_x A, fy = tau_y A, fz = -sigma A.
#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "decoupling/hair/setup.hpp"
#include "decoupling/solve/checked.hpp"
#include "decoupling/solve/consistency.hpp"

namespace tactiled {
namespace {

constexpr std::array<std::size_t, 3> kComponentOf{2, 0, 1};  // index of sigma, tau_x, tau_y in a wrench

class Hair final : public CheckedModel {
public:
    Hair(const Calibration& calibration, std::string_view method, const HairSetup& setup, const HairSolver& solver)
        : CheckedModel(calibration, ~0u, 0), method_(method), setup_(setup), solver_(solver) {}

    [[nodiscard]] std::string_view method() const noexcept override { return method_; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        std::array<double, 4> r{};
        std::uint32_t usable = 0;
        for (std::size_t k = 0; k < n_channels(); ++k) {
            if ((input.usable >> k & 1u) == 0) continue;
            r[setup_.hair[k]] = input.r[k];
            usable |= 1u << setup_.hair[k];
        }
        const std::uint32_t pairs = setup_.two_steps ? whole_pairs(usable) : 0;
        const std::uint32_t used = pairs != 0 ? pairs : usable;
        if (!solver_.solvable(used)) return;
        const HairLoad load = pairs != 0 ? two_steps(r, pairs) : solver_.solve(r, used);
        if (setup_.noise_known) {
            estimate.residual = residual(r, load, used);
            // With four hairs the wrong one cannot be identified, so the error of the forces is unknown.
            if (estimate.residual > kDoubtful) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        }
        for (std::size_t j = 0; j < 3; ++j) {
            if ((setup_.unknowns >> j & 1u) == 0) continue;
            const double force_N = load[j] * setup_.scale_Pa[j] * setup_.area_m2;
            estimate.wrench_S[kComponentOf[j]] = j == 0 ? 0.0 - force_N : force_N;
            input.sd_factor[kComponentOf[j]] = solver_.noise_gain(used)[j] / solver_.noise_gain(setup_.wired)[j];
        }
        for (const std::size_t c : {0u, 1u, 2u})
            if (seen()[c] && !std::isfinite(estimate.wrench_S[c])) estimate.reasons |= TACTILED_NOT_FINITE;
    }

    // Returns the pairs of which both hairs are usable; 0 if a requested shear has none; the remaining hairs are then solved
    // together.
    std::uint32_t whole_pairs(std::uint32_t usable) const noexcept {
        const bool x = (usable & kPairX) == kPairX, y = (usable & kPairY) == kPairY;
        if (((setup_.unknowns & 2u) != 0 && !x) || ((setup_.unknowns & 4u) != 0 && !y)) return 0;
        return (x ? kPairX : 0) | (y ? kPairY : 0);
    }

    // The two steps of Cao et al.: DIFF -> shear -> intercept of SUM -> normal. With both pairs SUM contains all four
    // hairs. rt: wait-free
    HairLoad two_steps(const std::array<double, 4>& r, std::uint32_t pairs) const noexcept {
        const bool x = (setup_.unknowns & 2u) != 0, y = (setup_.unknowns & 4u) != 0;
        const double tau_x = x ? shear_from_diff_Pa(r[0], r[2], setup_.diff_per_Pa[0]) : 0;
        const double tau_y = y ? shear_from_diff_Pa(r[1], r[3], setup_.diff_per_Pa[1]) : 0;
        HairLoad load{0, tau_x / setup_.scale_Pa[1], tau_y / setup_.scale_Pa[2]};
        double sum = 0;
        HairLoad gain{};  // gain of SUM, dR/R0 at full scale
        LeakTerms coefficient{};
        for (std::size_t i = 0; i < 4; ++i) {
            if ((pairs >> i & 1u) == 0) continue;
            sum += r[i];
            for (std::size_t j = 0; j < 3; ++j) gain[j] += setup_.response.gain[i][j];
            for (std::size_t j = 0; j < kLeakTerms; ++j) coefficient[j] += setup_.response.leak[i][j];
        }
        const double intercept = intercept_of_sum(tau_x, tau_y, gain[1] / setup_.scale_Pa[1], gain[2] / setup_.scale_Pa[2],
                                                  coefficient, leak_terms(setup_.response.nearest(load)));
        load[0] = normal_from_sum_Pa(sum, intercept, gain[0] / setup_.scale_Pa[0]) / setup_.scale_Pa[0];
        return load;
    }

    // Returns the root mean square of the residual of the hairs used, per degree of freedom, in standard deviations
    // of a hair; NaN without redundancy. rt: wait-free
    double residual(const std::array<double, 4>& r, const HairLoad& load, std::uint32_t used) const noexcept {
        const int hairs = std::popcount(used), free = hairs - std::popcount(setup_.unknowns);
        if (free <= 0) return kNaN;
        const LeakTerms terms = leak_terms(setup_.response.nearest(load));
        double reading2 = 0, unexplained = 0;
        for (const double one : r) reading2 += one * one;
        for (std::size_t i = 0; i < 4; ++i) {
            if ((used >> i & 1u) == 0) continue;
            const double rest = r[i] - setup_.response.reading(i, load, terms);
            const double noise = setup_.response.noise[i];
            unexplained += rest * rest / (noise * noise + kGainError * kGainError * reading2 / hairs);
        }
        return std::isfinite(unexplained) ? std::sqrt(unexplained / free) : std::numeric_limits<double>::infinity();
    }

    std::string method_;
    HairSetup setup_;
    HairSolver solver_;
};

}  // namespace

std::unique_ptr<Decoupler> make_hair(const CalibrationData& data, std::string_view method, const HairSetup& setup,
                                     std::string& fault) {
    if (!fault.empty()) return nullptr;
    const HairSolver solver(setup.response, setup.wired, setup.unknowns);
    if (solver.contraction(setup.wired) >= HairSolver::kSlowest)
        fault = fmt::format(
            "the leak terms are too large beside the gains: a step of the iteration leaves {:.2g} of an "
            "error, at most {} is solved; calibrate over a smaller range",
            solver.contraction(setup.wired), HairSolver::kSlowest);
    else if (!solver.solvable(setup.wired))
        fault = "these hairs and gains do not determine the stresses";
    return fault.empty() ? std::make_unique<Hair>(data.calibration(), method, setup, solver) : nullptr;
}

}  // namespace tactiled
