// Model "generic": any channels, any components.
//
//     matrix:      wrench[c] = sum over k of M[c][k] * r[k],    r[k] = channel[k] - zero[k]
//     quadratic, rbf, mlp:      the same + g(u),    u[k] = r[k] / width[k]
//
// The sum of `matrix` runs from k = 0 upwards into one double that starts at 0, with every product and every sum rounded
// once (no fused multiply-add, no reordering), so that a user can recompute a force from the calibration file to its last
// bit.
//
// The matrix of the corrected methods is the best affine map, and g corrects its residual. Outside of the domain g keeps its
// value at the nearest point inside: the force continues linearly.
#include "decoupling/generic/methods.hpp"

namespace tactiled {
namespace {

std::uint32_t used_channels(const Calibration& calibration, bool corrected) {
    std::uint32_t used = 0;
    for (std::size_t k = 0; k < calibration.channels.size(); ++k)
        for (const auto& row : calibration.matrix)
            if (corrected || row[k] != 0) used |= 1u << k;
    return used;
}

class Generic final : public CheckedModel {
public:
    Generic(const Calibration& calibration, std::string_view method, std::unique_ptr<Correction> correction)
        : CheckedModel(calibration, used_channels(calibration, correction != nullptr), ~0u),
          method_(method),
          correction_(std::move(correction)) {
        for (std::size_t i = 0; i < calibration.components.size(); ++i) {
            component_[i] = component_index(calibration.components[i]);
            for (std::size_t k = 0; k < n_channels(); ++k) matrix_[k][i] = calibration.matrix[i][k];
        }
        n_components_ = calibration.components.size();
        if (correction_ == nullptr) return;
        const auto& width = calibration.tables.at("width").front();
        for (std::size_t k = 0; k < n_channels(); ++k) {
            width_[k] = width[k];
            zero_[k] = calibration.zero[k];
        }
    }

    [[nodiscard]] std::string_view method() const noexcept override { return method_; }

private:
    // rt: wait-free
    void solve(Input& input, Estimate& estimate) noexcept override {
        // Each component has its own sum, from the first channel on.
        double value[6]{};
        const double* const r = input.r.data();
        for (std::size_t k = 0; k < n_channels(); ++k)
            for (std::size_t i = 0; i < 6; ++i) value[i] += matrix_[k][i] * r[k];
        if (correction_ != nullptr) {
            std::array<double, kMaxChannels> u;
            for (std::size_t k = 0; k < n_channels(); ++k)
                u[k] = (domain().nearest(k, input.r[k] + zero_[k]) - zero_[k]) / width_[k];
            correction_->add(u.data(), value);
        }
        for (std::size_t i = 0; i < n_components_; ++i) estimate.wrench_S[component_[i]] = value[i];
    }

    std::string method_;
    std::unique_ptr<Correction> correction_;
    std::size_t n_components_ = 0;
    std::array<std::size_t, 6> component_{};
    double matrix_[kMaxChannels][6]{};  // one row per channel, 0 beyond the components
    std::array<double, kMaxChannels> width_{}, zero_{};
};

// Returns the fault of the matrix, "" if there is none. A calibration may come from code as well as from a file.
std::string fault_of_matrix(const Calibration& calibration) {
    const std::size_t n = calibration.channels.size(), rows = calibration.components.size();
    if (calibration.matrix.size() != rows)
        return fmt::format("matrix has {} rows for {} components", calibration.matrix.size(), rows);
    for (const auto& row : calibration.matrix)
        if (row.size() != n) return fmt::format("a row of matrix has {} numbers for {} channels", row.size(), n);
    return "";
}

// A component whose row of the matrix is zero would be 0, and GOOD, under any load.
std::string fault_of_empty_row(const Calibration& calibration) {
    for (std::size_t i = 0; i < calibration.matrix.size(); ++i) {
        const auto& row = calibration.matrix[i];
        if (std::all_of(row.begin(), row.end(), [](double gain) { return gain == 0; }))
            return fmt::format("matrix: the row of {} is all 0, no channel responds to it; leave it out of components",
                               calibration.components[i]);
    }
    return "";
}

std::string fault_of_width(const CalibrationData& data) {
    for (const double width : data.table(kWidth.name)->front())
        if (!(width > 0)) return "table width has a number that is not above 0";
    if (data.calibration().channel_least.empty()) return "channel_least and channel_most are needed";
    return "";
}

constexpr std::array<Parameter, 1> kParameters{kForget};

std::unique_ptr<Decoupler> make(const CalibrationData& data, std::string& fault) {
    return make_generic(data, "matrix", nullptr, fault);
}

const MethodEntry entry{.model = "generic",
                        .method = "matrix",
                        .place = 10,
                        .parameters = kParameters,
                        .make = make,
                        .takes_fit_of = kAnyMethod};

}  // namespace

std::unique_ptr<Decoupler> make_generic(const CalibrationData& data, std::string_view method,
                                        std::unique_ptr<Correction> correction, std::string& fault) {
    if (fault.empty()) fault = fault_of_matrix(data.calibration());
    if (fault.empty()) fault = correction == nullptr ? fault_of_empty_row(data.calibration()) : fault_of_width(data);
    return fault.empty() ? std::make_unique<Generic>(data.calibration(), method, std::move(correction)) : nullptr;
}

}  // namespace tactiled
