// The methods that decouple_bench measures, with the checks of each level around them, and readings of a moving load.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"
#include "decoupling/latency.hpp"

namespace tactiled::testing {

constexpr std::size_t kReadings = 1024;
enum Level : std::size_t { kNone, kMonitor, kChecks, kLevels };
constexpr const char* kLevelNames[] = {"none", "monitor", "checks"};

// A method with the checks of a level around it.
struct Variant {
    std::unique_ptr<Decoupler> decoupler;
    std::optional<Latency> latency = {};
    std::vector<double> warm_ns = {}, cold_ns = {};  // a sample
};
struct Case {
    std::string name;
    std::optional<Variant> level[kLevels];  // absent if the calibration lacks it
    std::vector<std::vector<double>> readings;
};

// `only` of them, "" = all; `known`: their names. `skin_n` rows to fit generic; mlp has 600: its fit takes a minute with
// 2,000, and its time does not depend on them.
std::vector<Case> all_cases(const std::string& only, std::size_t skin_n, std::vector<std::string>& known);

}  // namespace tactiled::testing
