// Time for accuracy: every method of every model, a sample at a time, on 1,024 readings of a simulated load that
// moves as a finger does (a step of 1/100 of the range a sample), fitted by the product's own fit or read from config/.
//
//   decouple_bench [rounds]                      p50 and p99.9 of a sample, ns; all methods take turns within a round
//   decouple_bench --allocations                 exit 1 where a method allocates
//   decouple_bench --only MODEL/METHOD [rounds]  the same of one method
//   decouple_bench --only MODEL/METHOD --samples N       just N samples, to be counted by `valgrind --tool=none`-like tools:
//                                                        tests/bench/decouple_instructions.py does so
//
// A reading is a block of 16 samples; the clock's own 30 ns are spread over them. Not shown: cold caches.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/labelled.hpp"
#include "decoupling/latency.hpp"
#include "tactiled/reader.hpp"

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
using Forward = std::function<std::vector<double>(const Wrench&)>;

constexpr std::size_t kReadings = 1024, kPerBlock = 16;
constexpr double kDelay_s = 0.01;

struct Case {
    std::string name;
    std::unique_ptr<Decoupler> decoupler;
    std::vector<std::vector<double>> readings;
    std::vector<double> ns;               // a sample, a block each
    std::optional<Latency> latency = {};  // the daemon has one
};

// fx fy fz of a moving finger within a second. `wanders`: its point moves, too; else there are no moments.
std::vector<Wrench> finger(std::size_t n, bool wanders = true) {
    std::vector<Wrench> loads;
    for (std::size_t i = 0; i < n; ++i) {
        const double t = double(i) / 100;
        const double fz = -0.5 - 0.45 * std::sin(t);
        const double arm_m = wanders ? 3e-4 : 0;
        loads.push_back({0.25 * std::sin(1.7 * t), 0.25 * std::cos(2.3 * t), fz, arm_m * std::sin(0.7 * t) * fz,
                         arm_m * std::cos(0.9 * t) * fz, kNaN});
    }
    return loads;
}

// Rows of random loads, as a calibration bench gives them.
Labelled labelled_rows(const std::vector<std::string>& channels, const Forward& forward, std::size_t n, bool moments,
                       double noise) {
    Labelled labelled;
    labelled.name = "made";
    labelled.channels = channels;
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal(0, noise);
    for (std::size_t i = 0; i < n; ++i) {
        Wrench load{0.3 * uniform(random), 0.3 * uniform(random), -0.5 + 0.5 * uniform(random), kNaN, kNaN, kNaN};
        if (moments) load[3] = 3e-4 * uniform(random) * load[2], load[4] = 3e-4 * uniform(random) * load[2];
        LabelledRow row{.line = std::int64_t(i) + 2,
                        .channel = forward(load),
                        .wrench_S = load,
                        .session = 0,
                        .t_ns = (i + 1) * 1'000'000};
        for (double& channel : row.channel) channel += normal(random);
        labelled.rows.push_back(row);
    }
    return labelled;
}

std::vector<double> skin(const Wrench& f) {  // 15 nonlinear channels
    std::vector<double> r;
    for (int k = 0; k < 15; ++k) {
        const double s = std::sin(1.0 + k) * f[0] + std::cos(2.0 + 3 * k) * f[1] + std::sin(0.3 * k * k) * f[2];
        r.push_back(100 * (s + 0.3 * s * s * std::sin(5.0 * k) + 0.1 * std::sin(3 * s + k)));
    }
    return r;
}
std::vector<double> gauges(const Wrench& f) {  // the documents' sensitivities
    const double ti = 10847e-6, ni = 19366e-6, to = 8582e-6, arm = 0.531 / 0.725, mx = std::isnan(f[3]) ? 0 : f[3] * 1e3,
                 my = std::isnan(f[4]) ? 0 : f[4] * 1e3, n = -f[2];
    return {-ti * (f[0] + arm * my) + ni * n, to * f[0],  -ti * (f[1] - arm * mx) + ni * n, to * f[1],
            ti * (f[0] + arm * my) + ni * n,  -to * f[0], ti * (f[1] - arm * mx) + ni * n,  -to * f[1]};
}
std::vector<double> hairs(const Wrench& f) {
    const double area = 2.827433388230814e-5, s = 3.74e-7 * -f[2] / area / 20, x = 7.91e-7 * f[0] / area / 20,
                 y = 7.91e-7 * f[1] / area / 20;
    return {s - x, s - y, s + x, s + y};
}

std::vector<double> electrodes(const Wrench& f) {  // C1 C2 C3 C4 Cn, pF: gap and shift, to first order
    const double u = 1 - 0.1 * f[2], x = 0.3 * f[0], y = 0.3 * f[1];
    return {0.02 + 0.056 * u * (1 + x), 0.02 + 0.056 * u * (1 - x), 0.02 + 0.056 * u * (1 + y), 0.02 + 0.056 * u * (1 - y),
            0.03 + 0.104 * u};
}

Case piezo() {  // the thesis' curves
    Calibration calibration;
    calibration.path = "bench";
    calibration.model = "piezo";
    calibration.method = "fused";
    calibration.channels = {"Vp", "Cn"};
    calibration.zero = {0.0768, 1.3039};
    calibration.components = {"fz"};
    calibration.sd = {0.05};
    calibration.parameters = {{"gain_b", 0.2917},   {"gain_a", 0.0092},       {"normal_b", 0.0405},
                              {"normal_a", 0.0008}, {"normal_range_N", 10.0}, {"leak_tau_s", 1.0}};
    Case result{.name = "piezo/fused", .decoupler = make_decoupler(calibration), .readings = {}, .ns = {}};
    for (const Wrench& load : finger(kReadings))
        result.readings.push_back({0.0768 - 0.3 * (load[2] + 0.5), 1.3039 - 0.0405 * load[2]});
    return result;
}

enum class Checks { none, joint_domain, latency, all };  // latency: and the joint domain

Case fitted(const std::string& model, const std::string& method, const Labelled& rows, const Forward& forward,
            Checks checks = Checks::all) {
    FitRequest request;
    request.model = model;
    request.method = method;
    request.parity = true;
    Case result{.name = model + "/" + method, .decoupler = nullptr, .readings = {}, .ns = {}};
    Calibration calibration = fit(rows, request).calibration;
    if (checks == Checks::none) calibration.joint_domain = {};
    if (checks != Checks::all) calibration.parity = {};
    result.decoupler = make_decoupler(calibration, method);
    if (checks == Checks::latency) {
        Wrench delay_s;
        delay_s.fill(kDelay_s);
        result.latency.emplace().set_delay(delay_s);
    }
    // Methods that model one contact point cannot follow a moving one: its readings would be doubtful, which is not
    // the usual case.
    const bool one_contact = method == "linear" || method == "nonlinear";
    for (const Wrench& load : finger(kReadings, !one_contact)) result.readings.push_back(forward(load));
    return result;
}

// Method map: point contacts whose readings are interpolated between two rings of the influence map itself.
Case plate() {
    Problems problems;
    const Calibration calibration =
        load_calibration(TACTILED_SOURCE_DIR "/config/calibration/table_influence.toml", problems);
    problems.throw_if_any();
    Case result{.name = "table/map", .decoupler = make_decoupler(calibration, "map"), .readings = {}, .ns = {}};
    const auto& map = calibration.tables.at("influence");
    const auto loads = finger(kReadings);
    for (std::size_t i = 0; i < kReadings; ++i) {
        const double ring = 6 + 3 * std::sin(double(i) / 150);  // ring of 20, each of 48 points after the centre
        const auto inner = std::size_t(ring);
        const std::size_t angle = i / 24 % 48;
        std::vector<double> r;
        for (std::size_t k = 0; k < 8; ++k) {
            double sum = 0;
            for (std::size_t c = 0; c < 3; ++c)
                sum += 2 * loads[i][c] *
                       std::lerp(map[1 + 48 * (inner - 1) + angle][2 + 3 * k + c],
                                 map[1 + 48 * inner + angle][2 + 3 * k + c], ring - double(inner));
            r.push_back(sum);
        }
        result.readings.push_back(r);
    }
    return result;
}

// `only` of them, "" = all; `known`: their names. `skin_n` rows to fit generic: mlp's fit takes a minute with 2,000.
std::vector<Case> all_cases(const std::string& only, std::size_t skin_n, std::vector<std::string>& known) {
    std::vector<Case> cases;
    const std::vector<std::string> r{"R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8"}, h{"H1", "H2", "H3", "H4"};
    std::vector<std::string> b;
    for (int k = 1; k <= 15; ++k) b.push_back("B" + std::to_string(k));
    const std::vector<std::string> e{"C1", "C2", "C3", "C4", "Cn"};
    const Labelled pad_rows = labelled_rows(e, electrodes, 600, false, 1e-5);
    const Labelled skin_rows = labelled_rows(b, skin, skin_n, false, 0.5),
                   hair_rows = labelled_rows(h, hairs, 600, false, 5e-6),
                   gauge_rows = labelled_rows(r, gauges, 600, false, 2e-5),
                   moment_rows = labelled_rows(r, gauges, 600, true, 2e-5);
    const auto wanted = [&](const std::string& name) {
        known.push_back(name);
        return only.empty() || only == name;
    };
    const auto add = [&](const char* model, const char* method, const Labelled& rows, const Forward& forward) {
        if (wanted(std::string(model) + "/" + method)) cases.push_back(fitted(model, method, rows, forward));
    };
    for (const char* method : {"matrix", "quadratic", "rbf", "mlp"}) add("generic", method, skin_rows, skin);
    // Methods of 15, 8 and 4 channels without the checks around them: the differences are the costs of the checks.
    const auto part = [&](const char* name, const char* model, const char* method, const Labelled& rows,
                          const Forward& forward, Checks checks) {
        if (!wanted(name)) return;
        cases.push_back(fitted(model, method, rows, forward, checks));
        cases.back().name = name;
    };
    constexpr std::pair<const char*, Checks> kParts[] = {
        {"alone/", Checks::none}, {"joint/", Checks::joint_domain}, {"late/", Checks::latency}, {"all/", Checks::all}};
    for (const auto& [name, checks] : kParts) {
        part((name + std::string("matrix")).c_str(), "generic", "matrix", skin_rows, skin, checks);
        part((name + std::string("linear")).c_str(), "table", "linear", gauge_rows, gauges, checks);
        part((name + std::string("sum_diff")).c_str(), "hair", "sum_diff", hair_rows, hairs, checks);
    }
    add("table", "linear", gauge_rows, gauges);
    add("table", "matrix", moment_rows, gauges);
    add("table", "nonlinear", gauge_rows, gauges);
    if (wanted("table/map")) cases.push_back(plate());
    for (const char* method : {"sum_diff", "matrix", "physics"}) add("hair", method, hair_rows, hairs);
    for (const char* method : {"quadratic", "ratio", "overlap"}) add("capacitive", method, pad_rows, electrodes);
    if (wanted("piezo/fused")) cases.push_back(piezo());
    return cases;
}

std::uint64_t t_ns = 0;
double sum = 0;  // keeps the optimiser from removing the loop
void one(Case& c, std::size_t i) {
    Estimate e = c.decoupler->decouple({.channel = c.readings[i % kReadings], .t_ns = t_ns += 1'000'000});
    if (c.latency) c.latency->widen(e.wrench_S, t_ns, e.sd);
    sum += e.wrench_S[2];
}

// A number above 0, else 0.
std::size_t number(const char* text) {
    char* end = nullptr;
    const long value = std::strtol(text, &end, 10);
    return *end == 0 && value > 0 ? std::size_t(value) : 0;
}

}  // namespace

int main(int argc, char** argv) {
    std::string only;
    bool count_allocations = false;
    std::optional<std::size_t> samples;
    std::size_t rounds = 40;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--allocations") == 0)
            count_allocations = true;
        else if (std::strcmp(argv[i], "--only") == 0 && i + 1 < argc)
            only = argv[++i];
        else if (std::strcmp(argv[i], "--samples") == 0 && i + 1 < argc)
            samples = number(argv[++i]);
        else
            rounds = number(argv[i]);
    }
    if (rounds == 0 || samples == 0u || (samples && (only.empty() || count_allocations))) {
        fmt::print(stderr,
                   "decouple_bench [--allocations] [--only MODEL/METHOD] [rounds], or --only MODEL/METHOD --samples N\n");
        return 2;
    }
    std::vector<std::string> known;
    std::vector<Case> cases = all_cases(only, count_allocations ? 600 : 2000, known);
    if (cases.empty()) {
        fmt::print(stderr, "decouple_bench: no method {}; there are {}\n", only, fmt::join(known, " "));
        return 2;
    }
    if (samples) {
        for (std::size_t i = 0; i < *samples; ++i) one(cases[0], i);
        return sum == 1 ? 1 : 0;
    }
    int failed = 0;
    if (allocations == 0) failed = 1, fmt::print("the allocations are not counted\n");  // the fits made many
    for (Case& c : cases) {
        const std::uint64_t before = allocations;
        for (std::size_t i = 0; i < 4 * kReadings; ++i) one(c, i);
        if (allocations != before) {
            fmt::print("{}: {} allocations in {} samples\n", c.name, allocations - before, 4 * kReadings);
            failed = 1;
        }
    }
    if (count_allocations) {
        if (failed == 0) fmt::print("{} methods, {} samples each: no allocation\n", cases.size(), 4 * kReadings);
        return failed;
    }
    for (std::size_t round = 0; round < rounds; ++round)
        for (Case& c : cases)
            for (std::size_t i = 0; i < kReadings; i += kPerBlock) {
                const std::uint64_t begun = monotonic_ns();
                for (std::size_t k = 0; k < kPerBlock; ++k) one(c, i + k);
                c.ns.push_back(double(monotonic_ns() - begun) / double(kPerBlock));
            }
    fmt::print("{:20} {:>10} {:>10} {:>10} {:>10}   ns a sample\n", "", "mean", "p50", "p99", "p99.9");
    for (Case& c : cases) {
        std::sort(c.ns.begin(), c.ns.end());
        double mean = 0;
        for (const double ns : c.ns) mean += ns / double(c.ns.size());
        const auto at = [&](double share) { return c.ns[std::size_t(share * double(c.ns.size() - 1))]; };
        fmt::print("{:20} {:10.1f} {:10.1f} {:10.1f} {:10.1f}\n", c.name, mean, at(.5), at(.99), at(.999));
    }
    return sum == 1 ? 1 : 0;
}
