#include "decoupling/temperature.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/names.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kMargin_K = 0.5;  // beyond the range that the calibration covered
constexpr double kLarge = 0.1;     // share of full scale from which on the term makes a value UNCERTAIN

class AtReference final : public Decoupler {
public:
    AtReference(const Calibration& calibration, std::unique_ptr<Decoupler> inner)
        : inner_(std::move(inner)), temperature_(calibration.temperature), n_(calibration.channels.size()) {
        full_scale_.fill(kNaN);
        for (std::size_t i = 0; i < calibration.full_scale.size(); ++i)
            full_scale_[component_index(calibration.components[i])] = calibration.full_scale[i];
    }

    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        const double t_C = reading.temperature_C;
        if (reading.channel.size() != n_) return inner_->decouple(reading);
        if (!std::isfinite(t_C)) return without_temperature(reading);
        double channel[kMaxChannels];
        for (std::size_t k = 0; k < n_; ++k) channel[k] = at_reference(temperature_, k, reading.channel[k], t_C);
        Reading used = reading;
        used.channel = {channel, n_};
        Estimate estimate = inner_->decouple(used);
        const bool covered = t_C >= temperature_.range_C[0] - kMargin_K && t_C <= temperature_.range_C[1] + kMargin_K;
        if (!covered && estimate.quality != TACTILED_BAD) {
            estimate.quality = TACTILED_UNCERTAIN;
            estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        }
        return estimate;
    }
    void forget() noexcept override { inner_->forget(); }
    void set_delay(double delay_s) noexcept override { inner_->set_delay(delay_s); }
    void set_temperature_range(double width_K) noexcept override {
        width_K_ = width_K;
        // The change of the force with the zeros, from a reading at no load. It is asked a kelvin to either side.
        double above[kMaxChannels], below[kMaxChannels];
        for (std::size_t k = 0; k < n_; ++k) {
            above[k] = temperature_.zero[k] + temperature_.zero_per_K[k] * kMargin_K;
            below[k] = temperature_.zero[k] - temperature_.zero_per_K[k] * kMargin_K;
        }
        const Estimate a = inner_->decouple({.channel = {above, n_}}), b = inner_->decouple({.channel = {below, n_}});
        inner_->forget();
        for (std::size_t c = 0; c < 6; ++c) per_K_[c] = (a.wrench_S[c] - b.wrench_S[c]) / (2 * kMargin_K);
    }
    [[nodiscard]] std::string_view method() const noexcept override { return inner_->method(); }

private:
    [[nodiscard]] Estimate without_temperature(const Reading& reading) noexcept {
        Estimate estimate = inner_->decouple(reading);
        if (estimate.quality == TACTILED_BAD) return estimate;
        bool is_large = false, is_known = width_K_ > 0;
        for (std::size_t c = 0; c < 6; ++c) {
            const double drift = std::abs(per_K_[c]) * width_K_;
            is_known = is_known && (std::isfinite(drift) || std::isnan(estimate.wrench_S[c]));
            is_large = is_large || drift > kLarge * full_scale_[c];
            estimate.sd[c] = std::hypot(estimate.sd[c], drift);
        }
        if (!is_known) {
            estimate.sd = kUnseen;
            estimate.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        }
        if (is_large) estimate.reasons |= TACTILED_OUTSIDE_DOMAIN;
        if (is_large || !is_known) estimate.quality = TACTILED_UNCERTAIN;
        return estimate;
    }

    std::unique_ptr<Decoupler> inner_;
    Temperature temperature_;
    std::size_t n_;
    Wrench full_scale_{}, per_K_ = kUnseen;
    double width_K_ = 0;
};

}  // namespace

double at_reference(const Temperature& temperature, std::size_t k, double reading, double temperature_C) noexcept {
    const double from_K = temperature_C - temperature.reference_C, zero = temperature.zero[k];
    return zero + (reading - zero - temperature.zero_per_K[k] * from_K) / (1 + temperature.gain_per_K[k] * from_K);
}

std::unique_ptr<Decoupler> with_temperature(const Calibration& calibration, std::unique_ptr<Decoupler> inner) {
    if (inner == nullptr || calibration.temperature.zero_per_K.empty()) return inner;
    return std::make_unique<AtReference>(calibration, std::move(inner));
}

std::string fault_of_temperature(const Calibration& calibration) {
    const Temperature& temperature = calibration.temperature;
    if (temperature.zero_per_K.empty()) return "";
    const std::size_t n = calibration.channels.size();
    if (temperature.zero.size() != n || temperature.zero_per_K.size() != n || temperature.gain_per_K.size() != n)
        return fmt::format("temperature has {} zeros, {} zero_per_K and {} gain_per_K for {} channels",
                           temperature.zero.size(), temperature.zero_per_K.size(), temperature.gain_per_K.size(), n);
    if (temperature.range_C.size() != 2) return "temperature.range_C needs two numbers, the least and the greatest";
    return "";
}

}  // namespace tactiled
