#include "tests/bench/decouple_cases.hpp"

#include <cmath>
#include <functional>
#include <random>
#include <utility>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/labelled.hpp"

namespace tactiled::testing {
namespace {

constexpr double kDelay_s = 0.01;
using Forward = std::function<std::vector<double>(const Wrench&)>;

// The levels of a calibration.
Case case_of(const std::string& name, const Calibration& calibration, const std::string& method) {
    Case result;
    result.name = name;
    for (const Level level : {kNone, kMonitor, kChecks}) {
        Calibration part = calibration;
        if (level == kMonitor && part.monitor.limit == 0) continue;
        if (level == kNone) part.monitor = {};
        Variant& variant = result.level[level].emplace();
        variant.decoupler = make_decoupler(part, method);
        if (level < kChecks) continue;
        Wrench delay_s;
        delay_s.fill(kDelay_s);
        variant.latency.emplace().set_delay(delay_s);
    }
    return result;
}

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
    Case result = case_of("piezo/fused", calibration, "fused");
    for (const Wrench& load : finger(kReadings))
        result.readings.push_back({0.0768 - 0.3 * (load[2] + 0.5), 1.3039 - 0.0405 * load[2]});
    return result;
}

Case fitted(const std::string& model, const std::string& method, const Labelled& rows, const Forward& forward) {
    FitRequest request;
    request.model = model;
    request.method = method;
    Case result = case_of(model + "/" + method, fit(rows, request).calibration, method);
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
    Case result = case_of("table/map", calibration, "map");
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

}  // namespace

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
    for (const char* method : {"matrix", "quadratic", "rbf"}) add("generic", method, skin_rows, skin);
    add("generic", "mlp", labelled_rows(b, skin, 600, false, 0.5), skin);
    add("table", "linear", gauge_rows, gauges);
    add("table", "matrix", moment_rows, gauges);
    add("table", "nonlinear", gauge_rows, gauges);
    if (wanted("table/map")) cases.push_back(plate());
    for (const char* method : {"sum_diff", "matrix", "physics"}) add("hair", method, hair_rows, hairs);
    for (const char* method : {"quadratic", "ratio", "overlap"}) add("capacitive", method, pad_rows, electrodes);
    if (wanted("piezo/fused")) cases.push_back(piezo());
    return cases;
}

}  // namespace tactiled::testing
