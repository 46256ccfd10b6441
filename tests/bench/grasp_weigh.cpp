#include "tests/bench/grasp_weigh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tactiled::bench {
namespace {

constexpr int kTimes = 5;
constexpr std::size_t kBall = 3;

void append(std::vector<Outcome>& to, const std::vector<Outcome>& from) { to.insert(to.end(), from.begin(), from.end()); }

}  // namespace

std::vector<grasp::Object> taught_by(const std::vector<Outcome>& outcomes, std::size_t sensed) {
    std::vector<grasp::Object> objects;
    for (std::size_t k = 0; k < kEggsAndBall_kg.size(); ++k) {
        double n = 0, sum = 0, squares = 0;
        for (const Outcome& o : outcomes) {
            if (o.object != k || o.sensed != sensed || std::isnan(o.stable_after_s)) continue;
            const double m = o.first_stable.mass_kg;
            ++n, sum += m, squares += m * m;
        }
        const double mean = sum / n;
        objects.push_back({std::uint32_t(k + 1), fmt::format("object {}", k + 1), mean,
                           std::sqrt(std::max(0.0, squares / n - mean * mean))});
    }
    return objects;
}

Figures figures(const std::vector<Outcome>& outcomes, std::size_t object, std::size_t sensed) {
    Figures f;
    double sum = 0, squares = 0;
    std::vector<double> after_s;
    for (const Outcome& o : outcomes) {
        if ((object != SIZE_MAX && o.object != object) || o.sensed != sensed) continue;
        f.shown += (o.shown - f.shown) / ++f.n;
        if (std::isnan(o.stable_after_s)) {
            ++f.never;
            continue;
        }
        const double error = o.first_stable.mass_kg / o.mass_kg - 1, off = std::abs(error * o.mass_kg);
        sum += error;
        squares += error * error;
        f.said_sd += o.first_stable.sd_kg / o.mass_kg;
        f.in_300_ms += o.stable_after_s <= 0.3;
        f.within_1_sd += off <= o.first_stable.sd_kg;
        f.within_2_sd += off <= 2 * o.first_stable.sd_kg;
        f.right += o.object_id == o.object + 1;
        f.unknown += o.object_id == 0;
        f.wrong += o.object_id != 0 && o.object_id != o.object + 1;
        f.wrong_kind += o.object_id != 0 && (o.object_id == kBall + 1) != (o.object == kBall);
        after_s.push_back(o.stable_after_s);
    }
    const double n = double(after_s.size());
    if (after_s.empty()) return f;
    std::sort(after_s.begin(), after_s.end());
    f.bias = sum / n;
    f.sd = std::sqrt(std::max(0.0, squares / n - f.bias * f.bias));
    f.said_sd /= n;
    f.p50_s = after_s[after_s.size() / 2];
    f.p95_s = after_s[after_s.size() * 95 / 100];
    return f;
}

std::vector<Outcome> weigh(std::uint64_t first_seed, int sessions, int teaching, const Conditions& c) {
    std::vector<Outcome> taught, outcomes;
    for (int s = 0; s < teaching; ++s)
        append(taught, session(first_seed + std::uint64_t(s), kEggsAndBall_kg, kTimes, c, {}));
    for (int s = 0; s < sessions; ++s) {
        const auto seed = first_seed + std::uint64_t(teaching + s);
        const auto objects = teaching > 0 ? taught_by(taught, 1) : std::vector<grasp::Object>{};
        append(outcomes, session(seed, kEggsAndBall_kg, kTimes, c, objects));
    }
    return outcomes;
}

}  // namespace tactiled::bench
