#include "decoupling/auto_method.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "decoupling/accuracy.hpp"

namespace tactiled {
namespace {

// 48 samples of each of five methods take 40 ms with their pauses, if a pause ends 60 us late.
constexpr int kSamples = 48, kWarmUp = 4;
constexpr std::chrono::microseconds kPause{100};
// A cheaper method that saves less than this does not justify its loss of accuracy.
constexpr double kWorth = MethodChoice::kRoom;

std::vector<double> costs_of(const std::vector<FrontMethod>& methods) {
    std::vector<double> us;
    for (const auto& each : methods) us.push_back(each.cost.us);
    return us;
}

// Returns readings spread over the calibration's domain; its zero if it has no domain.
std::vector<double> reading_number(const Calibration& calibration, int number) {
    std::vector<double> channel = calibration.zero;
    if (calibration.channel_least.empty()) return channel;
    for (std::size_t k = 0; k < channel.size(); ++k) {
        const double share = double((number * 7 + int(k) * 3) % kSamples) / kSamples;
        channel[k] = std::lerp(calibration.channel_least[k], calibration.channel_most[k], share);
    }
    return channel;
}

// Returns the fitted methods without their costs; none, with `fault` set, if one of them is wrong.
std::vector<FrontMethod> fitted_methods(const Calibration& calibration, DecouplerFault& fault) {
    std::vector<std::string> fitted{calibration.method};
    for (const Fit& other : calibration.others) fitted.push_back(other.method);
    std::vector<FrontMethod> methods;
    for (const auto& method : fitted) {
        const Calibration one = calibration.with_method(method);
        auto decoupler = make_decoupler(one, method, 0, fault);
        if (decoupler == nullptr) return {};
        const std::string name{decoupler->method()};
        methods.push_back({{name, 0}, inaccuracy(one), std::move(decoupler)});
    }
    return methods;
}

// Measures as the daemon's pipeline runs the methods: one sample after a pause in which caches and clock become cold,
// the methods alternating, so that a disturbance affects all of them. The measured time is the one that the pipeline
// judges: the time that 7 in 8 samples do not exceed.
void measure(std::vector<FrontMethod>& methods, const Calibration& calibration) {
    using Clock = std::chrono::steady_clock;
    std::vector<std::vector<double>> us(methods.size());
    for (int number = -kWarmUp; number < kSamples; ++number) {
        const std::vector<double> channel = reading_number(calibration, number + kWarmUp);
        for (std::size_t m = 0; m < methods.size(); ++m) {
            std::this_thread::sleep_for(kPause);
            const Reading reading{.channel = channel, .t_ns = std::uint64_t(number + kWarmUp + 1) * 1'000'000};
            const auto begun = Clock::now();
            (void)methods[m].decoupler->decouple(reading);
            const auto ended = Clock::now();
            if (number >= 0) us[m].push_back(std::chrono::duration<double, std::micro>(ended - begun).count());
        }
    }
    for (std::size_t m = 0; m < methods.size(); ++m) {
        const auto at = us[m].begin() + kSamples * 7 / 8 - 1;
        std::nth_element(us[m].begin(), at, us[m].end());
        methods[m].cost.us = std::max(*at, 1e-3);  // the clock may have a coarser resolution than that
    }
}

// Returns false if the cost of one of them is unknown.
bool take_known(std::vector<FrontMethod>& methods, const std::vector<MethodCost>& costs) {
    for (auto& each : methods) {
        const auto known = std::ranges::find(costs, each.cost.method, &MethodCost::method);
        if (known == costs.end() || !(known->us > 0) || !std::isfinite(known->us)) return false;
        each.cost.us = known->us;
    }
    return true;
}

// Returns the most accurate method, and then each method that is sufficiently cheaper than the one before.
std::vector<FrontMethod> front_of(std::vector<FrontMethod> methods) {
    const bool any_known =
        std::any_of(methods.begin(), methods.end(), [](const FrontMethod& each) { return std::isfinite(each.inaccuracy); });
    if (any_known) std::erase_if(methods, [](const FrontMethod& each) { return !std::isfinite(each.inaccuracy); });
    std::stable_sort(methods.begin(), methods.end(), [](const FrontMethod& a, const FrontMethod& b) {
        return a.inaccuracy != b.inaccuracy ? a.inaccuracy < b.inaccuracy : a.cost.us < b.cost.us;
    });
    std::vector<FrontMethod> front;
    for (auto& each : methods)
        if (front.empty() || (front.size() < MethodChoice::kMax && each.cost.us <= kWorth * front.back().cost.us))
            front.push_back(std::move(each));
    return front;
}

}  // namespace

AutoMethod::AutoMethod(std::vector<FrontMethod> front, double budget_us)
    : front_(std::move(front)), choice_(costs_of(front_), budget_us) {}

void AutoMethod::took(std::uint64_t ns, std::uint64_t t_ns) noexcept {
    const std::size_t before = choice_.now();
    choice_.took(ns, t_ns);
    if (choice_.now() != before) front_[choice_.now()].decoupler->forget();
}

std::unique_ptr<AutoMethod> make_auto_method(const Calibration& calibration, double budget_us,
                                             std::vector<MethodCost>& costs, DecouplerFault& fault) {
    auto methods = fitted_methods(calibration, fault);
    if (methods.empty()) return nullptr;
    if (!take_known(methods, costs)) {
        measure(methods, calibration);
        costs.clear();
        for (const auto& each : methods) costs.push_back(each.cost);
        methods = fitted_methods(calibration, fault);  // rebuilt, because the measurement has changed the state of these
        (void)take_known(methods, costs);
    }
    return std::make_unique<AutoMethod>(front_of(std::move(methods)), budget_us);
}

}  // namespace tactiled
