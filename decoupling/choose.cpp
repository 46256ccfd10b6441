// Which method of a calibration runs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "decoupling/auto_method.hpp"

namespace tactiled {
namespace {

// The calibration as `method` runs it. A standard deviation speaks of the method whose errors it was taken from; "signs" is
// "linear" in steps, and adds those to it.
Calibration fit_for(const Calibration& calibration, const std::string& method) {
    Calibration one = calibration.with_method(method);
    const bool fitted = calibration.method.empty() || calibration.method == method ||
                        std::any_of(calibration.others.begin(), calibration.others.end(),
                                    [&](const Fit& other) { return other.method == method; });
    if (!fitted && !(calibration.method == "linear" && method == "signs")) {
        one.sd.clear();
        one.sd_slope.clear();
    }
    return one;
}

}  // namespace

std::unique_ptr<Decoupler> make_decoupler(const Calibration& calibration, const std::string& wanted, double budget_us,
                                          Options& options) {
    const DecouplerEntry* entry = find_decoupler(calibration.model);
    const auto refuse = [&](const char* key, const std::string& text) {
        options.problem(key, text);
        return nullptr;
    };
    if (entry == nullptr)
        return refuse("model", fmt::format("{}: model \"{}\" is unknown; known are {}", calibration.path, calibration.model,
                                           fmt::join(decoupler_names(), " ")));
    const auto has = [&](const std::string& method) {
        return std::find(entry->methods.begin(), entry->methods.end(), method) != entry->methods.end();
    };
    for (const Fit& fit : calibration.others)
        if (!has(fit.method))
            return refuse("calibration", fmt::format("{}: model \"{}\" has no method \"{}\"; it has {}", calibration.path,
                                                     calibration.model, fit.method, fmt::join(entry->methods, " ")));
    if (wanted == "auto") {
        std::vector<MethodCost> measured_now;
        return make_auto_method(calibration, budget_us, options, measured_now);
    }
    const std::string method = !wanted.empty()               ? wanted
                               : !calibration.method.empty() ? calibration.method
                                                             : entry->methods.front();
    if (!has(method))
        return refuse("method", fmt::format("method = \"{}\": model \"{}\" has {} (or auto)", method, calibration.model,
                                            fmt::join(entry->methods, " ")));
    return entry->make(fit_for(calibration, method), method, options);
}

}  // namespace tactiled
