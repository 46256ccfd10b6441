// Taxels with a calibration of their own, of any model that has fz: capacitive pads, hairs, tables. One for all, or one
// each.
#pragma once
#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled {

struct TaxelForces;

class TaxelModels {
public:
    // For n taxels, whose values are the channels of each calibration. Without `taxels` in the calibration it is empty.
    // setup
    TaxelModels(const Calibration& array, std::size_t n, std::string& fault);

    [[nodiscard]] bool is_empty() const noexcept { return models_.empty(); }
    // All taxels have one calibration: its errors are common to them. setup
    [[nodiscard]] bool is_common() const noexcept { return is_common_; }
    // fx and fy, as well as fz, are measured. setup
    [[nodiscard]] bool sees_shear() const noexcept { return sees_shear_; }
    // Without a load, N in the components of a taxel's frame, the largest of all calibrations, and the largest slope of the
    // press; 0 = unknown. setup
    [[nodiscard]] const std::array<float, 3>& sd_at_rest() const noexcept { return sd_at_rest_; }
    [[nodiscard]] float gain_sd() const noexcept { return gain_sd_; }
    void set_temperature(const TemperatureInUse& in_use) noexcept;

    // Sets forces, sd and states of all taxels in their frames. `zero`: raw numbers without a load, value v of taxel i at
    // v n + i. A taxel without a value of its own has the force NaN. Returns the reasons that no state tells. rt: wait-free
    std::uint32_t apply(const Reading& reading, std::span<const float> zero, double counts_per_unit,
                        std::array<std::vector<float>, 3>& force, TaxelForces& out) noexcept;
    void forget() noexcept;

private:
    [[nodiscard]] std::string add(const Calibration& array, const Calibration& taxel);

    std::vector<std::unique_ptr<Decoupler>> models_;  // one for each taxel
    std::vector<double> zero_;  // in channel_unit, from the calibrations: all values of a taxel side by side
    bool is_common_ = false, sees_shear_ = true;
    std::array<float, 3> sd_at_rest_{};
    float gain_sd_ = 0;
};

}  // namespace tactiled
