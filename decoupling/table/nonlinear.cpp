// Model "table", method "nonlinear": method "linear", followed by the inverse of the sensor's nonlinear effects in
// the reverse order:
//
//     linear reading L of (Fx, Fy, N) = hysteresis of (Fx, Fy, curve(N))
//
// curve: the plate becomes stiffer as it bends, so a larger press reads relatively less (finite elements: 4.6 % less
// at 1 N, 25 % at 5 N). It is a table of points (N, L); the inverse is a monotone cubic through the points with their
// coordinates swapped, so nothing is solved in the loop. hysteresis: play operators, whose inverse consists of play
// operators again (play_hysteresis.hpp).
#include <cmath>

#include "decoupling/solve/checked.hpp"
#include "decoupling/solve/monotone_curve.hpp"
#include "decoupling/solve/play_hysteresis.hpp"
#include "decoupling/table/gauge_solver.hpp"
#include "decoupling/table/methods.hpp"

namespace tactiled {
namespace {

class TableNonlinear final : public CheckedModel {
public:
    TableNonlinear(const Calibration& calibration, GaugeSolver solver, MonotoneCurve normal_of_reading,
                   const std::array<PlayOperators, 3>& undo)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0),
          solver_(std::move(solver)),
          normal_of_reading_(std::move(normal_of_reading)),
          has_curve_(calibration.tables.count("normal_curve") != 0),
          undo_(undo) {}
    [[nodiscard]] std::string_view method() const noexcept override { return "nonlinear"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const auto solved = solver_.solve(input.r.data(), input.usable);
        if (solved.used == 0) return;  // BAD
        estimate.residual = solved.residual;
        if (solved.dead) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
        if (solved.doubtful) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        std::array<double, 3> load{};  // Fx Fy N
        for (std::size_t c = 0; c < 3; ++c) {
            load[c] = undo_[c].n == 0 ? solved.load[c] : state_[c].next(undo_[c], solved.load[c]);
            if (undo_[c].n != 0 && !state_[c].is_settled()) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
            input.sd_factor[c] = solved.sd_factor[c];
        }
        if (has_curve_) {
            if (load[2] > (1 + kDomainMargin) * normal_of_reading_.last()) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
            load[2] = normal_of_reading_.at(load[2]);
        }
        for (std::size_t c = 0; c < 3; ++c) estimate.wrench_S[c] = (c == 2 ? -load[c] : load[c]) + 0.0;
    }
    void forget() noexcept override {
        for (auto& state : state_) state.forget();
    }

    GaugeSolver solver_;
    MonotoneCurve normal_of_reading_;
    bool has_curve_;
    std::array<PlayOperators, 3> undo_;  // size 0: no hysteresis is known
    std::array<PlayState, 3> state_;
};

// normal_curve: rows (N, reading of the linear method), both in N, rising from (0, 0). hysteresis: rows of a
// threshold in N, then the weights of Fx, Fy and N.
constexpr std::array<KnownTable, 2> kTables{{{"normal_curve", kAnyNumber, 2, false}, {"hysteresis", kAnyNumber, 4, false}}};

std::string read_curve(const NumberRows& points, MonotoneCurve& curve) {
    std::vector<double> normal, reading;
    for (const auto& row : points) {
        normal.push_back(row[0]);
        reading.push_back(row[1]);
    }
    std::string fault = MonotoneCurve::fault_of(reading, normal);
    if (fault.empty() && (normal.front() != 0 || reading.front() != 0)) fault = "its first row is not 0, 0";
    if (fault.empty()) curve = MonotoneCurve(reading, normal);
    return fault.empty() ? "" : "table normal_curve: " + fault;
}

// Reads the play operators that invert those of component c.
std::string read_hysteresis(const NumberRows& rows, std::size_t c, PlayOperators& undo) {
    std::vector<double> thresholds, weights;
    for (const auto& row : rows) {
        thresholds.push_back(row[0]);
        weights.push_back(row[c + 1]);
    }
    if (const std::string fault = PlayOperators::fault_of(thresholds, weights); !fault.empty())
        return "table hysteresis: " + fault;
    PlayOperators operators;
    operators.n = thresholds.size();
    std::copy(thresholds.begin(), thresholds.end(), operators.threshold.begin());
    std::copy(weights.begin(), weights.end(), operators.weight.begin());
    undo = operators.inverse();
    return "";
}

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    fault = fault_of_linear(data);
    MonotoneCurve curve;
    if (const auto* points = data.table("normal_curve"); fault.empty() && points != nullptr)
        fault = read_curve(*points, curve);
    std::array<PlayOperators, 3> undo;
    if (const auto* rows = data.table("hysteresis"); rows != nullptr)
        for (std::size_t c = 0; c < 3 && fault.empty(); ++c) fault = read_hysteresis(*rows, c, undo[c]);
    if (!fault.empty()) return nullptr;
    auto solver = solver_of_signs(data, fault);
    if (!solver) return nullptr;
    return std::make_unique<TableNonlinear>(data.calibration(), std::move(*solver), std::move(curve), undo);
}

const MethodEntry entry{
    .model = "table", .method = "nonlinear", .place = 50, .parameters = kLinearParameters, .tables = kTables, .make = make};

}  // namespace
}  // namespace tactiled
