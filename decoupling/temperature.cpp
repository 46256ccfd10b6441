#include "decoupling/temperature.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "config/names.hpp"
#include "decoupling/solve/domain.hpp"

namespace tactiled {
namespace {

constexpr double kMargin_K = 0.5;  // beyond the range that the calibration covered, or that is declared
constexpr double kLarge = 0.1;     // share of full scale above which the term makes a value UNCERTAIN
constexpr double kStep_K = 1;      // width of the differences that give the effect per kelvin

class WithTemperature final : public Decoupler {
public:
    WithTemperature(const Calibration& calibration, std::unique_ptr<Decoupler> inner, MakeDecoupler make)
        : inner_(std::move(inner)),
          make_(std::move(make)),
          temperature_(calibration.temperature),
          is_fitted_(!calibration.temperature.zero_per_K.empty()),
          n_(calibration.channels.size()),
          zero_(is_fitted_ ? temperature_.zero : calibration.zero),
          middle_(calibration.monitor.mean) {
        large_squared_.fill(kNaN);
        for (std::size_t i = 0; i < calibration.components.size(); ++i) {
            const std::size_t c = component_index(calibration.components[i]);
            is_seen_[c] = true;
            if (i >= calibration.full_scale.size()) continue;
            const double large = kLarge * calibration.full_scale[i];
            large_squared_[c] = large * large;
        }
        zero_per_K_ = temperature_.zero_per_K;
        for (const double gain : temperature_.gain_per_K) gain_per_K_ = std::max(gain_per_K_, std::abs(gain));
        for (const double sd : temperature_.gain_per_K_sd) gain_sd_per_K_ = std::max(gain_sd_per_K_, sd);
        if (const TemperatureEffect* const effect = temperature_effect(calibration); effect != nullptr) {
            gain_per_K_ = effect->gain_per_K;
            for (const double zero : zero_)
                zero_per_K_.push_back(effect->channel_unit.empty()                       ? effect->zero_per_K * zero
                                      : effect->channel_unit == calibration.channel_unit ? effect->zero_per_K
                                                                                         : kNaN);
        }
    }

    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        if (reading.channel.size() != n_) return inner_->decouple(reading);
        const double t_C = reading.temperature_C;
        const bool is_known = is_fitted_ && std::isfinite(t_C);
        Estimate estimate = is_known ? at_reference_temperature(reading) : inner_->decouple(reading);
        if (!estimate.has_value) return estimate;
        widen(is_known ? measured_ : unmeasured_, is_known ? t_C - temperature_.reference_C : 0, estimate);
        // Both comparisons are false for a NaN.
        const bool is_beyond = t_C < lowest_C_ || t_C > highest_C_;
        if (is_beyond) estimate.reasons |= TACTILED_TEMPERATURE;
        return estimate;
    }
    void forget() noexcept override { inner_->forget(); }
    void set_delay(std::span<const double> of_channel_s) noexcept override { inner_->set_delay(of_channel_s); }
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override { return inner_->timed_by(c); }
    void set_temperature(const TemperatureInUse& in_use) noexcept override {
        const double declared_K = in_use.highest_C - in_use.lowest_C;  // NaN: not declared
        // Without a thermometer the reading is taken as one at the reference, from which the range may be far.
        const double from_reference_K = std::max(std::abs(in_use.highest_C - temperature_.reference_C),
                                                 std::abs(in_use.lowest_C - temperature_.reference_C));
        const double width_K = is_fitted_ ? from_reference_K : std::isfinite(declared_K) ? declared_K : kRoom_K;
        const double sd_K = std::isfinite(in_use.sd_K) ? in_use.sd_K : kUnstated_K;
        const double difference_K = std::isfinite(in_use.difference_K) ? in_use.difference_K
                                    : !temperature_.dummy.empty()      ? temperature_.dummy_difference_K
                                                                       : std::fmin(kUnstated_K, width_K + sd_K);
        const Effect per_K = effect_of_a_kelvin(std::isfinite(width_K) ? width_K : kStep_K);
        measured_ = term(per_K, std::isfinite(in_use.sd_K) ? std::hypot(difference_K, sd_K) : difference_K, difference_K);
        unmeasured_ = term(per_K, std::hypot(width_K, sd_K), difference_K);
        const double gain_sd = std::isfinite(width_K) ? gain_sd_per_K_ * std::hypot(width_K, sd_K) : 0;
        unmeasured_.gain_squared += gain_sd * gain_sd;
        // The coefficient of the dummy errs in all channels together, those of the channels err each.
        const double scale_sd = temperature_.dummy_per_K_sd / std::abs(temperature_.dummy_per_K);
        for (std::size_t c = 0; c < 6 && is_fitted_; ++c) {
            if (!is_seen_[c]) continue;
            const double alike = per_K.alike[c] * scale_sd;
            measured_.squared_per_K2[c] = alike * alike + per_K.coefficient[c] * per_K.coefficient[c];
            measured_.is_known = measured_.is_known && std::isfinite(measured_.squared_per_K2[c]);
        }
        measured_.gain_squared_per_K2 = gain_sd_per_K_ * gain_sd_per_K_;
        if (std::isfinite(declared_K)) {
            lowest_C_ = std::max(lowest_C_, in_use.lowest_C - kMargin_K);
            highest_C_ = std::min(highest_C_, in_use.highest_C + kMargin_K);
        }
    }
    [[nodiscard]] std::string_view method() const noexcept override { return inner_->method(); }

private:
    // Change of the wrench per kelvin: of all channels together, and of each channel alone (root of the sum of squares); of
    // each channel by one standard deviation of its coefficient.
    struct Effect {
        Wrench alike{}, each{}, coefficient{};
    };
    // The contribution to the standard deviation: squares, 0 for a component that is not measured.
    struct Term {
        Wrench squared{}, squared_per_K2{};                // and in addition for each kelvin from the reference temperature
        double gain_squared = 0, gain_squared_per_K2 = 0;  // relative to the component; likewise
        bool is_known = true;
    };

    [[nodiscard]] Estimate at_reference_temperature(const Reading& reading) noexcept {
        double channel[kMaxChannels];
        for (std::size_t k = 0; k < n_; ++k)
            channel[k] = at_reference(temperature_, k, reading.channel[k], reading.temperature_C);
        Reading used = reading;
        used.channel = {channel, n_};
        return inner_->decouple(used);
    }

    void widen(const Term& term, double from_K, Estimate& estimate) const noexcept {
        const double from_K2 = from_K * from_K, gain_squared = term.gain_squared + term.gain_squared_per_K2 * from_K2;
        bool is_large = false;
        for (std::size_t c = 0; c < 6; ++c) {
            const double squared = term.squared[c] + term.squared_per_K2[c] * from_K2;
            const double of_gain = gain_squared * estimate.wrench_S[c] * estimate.wrench_S[c];
            estimate.temperature[c] = std::sqrt(squared + of_gain);
            estimate.sd[c] = std::sqrt(estimate.sd[c] * estimate.sd[c] + squared + of_gain);
            is_large |= squared > large_squared_[c];  // not with NaN
        }
        if (!term.is_known) {
            estimate.sd = kUnseen;
            estimate.reasons |= TACTILED_TEMPERATURE | TACTILED_UNKNOWN_UNCERTAINTY;
        }
        if (is_large) estimate.reasons |= TACTILED_TEMPERATURE;
    }

    // Returns the change of the wrench per kelvin, from half of `step_K` below to half of it above the reading `at`, if the
    // channels change by `per_K`; for all channels, or for channel `only`.
    [[nodiscard]] Wrench change(Decoupler& examined, const std::vector<double>& at, const std::vector<double>& per_K,
                                double step_K, std::size_t only) const noexcept {
        double above[kMaxChannels], below[kMaxChannels];
        for (std::size_t k = 0; k < n_; ++k) {
            const double half = only == kAll || only == k ? per_K[k] * step_K / 2 : 0;
            above[k] = at[k] + half;
            below[k] = at[k] - half;
        }
        const Estimate a = examined.decouple({.channel = {above, n_}});
        examined.forget();
        const Estimate b = examined.decouple({.channel = {below, n_}});
        examined.forget();
        Wrench change;
        for (std::size_t c = 0; c < 6; ++c) change[c] = (a.wrench_S[c] - b.wrench_S[c]) / step_K;
        return change;
    }

    // Returns the root of the sum of the squares of the changes by each channel alone.
    [[nodiscard]] Wrench root_of_changes(Decoupler& examined, const std::vector<double>& at,
                                         const std::vector<double>& per_K, double step_K) const noexcept {
        Wrench squares{};
        for (std::size_t k = 0; k < n_; ++k) {
            const Wrench one = change(examined, at, per_K, step_K, k);
            for (std::size_t c = 0; c < 6; ++c) squares[c] += one[c] * one[c];
        }
        for (double& square : squares) square = std::sqrt(square);
        return squares;
    }

    // Returns the largest effect at no load and at the middle of the calibration's rows, over one kelvin and over the range,
    // because a method need not be linear. NaN if the method has no value in any of them.
    [[nodiscard]] Effect effect_of_a_kelvin(double width_K) noexcept {
        Effect largest{kUnseen, kUnseen, kUnseen};
        const std::unique_ptr<Decoupler> examined = make_();
        if (examined == nullptr) return largest;
        const auto take = [](Wrench& most, const Wrench& one) {
            for (std::size_t c = 0; c < 6; ++c)
                if (!(std::abs(one[c]) <= most[c])) most[c] = std::isnan(one[c]) ? most[c] : std::abs(one[c]);
        };
        for (const std::vector<double>* at : {&zero_, &middle_}) {
            if (at->size() != n_) continue;
            for (const double step_K : {kStep_K, std::max(kStep_K, width_K)}) {
                take(largest.alike, change(*examined, *at, zero_per_K_, step_K, kAll));
                take(largest.each, root_of_changes(*examined, *at, zero_per_K_, step_K));
                take(largest.coefficient, temperature_.zero_per_K_sd.empty()
                                              ? Wrench{}
                                              : root_of_changes(*examined, *at, temperature_.zero_per_K_sd, step_K));
            }
        }
        return largest;
    }

    // Returns the term for a temperature that is unknown within `alike_K` for all channels, and that differs by `each_K`
    // between channels. The effect of 0 K is 0, even if the effect per kelvin is unknown.
    [[nodiscard]] Term term(const Effect& per_K, double alike_K, double each_K) const noexcept {
        Term term;
        const double gain = std::isfinite(alike_K) ? gain_per_K_ * alike_K : 0;
        term.gain_squared = gain * gain;
        const auto part = [](double effect, double kelvin) { return kelvin == 0 ? 0 : effect * kelvin; };
        for (std::size_t c = 0; c < 6; ++c) {
            if (!is_seen_[c]) continue;
            const double change = std::hypot(part(per_K.alike[c], alike_K), part(per_K.each[c], each_K));
            term.is_known = term.is_known && std::isfinite(change);
            term.squared[c] = change * change;
        }
        return term;
    }

    static constexpr std::size_t kAll = kMaxChannels;

    std::unique_ptr<Decoupler> inner_;
    MakeDecoupler make_;
    Temperature temperature_;
    bool is_fitted_;
    std::size_t n_;
    std::vector<double> zero_, middle_, zero_per_K_;
    double gain_per_K_ = 0, gain_sd_per_K_ = 0;
    std::array<bool, 6> is_seen_{};
    Wrench large_squared_{};  // squares of the standard deviations above which a component is UNCERTAIN
    Term measured_{}, unmeasured_{.squared = {}, .squared_per_K2 = {}, .is_known = !is_fitted_};
    double lowest_C_ = is_fitted_ ? temperature_.range_C[0] - kMargin_K : -std::numeric_limits<double>::infinity();
    double highest_C_ = is_fitted_ ? temperature_.range_C[1] + kMargin_K : std::numeric_limits<double>::infinity();
};

}  // namespace

double at_reference(const Temperature& temperature, std::size_t k, double reading, double temperature_C) noexcept {
    const double from_K = temperature_C - temperature.reference_C, zero = temperature.zero[k];
    return zero + (reading - zero - temperature.zero_per_K[k] * from_K) / (1 + temperature.gain_per_K[k] * from_K);
}

const TemperatureEffect* temperature_effect(std::string_view model) noexcept {
    return Registry<TemperatureEffect>::find(model);
}

const TemperatureEffect* temperature_effect(const Calibration& calibration) noexcept {
    return calibration.temperature.zero_per_K.empty() ? temperature_effect(calibration.model) : nullptr;
}

std::unique_ptr<Decoupler> with_temperature(const Calibration& calibration, MakeDecoupler make) {
    auto inner = make();
    const bool is_fitted = !calibration.temperature.zero_per_K.empty();
    if (inner == nullptr || (!is_fitted && temperature_effect(calibration) == nullptr)) return inner;
    return std::make_unique<WithTemperature>(calibration, std::move(inner), std::move(make));
}

std::string fault_of_temperature(const Calibration& calibration) {
    const Temperature& temperature = calibration.temperature;
    if (temperature.zero_per_K.empty()) return "";
    const std::size_t n = calibration.channels.size();
    if (temperature.zero.size() != n || temperature.zero_per_K.size() != n || temperature.gain_per_K.size() != n)
        return fmt::format("temperature has {} zeros, {} zero_per_K and {} gain_per_K for {} channels",
                           temperature.zero.size(), temperature.zero_per_K.size(), temperature.gain_per_K.size(), n);
    if (temperature.range_C.size() != 2) return "temperature.range_C needs two numbers, the least and the greatest";
    for (const auto* sd : {&temperature.zero_per_K_sd, &temperature.gain_per_K_sd})
        if (!sd->empty() && sd->size() != n)
            return fmt::format("temperature has {} standard deviations of coefficients for {} channels", sd->size(), n);
    return "";
}

}  // namespace tactiled
