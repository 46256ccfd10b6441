// Model "capacitive", method "quadratic": the curves of the thesis, eq. XXXIII and XXXIV, C = C0 + b F + a F^2. They
// give absolute capacitances (errata 1.4); C0 is the channel's zero. The press N = -fz comes from Cn alone; then for
// each pair
//
//     C1 = C0 + b1 F + a1 F^2 + press1(N)        C2 = C0 - b2 F + a2 F^2 + press2(N)
//     (C1 - C2) - (press1 - press2) = (b1 + b2) F + (a1 - a2) F^2
//
// The thesis uses one electrode's curve for both signs. The falling curve approaches its vertex, where it gives no
// information (errata 1.9); the difference of the pair does not. A single electrode is used only if its partner is
// missing.
#include "decoupling/capacitive/methods.hpp"
#include "decoupling/solve/curve.hpp"

namespace tactiled {
namespace {

constexpr std::array<Parameter, 4> kParameters{
    {{"normal_b", "slope of Cn at rest, channel_unit a N of press", 1e-12, 1e12},
     {"normal_a", "curvature of Cn, channel_unit a N^2", -1e12, 1e12, 0},
     {"normal_range_N", "press up to which Cn was measured, N", 1e-9, 1e9},
     {"shear_range_N", "shear up to which the pairs were measured, N", 1e-9, 1e9, 0}}};

class Quadratic final : public CheckedModel {
public:
    Quadratic(const CalibrationData& data, const Wiring& wiring, std::uint32_t needed)
        : CheckedModel(data.calibration(), channels_of(wiring), needed),
          wiring_(wiring),
          normal_(data["normal_b"], data["normal_a"], 0, data["normal_range_N"]),
          shear_range_N_(data["shear_range_N"]) {
        const Calibration& calibration = data.calibration();
        for (std::size_t i = 0; i < calibration.components.size() && !calibration.sd.empty(); ++i)
            sd_[component_index(calibration.components[i])] = calibration.sd[i];
        if (data.table("side") == nullptr) return;
        const NumberRows& side = *data.table("side");
        for (std::size_t e = 0; e < kCentre; ++e) {
            single_[e] = Curve(side[e][0], side[e][1], -shear_range_N_, shear_range_N_);
            press_[e] = Curve(side[e][2], side[e][3], 0, data["normal_range_N"]);
        }
        for (const std::size_t axis : {0u, 1u}) {
            const auto &plus = side[2 * axis], &minus = side[2 * axis + 1];
            pair_[axis] = Curve(plus[0] + minus[0], plus[1] - minus[1], -shear_range_N_, shear_range_N_);
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "quadratic"; }
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override { return pair_and_centre(wiring_, c); }

private:
    [[nodiscard]] bool is_usable(const Input& input, std::size_t electrode) const noexcept {
        return wiring_[electrode] >= 0 && (input.usable >> wiring_[electrode] & 1u) != 0;
    }
    [[nodiscard]] double r(const Input& input, std::size_t electrode) const noexcept {
        return input.r[std::size_t(wiring_[electrode])];
    }

    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const Curve::Force press = normal_.inverse(r(input, kCentre));
        flag(press, normal_, 0, normal_.max(), estimate);
        estimate.wrench_S[2] = 0.0 - press.F;
        for (const std::size_t axis : {0u, 1u})
            if (seen()[axis]) shear(axis, press.F, input, estimate);
    }

    void shear(std::size_t axis, double press_N, Input& input, Estimate& estimate) const noexcept {
        const std::size_t plus = 2 * axis, minus = plus + 1;
        const auto unpressed = [&](std::size_t e) { return r(input, e) - press_[e].y(press_N); };
        const bool has_plus = is_usable(input, plus), has_minus = is_usable(input, minus);
        if (has_plus && has_minus) {
            const double difference =
                (r(input, plus) - r(input, minus)) - (press_[plus].y(press_N) - press_[minus].y(press_N));
            const Curve::Force force = pair_[axis].inverse(difference);
            flag(force, pair_[axis], -shear_range_N_, shear_range_N_, estimate);
            estimate.wrench_S[axis] = force.F;
        } else if (has_plus || has_minus) {
            const std::size_t e = has_plus ? plus : minus;
            const Curve::Force force = single_[e].inverse(unpressed(e));
            flag(force, single_[e], -shear_range_N_, shear_range_N_, estimate);
            estimate.wrench_S[axis] = has_plus ? force.F : 0.0 - force.F;
            if (!(force.slope > 0)) return;
            // Noise of one electrode through its slope, relative to the noise of two through the pair's slope; an
            // error of the press no longer cancels.
            const double noise = pair_[axis].b() / (std::sqrt(2.0) * force.slope);
            const double leak = press_[e].b() * sd_[2] / (force.slope * sd_[axis]);
            input.sd_factor[axis] *= std::hypot(std::max(1.0, noise), std::isfinite(leak) ? leak : 0.0);
        }  // else NaN, which is BAD
    }

    // Beyond the range the curve continues as a straight line; beyond the vertex the force is unknown.
    static void flag(const Curve::Force& force, const Curve& curve, double min, double max, Estimate& estimate) noexcept {
        const double margin = kDomainMargin * (max - min);
        const bool at_vertex = !(force.slope > 1e-6 * curve.b());
        if (at_vertex || force.F < min - margin || force.F > max + margin) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        if (at_vertex) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
    }

    Wiring wiring_;
    Curve normal_;
    std::array<Curve, kCentre> single_, press_;  // `single_` is for the electrode's own shear, `press_` for the press
    std::array<Curve, 2> pair_;
    double shear_range_N_;
    Wrench sd_ = kUnseen;
};

// side: one row for each of C1 .. C4: b and a for the force towards the electrode, b and a for the press.
constexpr std::array<KnownTable, 1> kTables{{{"side", 4, 4, false}}};

std::string fault_of_sides(const CalibrationData& data) {
    const NumberRows* side = data.table("side");
    if (side == nullptr) return "table side is missing: 4 rows C1 .. C4 of b a normal_b normal_a";
    for (std::size_t e = 0; e < kCentre; ++e)
        if (!((*side)[e][0] > 0))
            return fmt::format("table side, row {}: needed are b a normal_b normal_a with b > 0", kElectrode[e].name);
    if (!(data["shear_range_N"] > 0)) return "parameter shear_range_N is missing: " + std::string(kParameters[3].what);
    return "";
}

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const Wiring wiring = pad_wiring(data.calibration(), fault);
    if (!fault.empty()) return nullptr;
    std::uint32_t needed = 0;
    const auto need = [&](std::size_t e) {
        if (wiring[e] < 0 && fault.empty()) fault = fmt::format("channels lacks {}", kElectrode[e].name);
    };
    need(kCentre);
    if (wiring[kCentre] >= 0) needed = 1u << wiring[kCentre];
    Wiring used{-1, -1, -1, -1, wiring[kCentre]};
    bool shear = false;
    for (const auto& name : data.calibration().components) {
        const std::size_t axis = component_index(name);
        if (axis > 1) continue;
        shear = true;
        for (const std::size_t e : {2 * axis, 2 * axis + 1}) {
            need(e);
            used[e] = wiring[e];
        }
    }
    if (shear && fault.empty()) fault = fault_of_sides(data);
    return fault.empty() ? std::make_unique<Quadratic>(data, used, needed) : nullptr;
}

const MethodEntry entry{
    .model = "capacitive", .method = "quadratic", .place = 10, .parameters = kParameters, .tables = kTables, .make = make};

}  // namespace
}  // namespace tactiled
