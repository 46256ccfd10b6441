// Model "capacitive", method "overlap": gap and shift together (overlap_solver.hpp), five readings, three unknowns.
// Then fz = -press(u, dx, dy), fx = k_s(u) dx, fy = k_s(u) dy (pad.hpp). Each sample starts from the first-order
// solution of the pairs (errata 1.7) and not from the last sample: the same reading gives the same bits, and no state
// can be corrupted.
#include <bit>

#include "decoupling/capacitive/methods.hpp"
#include "decoupling/capacitive/overlap_solver.hpp"
#include "decoupling/capacitive/pad.hpp"
#include "decoupling/solve/consistency.hpp"
#include "decoupling/solve/dense.hpp"

namespace tactiled {
namespace {

// Limit of the condition number of the derivatives by closeness and shift; a set of electrodes beyond it is not
// solved.
constexpr double kWorstConditionOfPad = 1000;

class OverlapMethod final : public CheckedModel {
public:
    OverlapMethod(const Calibration& calibration, const Wiring& wiring, const std::array<double, kElectrodes>& active,
                  const ElectrodeGeometry& geometry, PadLaw pad, double noise)
        : CheckedModel(calibration, channels_of(wiring), 0), solver_(active, geometry), pad_(pad), noise_(noise) {
        // Lengths are in disc radii, as in the solver: the shear stiffness is per disc radius.
        pad_.shear_stiffness *= geometry.disc_radius_m;
        pad_.gap = geometry.gap_m / geometry.disc_radius_m;
        for (std::size_t e = 0; e < kElectrodes; ++e) channel_[e] = std::size_t(wiring[e]);
        std::array<double, 3> all{};
        for (unsigned set = (1u << kElectrodes); set-- > 0;) {  // begins with all five electrodes
            OverlapSolver::Electrodes unused;
            OverlapSolver::Jacobian j;
            solver_.linearise({0, 0, 0}, OverlapSolver::Electrodes::Zero(), set, unused, j);
            const OverlapSolver::Jacobian scaled = j / active[kCentre];
            const Eigen::JacobiSVD<Eigen::MatrixXd> svd(Eigen::MatrixXd(scaled), Eigen::ComputeThinU | Eigen::ComputeThinV);
            const auto& s = svd.singularValues();
            subset_[set].solvable = std::popcount(set) >= 3 && s[2] * kWorstConditionOfPad > s[0];
            if (!subset_[set].solvable) continue;
            // Rows of the pseudo-inverse give the propagation of noise to each unknown.
            const Eigen::MatrixXd inverse = svd.solve(Eigen::MatrixXd::Identity(kElectrodes, kElectrodes));
            for (std::size_t i = 0; i < 3; ++i) {
                const double noise_gain = inverse.row(Eigen::Index(i)).norm();
                if (set == (1u << kElectrodes) - 1) all[i] = noise_gain;
                subset_[set].sd_factor[i] = std::max(1.0, noise_gain / all[i]);
            }
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "overlap"; }

private:
    struct Subset {
        bool solvable = false;
        std::array<double, 3> sd_factor{1, 1, 1};  // v dx dy
    };

    // rt: wait-free, at most OverlapSolver::kMaxSteps steps
    void solve(Input& input, Estimate& estimate) noexcept override {
        unsigned set = 0;
        OverlapSolver::Electrodes reading = OverlapSolver::Electrodes::Zero();
        for (std::size_t e = 0; e < kElectrodes; ++e) {
            if ((input.usable >> channel_[e] & 1u) == 0) continue;
            set |= 1u << e;
            reading[Eigen::Index(e)] = input.r[channel_[e]];
        }
        if (!subset_[set].solvable) return;  // BAD
        const auto [state, rest, converged, cut] = solver_.solve(reading, set, solver_.start(reading, set));
        const int spare = std::popcount(set) - 3;
        if (spare > 0) {
            const double gain = kGainError * reading.norm() / std::sqrt(double(spare + 3));
            estimate.residual = rest.norm() / std::sqrt(double(spare)) / std::hypot(noise_, gain);
            if (!(estimate.residual <= kDoubtful)) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        }
        if (cut) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY;
        if (!converged && !cut) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        const double shear_N = pad_.shear_stiffness_at(state.v);
        estimate.wrench_S[0] = shear_N * state.x;
        estimate.wrench_S[1] = shear_N * state.y;
        estimate.wrench_S[2] =
            0.0 - (pad_.press_N(state.v) + pad_.press_by_shift_N(state.v, state.x * state.x + state.y * state.y));
        const auto& factor = subset_[set].sd_factor;
        input.sd_factor[0] *= factor[1];
        input.sd_factor[1] *= factor[2];
        input.sd_factor[2] *= factor[0];
    }

    OverlapSolver solver_;
    std::array<std::size_t, kElectrodes> channel_{};
    std::array<Subset, 1u << kElectrodes> subset_{};
    PadLaw pad_;
    double noise_;  // standard deviation of an electrode, channel_unit
};

constexpr auto kParameters =
    joined(joined(joined(kStrayParameters, kPadParameters), kGeometryParameters),
           std::array<Parameter, 2>{{{"shear_stiffness_N_per_m", "shear force a shift at rest, N/m", 1e-3, 1e9},
                                     {"noise", "one standard deviation of an electrode, in channel_unit", 1e-12, 1e12}}});

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const Wiring wiring = pad_wiring(data.calibration(), fault);
    if (!fault.empty()) return nullptr;
    const ElectrodeGeometry geometry = electrode_geometry(data);
    fault = geometry.fault();
    if (!fault.empty()) return nullptr;
    const auto active = active_at_rest(data, wiring, fault);
    if (!fault.empty()) return nullptr;
    return std::make_unique<OverlapMethod>(
        data.calibration(), wiring, active, geometry,
        PadLaw{data["normal_stiffness_N"], data["stiffening"], data["shear_stiffness_N_per_m"], data["shear_gap_exponent"]},
        data["noise"]);
}

const MethodEntry entry{.model = "capacitive", .method = "overlap", .place = 30, .parameters = kParameters, .make = make};

}  // namespace
}  // namespace tactiled
