// Time of a sample: every method of every model on 1,024 readings of a simulated load that moves as a finger does (a step of
// 1/100 of the range a sample), fitted by the product's own fit or read from config/.
//
//   decouple_bench [--only MODEL/METHOD] [rounds]    ns a sample; all methods and levels take turns within a round
//   decouple_bench --allocations                     exit 1 where a method allocates
//   decouple_bench --only MODEL/METHOD --level none|monitor|checks --samples N [--plant slow]
//                                                    just N samples, for decouple_instructions.py; --plant slow: 30 % more
//
// Levels: the method alone; with the monitor of the calibration; with the delay in the sd, too, as the daemon does by
// default ("checks"). A warm reading is a block of 16 samples; the clock's own 30 ns are spread over them. A cold one is one
// sample after 64 MB were written, which evict the caches; the clock's own time is subtracted.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "tactiled/reader.hpp"
#include "tests/bench/decouple_cases.hpp"

extern "C" void* __libc_malloc(std::size_t);
namespace {
std::uint64_t allocations = 0;
}
extern "C" void* malloc(std::size_t size) {
    ++allocations;
    return __libc_malloc(size);
}

namespace {

using namespace tactiled;
using namespace tactiled::testing;

constexpr std::size_t kPerBlock = 16;

std::uint64_t t_ns = 0;
double sum = 0;  // keeps the optimiser from removing the loop
void one(const Case& c, Variant& variant, std::size_t i) {
    Estimate e = variant.decoupler->decouple({.channel = c.readings[i % kReadings], .t_ns = t_ns += 1'000'000});
    if (variant.latency) variant.latency->widen(e.wrench_S, t_ns, e.sd);
    sum += e.wrench_S[2];
}

// A number above 0, else 0.
std::size_t number(const char* text) {
    char* end = nullptr;
    const long value = std::strtol(text, &end, 10);
    return *end == 0 && value > 0 ? std::size_t(value) : 0;
}

struct Arguments {
    std::string only, level = "checks", plant;
    bool count_allocations = false, good = true;
    std::size_t samples = 0, rounds = 40;
};

Arguments arguments_of(int argc, char** argv) {
    Arguments a;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        const char* const next = i + 1 < argc ? argv[i + 1] : "";
        if (word == "--allocations")
            a.count_allocations = true;
        else if (word == "--only")
            a.only = next, ++i;
        else if (word == "--level")
            a.level = next, ++i;
        else if (word == "--plant")
            a.plant = next, ++i;
        else if (word == "--samples")
            a.samples = number(next), a.good = a.good && a.samples > 0, ++i;
        else
            a.rounds = number(argv[i]);
    }
    a.good = a.good && a.rounds > 0 && (a.samples == 0 || (!a.only.empty() && !a.count_allocations)) &&
             (a.plant.empty() || a.plant == "slow") &&
             std::find(std::begin(kLevelNames), std::end(kLevelNames), a.level) != std::end(kLevelNames);
    return a;
}

// Just `samples` of one level, 30 % more with the planted slow-down.
int run_samples(Case& c, const Arguments& a) {
    const auto level = std::size_t(std::find(std::begin(kLevelNames), std::end(kLevelNames), a.level) - kLevelNames);
    if (!c.level[level]) {
        fmt::print(stderr, "decouple_bench: {} has no level {}\n", c.name, a.level);
        return 2;
    }
    for (std::size_t i = 0; i < a.samples; ++i) {
        one(c, *c.level[level], i);
        if (!a.plant.empty() && i % 10 < 3) one(c, *c.level[level], i);
    }
    return sum == 1 ? 1 : 0;
}

int check_allocations(std::vector<Case>& cases) {
    int failed = 0;
    if (allocations == 0) failed = 1, fmt::print("the allocations are not counted\n");  // the fits made many
    for (Case& c : cases)
        for (auto& variant : c.level) {
            const std::uint64_t before = allocations;
            for (std::size_t i = 0; variant && i < 4 * kReadings; ++i) one(c, *variant, i);
            if (allocations == before) continue;
            fmt::print("{}: {} allocations in {} samples\n", c.name, allocations - before, 4 * kReadings);
            failed = 1;
        }
    return failed;
}

void measure(std::vector<Case>& cases, std::size_t rounds) {
    std::vector<char> other(64 << 20);
    std::vector<double> clock_ns;
    const auto cold = [&](Case& c, Variant& variant, std::size_t i) {
        for (std::size_t k = 0; k < other.size(); k += 64) ++other[k];
        const std::uint64_t begun = monotonic_ns();
        one(c, variant, i);
        const std::uint64_t ended = monotonic_ns();
        variant.cold_ns.push_back(double(ended - begun));
        clock_ns.push_back(double(monotonic_ns() - ended));
    };
    const auto warm = [&](Case& c, Variant& variant) {
        for (std::size_t i = 0; i < kReadings; i += kPerBlock) {
            const std::uint64_t begun = monotonic_ns();
            for (std::size_t k = 0; k < kPerBlock; ++k) one(c, variant, i + k);
            variant.warm_ns.push_back(double(monotonic_ns() - begun) / double(kPerBlock));
        }
    };
    for (std::size_t round = 0; round < rounds; ++round)
        for (Case& c : cases)
            for (auto& variant : c.level) {
                if (!variant) continue;
                warm(c, *variant);
                if (&variant == &c.level[kChecks])
                    for (std::size_t i = 0; i < 8; ++i) cold(c, *variant, round * 8 + i);
            }
    std::sort(clock_ns.begin(), clock_ns.end());
    for (Case& c : cases)
        for (double& ns : c.level[kChecks]->cold_ns) ns = std::max(0., ns - clock_ns[clock_ns.size() / 2]);
}

void print(std::vector<Case>& cases) {
    const auto at = [](std::optional<Variant>& variant, auto member, double share) -> std::string {
        if (!variant) return "-";
        std::vector<double>& ns = *variant.*member;
        std::sort(ns.begin(), ns.end());
        return fmt::format("{:.0f}", ns[std::size_t(share * double(ns.size() - 1))]);
    };
    fmt::print("{:20}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}   ns a sample; p99 to cold with checks\n", "", "alone", "monitor",
               "checks", "p99", "p99.9", "cold");
    for (Case& c : cases)
        fmt::print("{:20}{:>8}{:>8}{:>8}{:>8}{:>8}{:>8}\n", c.name, at(c.level[kNone], &Variant::warm_ns, .5),
                   at(c.level[kMonitor], &Variant::warm_ns, .5), at(c.level[kChecks], &Variant::warm_ns, .5),
                   at(c.level[kChecks], &Variant::warm_ns, .99), at(c.level[kChecks], &Variant::warm_ns, .999),
                   at(c.level[kChecks], &Variant::cold_ns, .5));
}

}  // namespace

int main(int argc, char** argv) {
    const Arguments a = arguments_of(argc, argv);
    if (!a.good) {
        fmt::print(stderr,
                   "decouple_bench [--allocations] [--only MODEL/METHOD] [rounds], or --only MODEL/METHOD --level LEVEL "
                   "--samples N [--plant slow]\n");
        return 2;
    }
    std::vector<std::string> known;
    std::vector<Case> cases = all_cases(a.only, a.count_allocations ? 600 : 2000, known);
    if (cases.empty()) {
        fmt::print(stderr, "decouple_bench: no method {}; there are {}\n", a.only, fmt::join(known, " "));
        return 2;
    }
    if (a.samples > 0) return run_samples(cases[0], a);
    const int failed = check_allocations(cases);
    if (a.count_allocations) {
        if (failed == 0) fmt::print("{} methods, {} samples each: no allocation\n", cases.size(), 4 * kReadings);
        return failed;
    }
    measure(cases, a.rounds);
    print(cases);
    return sum == 1 ? 1 : failed;
}
