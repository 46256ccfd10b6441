// The time of each check around a method: with all of them, and without one of them.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "consistency.hpp"

namespace tactiled {
namespace {

constexpr int kRuns = 9;

// Returns the ns per sample of the fastest of several runs over the readings.
double fastest_ns(const Candidate& candidate, const std::vector<Reading>& readings, double delay_s) {
    const auto decoupler = candidate.make();
    Wrench of_components_s;
    of_components_s.fill(delay_s);
    double fastest = 1e300, sum = 0;
    for (int run = 0; run < kRuns; ++run) {
        Latency latency;
        latency.set_delay(of_components_s);
        const auto begun = std::chrono::steady_clock::now();
        for (const Reading& reading : readings) {
            Estimate e = decoupler->decouple(reading);
            latency.widen(e.wrench_S, reading.t_ns, e.sd);
            sum += e.sd[0];
        }
        const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - begun;
        fastest = std::min(fastest, took.count() / double(readings.size()));
    }
    return sum == 1 ? 0 : fastest;  // `sum` keeps the work
}

}  // namespace

void print_costs(const std::vector<ctl::Contest>& contests) {
    fmt::print("{:<24} {:>9} {:>8} {:>9} {:>8} {:>8}\n", "method, ns a sample", "channels", "all", "monitor", "latency",
               "sd_load");
    for (const ctl::Contest& contest : contests)
        for (const Candidate& candidate : contest.candidates) {
            std::vector<double> storage;
            const auto readings = ctl::readings_of(candidate, contest.trials.front().rows, storage);
            Candidate no_monitor = candidate;
            no_monitor.calibration.monitor = {};
            const double all = fastest_ns(candidate, readings, 0.01), monitor = all - fastest_ns(no_monitor, readings, 0.01);
            const double latency = all - fastest_ns(candidate, readings, 0);
            Candidate no_load = candidate;
            no_load.calibration.sd_load.clear();
            const double load = candidate.calibration.sd_load.empty() ? 0 : all - fastest_ns(no_load, readings, 0.01);
            fmt::print("{:<24} {:>9} {:>8.0f} {:>9.0f} {:>8.0f} {:>8.0f}\n", contest.model + "/" + candidate.name,
                       candidate.calibration.channels.size(), all, monitor, latency, load);
        }
}

}  // namespace tactiled
