// Chooses the method that a calibration runs with.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "decoupling/auto_method.hpp"
#include "decoupling/method.hpp"
#include "decoupling/monitor.hpp"
#include "decoupling/temperature.hpp"
#include "decoupling/unloading.hpp"

namespace tactiled {
namespace {

// Returns the calibration for `method`. Its standard deviation holds for the method whose errors it was computed
// from, and for a method that names it.
Calibration fit_for(const Calibration& calibration, const MethodEntry& method) {
    const std::string name(method.method);
    Calibration one = calibration.with_method(name);
    // A calibration without a method uses the model's default.
    const bool is_default = method_names(calibration.model).front() == name;
    const bool fitted = (calibration.method.empty() && is_default) || calibration.method == name ||
                        std::ranges::find(calibration.others, name, &Fit::method) != calibration.others.end();
    if (!fitted && calibration.method != method.sd_of) {
        one.sd.clear();
        one.sd_slope.clear();
        one.sd_load.clear();
        one.sd_unloading.clear();
        one.sd_noise.clear();
        one.correlation.clear();
        one.alike.clear();
    }
    return one;
}

// Returns the fault of a method name in the calibration's file that its model does not have.
std::string fault_of_fitted_names(const Calibration& calibration) {
    std::vector<std::string> fitted;
    if (!calibration.method.empty()) fitted.push_back(calibration.method);
    for (const Fit& other : calibration.others) fitted.push_back(other.method);
    const auto known = method_names(calibration.model);
    for (const auto& name : fitted)
        if (find_method(calibration.model, name) == nullptr)
            return fmt::format("{}: model \"{}\" has no method \"{}\"; it has {}{}", calibration.path, calibration.model,
                               name, fmt::join(known, " "), or_did_you_mean(name, known));
    return "";
}

}  // namespace

std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, const std::string& wanted, double budget_us,
                                          DecouplerFault& fault) {
    const auto refuse = [&](const char* key, const std::string& text) {
        fault = {key, text};
        return nullptr;
    };
    if (const std::string text = fault_of_methods(); !text.empty()) return refuse("model", text);
    const auto known = method_names(calibration.model);
    if (known.empty())
        return refuse("model", fmt::format("{}: model \"{}\" {}", calibration.path, calibration.model,
                                           is_unknown(calibration.model, model_names())));
    if (const std::string text = fault_of_fitted_names(calibration); !text.empty()) return refuse("calibration", text);
    if (wanted == "auto") {
        std::vector<MethodCost> measured_now;
        return make_auto_method(calibration, budget_us, measured_now, fault);
    }
    const std::string name = !wanted.empty() ? wanted : !calibration.method.empty() ? calibration.method : known.front();
    const MethodEntry* method = find_method(calibration.model, name);
    if (method == nullptr)
        return refuse("method", fmt::format("method = \"{}\": model \"{}\" has {} (or auto){}", name, calibration.model,
                                            fmt::join(known, " "), or_did_you_mean(name, known)));
    std::string text = fault_of_monitor(calibration);
    if (text.empty()) text = fault_of_temperature(calibration);
    if (!text.empty()) return refuse("calibration", fmt::format("{}: {}", calibration.path, text));
    const Calibration own = fit_for(calibration, *method);
    if (make_method(*method, own, text) == nullptr)
        return refuse("calibration", fmt::format("{}: method {}: {}", calibration.path, name, text));
    return with_temperature(calibration, [method, own] {
        std::string no_fault;
        return with_monitor(own, with_unloading(own, make_method(*method, own, no_fault)));
    });
}

std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, const std::string& method, double budget_us) {
    DecouplerFault fault;
    auto decoupler = make_decoupler(calibration, method, budget_us, fault);
    if (decoupler == nullptr && fault.key == "method") throw SetupError(fmt::format("{}: {}", calibration.path, fault.text));
    if (decoupler == nullptr) throw SetupError(fault.text);
    return decoupler;
}

}  // namespace tactiled
