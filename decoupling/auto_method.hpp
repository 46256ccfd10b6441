// Method "auto": several fitted methods, prepared, of which one runs. MethodChoice selects the method from the times that
// the caller reports; nothing here reads a clock in the loop.
//
// A method that was not running has not seen the readings in between. At its return it forgets what it remembered: "map"
// searches anew, and one whose values need a past ("nonlinear" with hysteresis, "fused") says unknown-uncertainty until it
// has one.
#pragma once
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/method_choice.hpp"

namespace tactiled {

// Time of a sample of a method on this machine: 7 in 8 samples need at most so long, the clock's own time included.
struct MethodCost {
    std::string method;
    double us = 0;
    bool operator==(const MethodCost&) const = default;
};

// A method of the front: what is more accurate costs more.
struct FrontMethod {
    MethodCost cost;
    double inaccuracy = 0;  // accuracy.hpp
    std::unique_ptr<Decoupler> decoupler;
};

class AutoMethod final : public Decoupler {
public:
    // `front`: most accurate first, costs falling, 1 .. MethodChoice::kMax. setup
    AutoMethod(std::vector<FrontMethod> front, double budget_us);

    // By the method that runs now. rt: as its own
    [[nodiscard]] Estimate decouple(const Reading& reading) noexcept override {
        return front_[choice_.now()].decoupler->decouple(reading);
    }
    // By method `index` of the front, for one that does not run: without a past. rt: as its own
    [[nodiscard]] Estimate decouple_anew(std::size_t index, const Reading& reading) noexcept {
        front_[index].decoupler->forget();
        return front_[index].decoupler->decouple(reading);
    }
    // The last decouple(), of a reading at `t_ns`, took so long. The next may be by another method. rt: wait-free
    void took(std::uint64_t ns, std::uint64_t t_ns) noexcept;
    void set_temperature_range(double width_K) noexcept override {
        for (FrontMethod& each : front_) each.decoupler->set_temperature_range(width_K);
    }
    void set_delay(double delay_s) noexcept override {
        for (FrontMethod& each : front_) each.decoupler->set_delay(delay_s);
    }
    void forget() noexcept override { front_[choice_.now()].decoupler->forget(); }

    // For the method that runs now.
    [[nodiscard]] std::string_view method() const noexcept override { return front_[choice_.now()].decoupler->method(); }
    [[nodiscard]] const std::vector<FrontMethod>& front() const noexcept { return front_; }
    [[nodiscard]] const MethodChoice& choice() const noexcept { return choice_; }

private:
    std::vector<FrontMethod> front_;
    MethodChoice choice_;
};

// Of the methods that the calibration has a fit and a standard deviation of (where it has of none: the fastest), those on
// the front of accuracy against time. `costs`: what was measured before, used where it names all of these methods; else it
// is measured, for less than 0.1 s, and put there. nullptr where a fit is wrong or the model unknown, and `fault` says why.
// setup
std::unique_ptr<AutoMethod> make_auto_method(const Calibration& calibration, double budget_us,
                                             std::vector<MethodCost>& costs, DecouplerFault& fault);

}  // namespace tactiled
