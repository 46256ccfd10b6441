// Which method of a calibration runs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "decoupling/decoupler.hpp"

namespace tactiled {
namespace {

constexpr int kTrials = 51, kCallsPerTrial = 20;

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

// Held-out standard deviation in full scales, mean over the components; infinite where it is not known.
double inaccuracy(const Calibration& calibration) {
    const std::size_t n = calibration.components.size();
    if (calibration.sd.size() != n || calibration.full_scale.size() != n || n == 0)
        return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double slope = calibration.sd_slope.empty() ? 0.0 : calibration.sd_slope[i];
        sum += std::hypot(calibration.sd[i] / calibration.full_scale[i], slope / 2);  // at half of full scale
    }
    return sum / double(n);
}

// Median cost of a sample, on readings spread over the calibration's domain.
double cost_us(Decoupler& decoupler, const Calibration& calibration) {
    const std::size_t n = calibration.channels.size();
    std::vector<double> us, channel = calibration.zero;
    std::uint64_t t_ns = 1;
    for (int trial = 0; trial < kTrials; ++trial) {
        const auto begun = std::chrono::steady_clock::now();
        for (int call = 0; call < kCallsPerTrial; ++call) {
            if (!calibration.channel_least.empty())
                for (std::size_t k = 0; k < n; ++k) {
                    const double share = double((call * 7 + int(k) * 3) % kCallsPerTrial) / kCallsPerTrial;
                    channel[k] = std::lerp(calibration.channel_least[k], calibration.channel_most[k], share);
                }
            (void)decoupler.decouple({.channel = channel, .t_ns = t_ns += 1'000'000});
        }
        us.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begun).count() /
                     kCallsPerTrial);
    }
    std::nth_element(us.begin(), us.begin() + kTrials / 2, us.end());
    return us[kTrials / 2];
}

std::unique_ptr<Decoupler> most_accurate(const DecouplerEntry& entry, const Calibration& calibration, double budget_us,
                                         Options& options) {
    std::vector<std::string> fitted{calibration.method};
    for (const Fit& other : calibration.others) fitted.push_back(other.method);
    std::string best, fastest;
    double least_inaccuracy = std::numeric_limits<double>::infinity(), least_us = least_inaccuracy;
    for (const auto& method : fitted) {
        const Calibration one = calibration.with_method(method);
        const auto decoupler = entry.make(one, method, options);
        if (decoupler == nullptr) return nullptr;  // a fit that is wrong is said, not skipped
        const double us = cost_us(*decoupler, one);
        if (us < least_us) {
            least_us = us;
            fastest = method;
        }
        if (us > budget_us || inaccuracy(one) >= least_inaccuracy) continue;
        least_inaccuracy = inaccuracy(one);
        best = method;
    }
    if (best.empty()) best = fastest;
    return entry.make(calibration.with_method(best), best, options);
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
    if (wanted == "auto") return most_accurate(*entry, calibration, budget_us, options);
    const std::string method = !wanted.empty()               ? wanted
                               : !calibration.method.empty() ? calibration.method
                                                             : entry->methods.front();
    if (!has(method))
        return refuse("method", fmt::format("method = \"{}\": model \"{}\" has {} (or auto)", method, calibration.model,
                                            fmt::join(entry->methods, " ")));
    return entry->make(fit_for(calibration, method), method, options);
}

}  // namespace tactiled
