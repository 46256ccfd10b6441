// Method "auto": several prepared methods, of which one runs. MethodChoice selects it from the times that the caller
// reports; nothing here reads a clock in the loop.
//
// A method gets no readings while another method runs, and is reset when it runs again. Then "map" searches again, and
// methods whose values need a past ("nonlinear" with hysteresis, "fused") report unknown-uncertainty until they have enough
// readings.
#pragma once
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/method_choice.hpp"

namespace tactiled {

// Time that a method needs for a sample on this machine: 7 of 8 samples take at most this long, including the reading
// of the clock.
struct MethodCost {
    std::string method;
    double us = 0;
    bool operator==(const MethodCost&) const = default;
};

// A method of the front: a more accurate one costs more.
struct FrontMethod {
    MethodCost cost;
    double inaccuracy = 0;  // see accuracy.hpp
    std::unique_ptr<Decoupler> decoupler;
};

class AutoMethod final : public Decoupler {
public:
    // `front`: 1 .. MethodChoice::kMax methods, most accurate first, with falling costs. setup
    AutoMethod(std::vector<FrontMethod> front, double budget_us);

    // Uses the method that runs now. rt: as that method
    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        return front_[choice_.now()].decoupler->decouple(reading);
    }
    // Runs method `index` of the front, which is not the present method, from its initial state. rt: as that method
    [[nodiscard]] Estimate decouple_anew(std::size_t index, const Reading& reading) noexcept {
        front_[index].decoupler->forget();
        return front_[index].decoupler->decouple(reading);
    }
    // Reports that the last decouple(), of a reading at `t_ns`, took `ns`. The next one may use another method.
    // rt: wait-free
    void took(std::uint64_t ns, std::uint64_t t_ns) noexcept;
    void set_temperature(const TemperatureInUse& in_use) noexcept override {
        for (FrontMethod& each : front_) each.decoupler->set_temperature(in_use);
    }
    void set_delay(std::span<const double> of_channel_s) noexcept override {
        for (FrontMethod& each : front_) each.decoupler->set_delay(of_channel_s);
    }
    // The channels of all methods, since each may run.
    [[nodiscard]] std::uint32_t timed_by(std::size_t c) const noexcept override {
        std::uint32_t channels = 0;
        for (const FrontMethod& each : front_) channels |= each.decoupler->timed_by(c);
        return channels;
    }
    void forget() noexcept override { front_[choice_.now()].decoupler->forget(); }

    // Returns the name of the method that runs now.
    [[nodiscard]] std::string_view method() const noexcept override { return front_[choice_.now()].decoupler->method(); }
    [[nodiscard]] const std::vector<FrontMethod>& front() const noexcept { return front_; }
    [[nodiscard]] const MethodChoice& choice() const noexcept { return choice_; }

private:
    std::vector<FrontMethod> front_;
    MethodChoice choice_;
};

// Makes the front of accuracy against time. It has the methods with a fit and a standard deviation in the calibration; if
// there is none, the fastest method. `costs` are used if they contain all of these methods, else they are measured in less
// than 0.1 s and stored there. Returns nullptr with `fault` set if a fit is wrong or the model is unknown. setup
std::unique_ptr<AutoMethod> make_auto_method(const Calibration& calibration, double budget_us,
                                             std::vector<MethodCost>& costs, DecouplerFault& fault);

}  // namespace tactiled
