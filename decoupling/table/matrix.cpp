// Model "table", method "matrix": r = G load with a forward gain for each gauge and each of fx fy fz mx my, solved by
// weighted least squares from the usable gauges. The moments need the outer gauges: the inner four respond to Fx and My
// alike (finite elements, decoupling/table/README.md). Mz is not measurable.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "decoupling/solve/checked.hpp"
#include "decoupling/table/gauge_solver.hpp"
#include "decoupling/table/methods.hpp"

namespace tactiled {
namespace {

class TableMatrix final : public CheckedModel {
public:
    TableMatrix(const Calibration& calibration, GaugeSolver solver)
        : CheckedModel(calibration, (1u << calibration.channels.size()) - 1, 0), solver_(std::move(solver)) {
        for (const auto& name : calibration.components) component_.push_back(component_index(name));
    }
    [[nodiscard]] std::string_view method() const noexcept override { return "matrix"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        const auto solved = solver_.solve(input.r.data(), input.usable);
        if (solved.used == 0) return;  // BAD: the remaining gauges do not determine the loads
        estimate.residual = solved.residual;
        if (solved.dead) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_MISSING_CHANNEL;
        if (solved.doubtful) estimate.reasons |= TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY;
        for (std::size_t j = 0; j < component_.size(); ++j) {
            estimate.wrench_S[component_[j]] = solved.load[j] + 0.0;  // never -0
            input.sd_factor[component_[j]] = solved.sd_factor[j];
        }
    }

    GaugeSolver solver_;
    std::vector<std::size_t> component_;
};

constexpr std::array<Parameter, 1> kParameters{kGaugeNoise};
// forward: one row per gauge, one column per component, channel_unit per N or Nm.
constexpr std::array<KnownTable, 2> kTables{{{"forward", kPerChannel, kPerComponent}, {"noise", 1, kPerChannel, false}}};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    const Calibration& calibration = data.calibration();
    fault = fault_of_gauges(calibration, kForcesAndMoments, false);
    if (!fault.empty()) return nullptr;
    const std::size_t n = calibration.channels.size();
    const NumberRows& forward = *data.table("forward");
    double greatest = 0;
    for (const auto& row : forward)
        for (const double gain : row) greatest = std::max(greatest, std::abs(gain));
    std::vector<double> noise(n, data.has("noise") ? data["noise"] : kDefaultNoise_per_reading * greatest);
    if (const auto* row = data.table("noise"); row != nullptr) noise = row->front();
    for (const double sd : noise)
        if (!(sd > 0)) {
            fault = "noise (one standard deviation of a gauge, channel_unit) is not above 0";
            return nullptr;
        }
    GaugeSolver solver(forward, noise, calibration.zero, 0, 0);
    if (!solver.confused().empty() || !solver.solvable((1u << n) - 1)) {
        std::vector<std::string> names;
        for (const std::size_t j : solver.confused()) names.push_back(calibration.components[j]);
        fault = fmt::format("the gauges {} do not determine {}: wire the outer gauges, or leave the moments out",
                            fmt::join(calibration.channels, " "), fmt::join(names, " "));
        return nullptr;
    }
    return std::make_unique<TableMatrix>(calibration, std::move(solver));
}

const MethodEntry entry{
    .model = "table", .method = "matrix", .place = 30, .parameters = kParameters, .tables = kTables, .make = make};

}  // namespace
}  // namespace tactiled
