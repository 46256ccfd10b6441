#include "decoupling/unloading.hpp"

#include <utility>

#include "decoupling/solve/load_scale.hpp"

namespace tactiled {
namespace {

class Unloaded final : public Decoupler {
public:
    Unloaded(const Calibration& calibration, std::unique_ptr<Decoupler> inner)
        : inner_(std::move(inner)), scale_(calibration) {
        for (std::size_t i = 0; i < calibration.components.size(); ++i)
            sd_[component_index(calibration.components[i])] = calibration.sd_unloading[i];
    }
    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        Estimate estimate = inner_->decouple(reading);
        if (!estimate.has_value) {
            peak_.forget();
            return estimate;
        }
        Wrench tared = estimate.wrench_S;
        for (std::size_t c = 0; c < tared.size(); ++c) tared[c] -= reading.zero_S[c];
        const double below_peak = peak_.next(scale_.of(tared), reading.t_ns);
        // Squares, because hypot() takes several times as long. NaN: not measured, or sd unknown.
        for (std::size_t c = 0; c < sd_.size(); ++c) {
            const double more = sd_[c] * below_peak;
            if (more > 0) estimate.sd[c] = std::sqrt(estimate.sd[c] * estimate.sd[c] + more * more);
        }
        return estimate;
    }
    void forget() noexcept override {
        peak_.forget();
        inner_->forget();
    }
    void set_delay(std::span<const double> of_channel_s) noexcept override { inner_->set_delay(of_channel_s); }
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override { return inner_->timed_by(c); }
    void set_temperature(const TemperatureInUse& in_use) noexcept override { inner_->set_temperature(in_use); }
    [[nodiscard]] std::string_view method() const noexcept override { return inner_->method(); }

private:
    std::unique_ptr<Decoupler> inner_;
    LoadScale scale_;
    Wrench sd_{};
    LoadPeak peak_;
};

}  // namespace

double load_of(const Wrench& wrench_S, const Calibration& calibration) noexcept {
    return LoadScale(calibration).of(wrench_S);
}

std::unique_ptr<Decoupler> with_unloading(const Calibration& calibration, std::unique_ptr<Decoupler> inner) {
    const std::size_t n = calibration.components.size();
    if (inner == nullptr || calibration.sd_unloading.size() != n || calibration.full_scale.size() != n) return inner;
    return std::make_unique<Unloaded>(calibration, std::move(inner));
}

}  // namespace tactiled
