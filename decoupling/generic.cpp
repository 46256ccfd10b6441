// Model "generic", method "matrix": any channels, one calibrated matrix.
//
//     wrench[c] = sum over k of M[c][k] * (channel[k] - zero[k])
//
// Summed from k = 0 upwards into one double that starts at 0, every product and every sum rounded once (no fused
// multiply-add, no reordering), so that anyone with the calibration file can recompute a force to its last bit.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "decoupling/decoupler.hpp"
#include "decoupling/domain.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMost = 32;  // channels: a bit each in Reading::missing

class Generic final : public Decoupler {
public:
    explicit Generic(const Calibration& calibration)
        : n_(calibration.channels.size()), domain_(calibration), sd_known_(!calibration.sd.empty()) {
        for (std::size_t k = 0; k < n_; ++k) zero_[k] = calibration.zero[k];
        for (std::size_t i = 0; i < calibration.components.size(); ++i) {
            const std::size_t c = component_index(calibration.components[i]);
            seen_[c] = true;
            if (sd_known_) sd_[c] = calibration.sd[i];
            for (std::size_t k = 0; k < n_; ++k) {
                matrix_[c][k] = calibration.matrix[i][k];
                if (matrix_[c][k] != 0) needed_ |= 1u << k;
            }
        }
    }

    // rt: wait-free
    Estimate decouple(const Reading& reading) noexcept override {
        Estimate estimate;
        if (reading.channel.size() != n_) {
            estimate.reasons = TACTILED_WRONG_DEVICE;
            return estimate;
        }
        // A channel that no component uses may be missing or anything: it must not turn 0 * NaN into the sum.
        std::array<double, kMost> shift;
        std::uint32_t missing = reading.missing;
        for (std::size_t k = 0; k < n_; ++k) {
            const double value = reading.channel[k];
            if (std::isnan(value)) missing |= 1u << k;
            shift[k] = (needed_ >> k & 1u) != 0 ? value - zero_[k] : 0.0;
        }
        if ((missing & needed_) != 0) {
            estimate.reasons = TACTILED_MISSING_CHANNEL;
            return estimate;
        }
        bool finite = true;
        for (std::size_t c = 0; c < seen_.size(); ++c) {
            if (!seen_[c]) continue;
            double sum = 0;
            for (std::size_t k = 0; k < n_; ++k) sum += matrix_[c][k] * shift[k];
            finite = finite && std::isfinite(sum);
            estimate.wrench_S[c] = sum;
        }
        if (!finite) {
            estimate.wrench_S = kUnseen;
            estimate.reasons = TACTILED_NOT_FINITE;
            return estimate;
        }
        if (domain_.outside(reading.channel, needed_)) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        // Beyond the rail the true channel may be anything, so no standard deviation would be true.
        if ((reading.saturated & needed_) != 0) estimate.reasons |= TACTILED_SATURATED | TACTILED_UNKNOWN_UNCERTAINTY;
        if (!sd_known_) estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        if ((estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY) == 0) estimate.sd = sd_;
        estimate.quality = estimate.reasons == 0 ? TACTILED_GOOD : TACTILED_UNCERTAIN;
        return estimate;
    }

    [[nodiscard]] std::string_view method() const noexcept override { return "matrix"; }

private:
    std::size_t n_;
    std::array<std::array<double, kMost>, 6> matrix_{};
    std::array<double, kMost> zero_{};
    std::array<bool, 6> seen_{};
    std::uint32_t needed_ = 0;  // bit k: some component has a nonzero coefficient for channel k
    Wrench sd_ = kUnseen;
    Domain domain_;
    bool sd_known_;
};

// What would make the matrix unusable, "" where nothing does. A calibration may come from code as well as from a file.
std::string fault_of(const Calibration& calibration) {
    const std::size_t n = calibration.channels.size(), rows = calibration.components.size();
    if (n == 0 || n > kMost) return fmt::format("{} channels; a sensor has 1 .. {}", n, kMost);
    if (rows == 0) return "components is empty; name at least one of fx fy fz mx my mz";
    if (calibration.zero.size() != n) return fmt::format("zero has {} numbers for {} channels", calibration.zero.size(), n);
    if (calibration.matrix.size() != rows)
        return fmt::format("matrix has {} rows for {} components", calibration.matrix.size(), rows);
    for (const auto& row : calibration.matrix)
        if (row.size() != n) return fmt::format("a row of matrix has {} numbers for {} channels", row.size(), n);
    return fault_of_shared_parts(calibration);
}

std::unique_ptr<Decoupler> make(const Calibration& calibration, const std::string&, Options& options) {
    if (const std::string fault = fault_of(calibration); !fault.empty()) {
        options.problem("calibration", calibration.path + ": " + fault);
        return nullptr;
    }
    return std::make_unique<Generic>(calibration);
}

const DecouplerEntry entry("generic", {"matrix"}, make);

}  // namespace
}  // namespace tactiled
