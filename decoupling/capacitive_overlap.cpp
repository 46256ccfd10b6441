// Model "capacitive", method "overlap": gap and shift together. With closeness u = 1 + v = d0 / d, the shift (dx, dy) of the
// upper electrode and A_k the exact overlap (overlap.hpp), each electrode reads, less its zero,
//
//     r_k = active_k ((1 + v) A_k(dx, dy) / A_k(0) - 1) = active_k (v + (1 + v) dA_k / A_k(0)),   k = C1 C2 C3 C4 Cn
//
// active = zero less stray. Five readings, three unknowns: Gauss-Newton with the exact derivatives, by QR. Then
// fz = -press(u, dx, dy), fx = k_s(u) dx, fy = k_s(u) dy (pad.hpp). It starts from the pairs' first order (errata 1.7) at
// each sample and not from the last sample: the same reading gives the same bits, and nothing can be poisoned.
#include <Eigen/Dense>
#include <bit>

#include "decoupling/capacitive_methods.hpp"
#include "decoupling/pad.hpp"

namespace tactiled {
namespace {

// Measured: 3 steps are enough up to a shift of 0.3 disc radii.
constexpr int kMostSteps = 8;
constexpr double kConverged = 1e-8;  // of a disc radius, of u; the next step is 1e-14
constexpr double kDoubtful = 6;      // residual in standard deviations, as in model "table"
constexpr double kGainError = 0.01;  // electrodes that disagree by 1 % of their readings are sound
constexpr double kWorstCondition = 1000;

using Jacobian = Eigen::Matrix<double, kElectrodes, 3>;
using Residual = Eigen::Matrix<double, kElectrodes, 1>;

struct State {
    double v, x, y;  // closeness - 1; shift in disc radii
};

class OverlapMethod final : public CheckedModel {
public:
    OverlapMethod(const Calibration& calibration, const Wiring& wiring, const std::array<double, kElectrodes>& active,
                  const ElectrodeGeometry& geometry, PadLaw pad, double noise)
        : CheckedModel(calibration, channels_of(wiring), 0), active_(active), pad_(pad), noise_(noise) {
        // Lengths in disc radii: the unknowns are of one size then, and the shear stiffness is per disc radius.
        const double R = geometry.disc_radius_m;
        pad_.shear_stiffness *= R;
        pad_.gap = geometry.gap_m / R;
        for (std::size_t e = 0; e < kElectrodes; ++e) {
            channel_[e] = std::size_t(wiring[e]);
            sector_[e] = geometry.sector(e);
            sector_[e].inner /= R;
            sector_[e].outer /= R;
            rest_area_[e] = area_at_rest(sector_[e], 1);
        }
        pair_gain_ = 2 * std::sin(geometry.opening_rad / 2) / rest_area_[0];
        std::array<double, 3> all{};
        for (unsigned set = (1u << kElectrodes); set-- > 0;) {  // from all five down
            Residual unused;
            Jacobian j;
            linearise({0, 0, 0}, Residual::Zero(), set, unused, j);
            const Jacobian scaled = j / active_[kCentre];
            const Eigen::JacobiSVD<Eigen::MatrixXd> svd(Eigen::MatrixXd(scaled), Eigen::ComputeThinU | Eigen::ComputeThinV);
            const auto& s = svd.singularValues();
            subset_[set].solvable = std::popcount(set) >= 3 && s[2] * kWorstCondition > s[0];
            if (!subset_[set].solvable) continue;
            // Rows of the pseudo-inverse: how noise reaches each unknown.
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

    // rt: wait-free, at most kMostSteps steps
    void solve(Input& input, Estimate& estimate) noexcept override {
        unsigned set = 0;
        Residual reading = Residual::Zero();
        for (std::size_t e = 0; e < kElectrodes; ++e) {
            if ((input.usable >> channel_[e] & 1u) == 0) continue;
            set |= 1u << e;
            reading[Eigen::Index(e)] = input.r[channel_[e]];
        }
        if (!subset_[set].solvable) return;  // BAD
        bool cut = false;
        State state = start(reading, set, cut);
        Residual rest;
        Jacobian j;
        bool converged = false;
        for (int step = 0; step < kMostSteps && !converged; ++step) {
            linearise(state, reading, set, rest, j);
            const Eigen::Vector3d move = j.householderQr().solve(rest);
            cut = false;
            state = inside({state.v + move[0], state.x + move[1], state.y + move[2]}, cut);
            converged = move.cwiseAbs().maxCoeff() < kConverged;  // false for a NaN
        }
        linearise(state, reading, set, rest, j);
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

    static State inside(State state, bool& cut) noexcept {
        state.v = within(state.v, kLeastCloseness - 1, kMostCloseness - 1, cut);
        const double shift = std::hypot(state.x, state.y);
        if (shift > kLargestShift) {
            cut = true;
            state.x *= kLargestShift / shift;
            state.y *= kLargestShift / shift;
        }
        return state;
    }

    // To first order: u from Cn (else from the sum of the sectors), the shift from each pair or from what is left of it.
    [[nodiscard]] State start(const Residual& reading, unsigned set, bool& cut) const noexcept {
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
        state.v = within(state.v, kLeastCloseness - 1, kMostCloseness - 1, cut);
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

    // rest = reading - model, and the model's derivatives by v, x, y; rows of electrodes outside of `set` are 0.
    // rt: wait-free
    void linearise(const State& state, const Residual& reading, unsigned set, Residual& rest, Jacobian& j) const noexcept {
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

    std::array<double, kElectrodes> active_;
    std::array<std::size_t, kElectrodes> channel_{};
    std::array<Sector, kElectrodes> sector_{};
    std::array<double, kElectrodes> rest_area_{};
    std::array<Subset, 1u << kElectrodes> subset_{};
    double pair_gain_ = 0;  // relative change of C1 by a shift of one disc radius, first order
    PadLaw pad_;
    double noise_;  // one standard deviation of an electrode, channel_unit
};

}  // namespace

std::unique_ptr<Decoupler> make_capacitive_overlap(const Calibration& calibration, const Wiring& wiring,
                                                   std::string& fault) {
    std::array<Parameter, 16> known;
    std::copy(kStrayParameters.begin(), kStrayParameters.end(), known.begin());
    std::copy(kPadParameters.begin(), kPadParameters.end(), known.begin() + 5);
    std::copy(kGeometryParameters.begin(), kGeometryParameters.end(), known.begin() + 8);
    known[14] = {"shear_stiffness_N_per_m", "shear force a shift at rest, N/m", 1e-3, 1e9};
    known[15] = {"noise", "one standard deviation of an electrode, in channel_unit", 1e-12, 1e12};
    std::array<double, known.size()> value;
    fault = read_parameters(calibration, known, value.data());
    if (!fault.empty()) return nullptr;
    const ElectrodeGeometry geometry{value[8], value[9], value[10], value[11], value[12], value[13]};
    fault = geometry.fault();
    if (!fault.empty()) return nullptr;
    const auto active = active_at_rest(calibration, wiring, value.data(), fault);
    if (!fault.empty()) return nullptr;
    return std::make_unique<OverlapMethod>(calibration, wiring, active, geometry,
                                           PadLaw{value[5], value[6], value[14], value[7]}, value[15]);
}

}  // namespace tactiled
