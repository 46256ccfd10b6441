// A model of one load cell, with its method and its fit: fz = -(channel - zero) / gain. One new file and one line in
// tests/CMakeLists.txt; decoupling/README.md shows it.
#include "decoupling/fit/fit.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/checked.hpp"

namespace tactiled {
namespace {

constexpr std::array<Parameter, 1> kParameters{{{"gain", "channel_unit a N of press", kAboveZero, kLargest}}};

class LoadCell final : public CheckedModel {
public:
    explicit LoadCell(const CalibrationData& data) : CheckedModel(data.calibration(), 1u, 1u), gain_(data["gain"]) {}
    [[nodiscard]] std::string_view method() const noexcept override { return "line"; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override { estimate.wrench_S[2] = -input.r[0] / gain_; }
    double gain_;
};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    if (data.calibration().components != std::vector<std::string>{"fz"}) fault = "a load cell sees fz and nothing else";
    return fault.empty() ? std::make_unique<LoadCell>(data) : nullptr;
}

void fit_line(const Rows& rows, Calibration& calibration, std::vector<std::string>& /*warnings*/) {
    Eigen::MatrixXd press_N(Eigen::Index(rows.size()), 1);
    Eigen::VectorXd reading(press_N.rows());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        press_N(Eigen::Index(i), 0) = -rows[i]->wrench_S[2];
        reading[Eigen::Index(i)] = rows[i]->channel[0];
    }
    const Affine line = affine_fit(press_N, reading);
    if (!line.slope.dependent.empty()) throw Undetermined("fz_N never changes");
    calibration.zero = {line.constant};
    calibration.parameters = {{"gain", line.slope.coefficient[0]}};
}

const MethodEntry method{.model = "load_cell", .method = "line", .place = 10, .parameters = kParameters, .make = make};
const FitEntry fitting{.model = "load_cell", .method = "line", .fit = fit_line, .channels = {.unit = "mV/V"}};

}  // namespace
}  // namespace tactiled
