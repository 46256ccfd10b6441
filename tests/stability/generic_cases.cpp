// Model "generic", and what all models share: large offsets, saturated neurons, readings far outside, numbers that are none.
#include <cmath>
#include <functional>

#include "decoupling/solve/domain.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Calibration one_force(const std::vector<double>& gains, double zero) {
    Calibration c;
    c.path = "one force";
    c.model = "generic";
    c.method = "matrix";
    for (std::size_t k = 0; k < gains.size(); ++k) c.channels.push_back("B" + std::to_string(k + 1));
    c.zero.assign(gains.size(), zero);
    c.components = {"fz"};
    c.sd = {0.01};
    c.matrix = {gains};
    return c;
}

void add_sizes(Cases& cases) {
    // Channels of 1e15 units with a signal of 1: the textbook folds the zeros into one constant, M r - M zero.
    const std::vector<double> gains{0.31, -0.72, 0.43};
    const Calibration c = one_force(gains, 1e15);
    const std::vector<double> r{1e15 + 1, 1e15 - 2, 1e15 + 3};
    double raw = 0, constant = 0;
    Real exact = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        raw += gains[k] * r[k], constant += gains[k] * 1e15;
        exact += Real(gains[k]) * (Real(r[k]) - Real(1e15));
    }
    cases.value("G1", "a signal of 1 on a rest of 1e15: fz", {raw - constant, estimate_of(c, r).wrench_S[2], exact, 1, 8});
    // Standard deviations whose squares are 0 or infinite.
    Calibration small = one_force({1}, 0), large = small;
    small.sd = {3e-200}, small.sd_slope = {1e-100};
    large.sd = {3e199}, large.sd_slope = {1e100};
    const auto sd = [](const Calibration& of, double F) { return estimate_of(of, {F}).sd[2]; };
    const auto exact_sd = [](double a, double slope, double F) -> Real {
        return sqrt(Real(a) * Real(a) + Real(slope) * Real(slope) * Real(F) * Real(F));
    };
    cases.value("G2", "an sd of 5e-200",
                {std::sqrt(3e-200 * 3e-200 + 4e-200 * 4e-200), sd(small, 4e-100), exact_sd(3e-200, 1e-100, 4e-100)});
    cases.value("G3", "an sd of 5e199",
                {std::sqrt(3e199 * 3e199 + 4e199 * 4e199), sd(large, 4e99), exact_sd(3e199, 1e100, 4e99)});
    cases.marked(
        "G4", "products that overflow: inf - inf",
        {as_good(1e200 * 1e200 - 1e200 * 1e200), published(estimate_of(one_force({1e200, -1e200}, 0), {1e200, 1e200}), 2)});
}

// Inside of the domain, in 100 digits, term by term.
Real rbf_exact(const Calibration& c, const std::vector<double>& channel, std::size_t component, double& kappa) {
    std::vector<Real> u;
    Real sum = 0, sizes = 0;
    const auto add = [&](const Real& term) { sum += term, sizes += abs(term); };
    for (std::size_t k = 0; k < channel.size(); ++k) {
        u.push_back((Real(channel[k]) - Real(c.zero[k])) / Real(c.tables.at("width")[0][k]));
        add(Real(c.matrix[component][k]) * (Real(channel[k]) - Real(c.zero[k])));
    }
    const auto& q = c.tables.at("quadratic")[component];
    std::size_t at = 0;
    add(Real(q[at++]));
    for (const Real& one : u) add(Real(q[at++]) * one);
    for (std::size_t k = 0; k < u.size(); ++k)
        for (std::size_t j = k; j < u.size(); ++j) add(Real(q[at++]) * u[k] * u[j]);
    const Real spread(c.parameters.at("spread"));
    for (std::size_t j = 0; j < c.tables.at("centres").size(); ++j) {
        Real d2 = 0;
        for (std::size_t k = 0; k < u.size(); ++k) {
            const Real d = u[k] - Real(c.tables.at("centres")[j][k]);
            d2 += d * d;
        }
        add(Real(c.tables.at("weights")[component][j]) / (1 + d2 / (spread * spread)));
    }
    kappa = double(sizes / abs(sum));
    return sum;
}

void add_corrections(Cases& cases) {
    const Calibration rbf = calibration_of("generic/rbf");
    Calibration flat = rbf;
    flat.parameters["spread"] = 1e6;  // every kernel is 1 but for 1e-12: what a singular kernel matrix comes from
    for (std::size_t j = 0; j < flat.tables["weights"][0].size(); ++j)
        for (auto& row : flat.tables["weights"]) row[j] *= 1e9;
    std::vector<double> inside;
    for (std::size_t k = 0; k < rbf.zero.size(); ++k) inside.push_back(rbf.zero[k] + 10.0 * std::sin(double(k) + 1));
    double kappa = 0;
    const Real exact = rbf_exact(flat, inside, 2, kappa);
    float single = 0;
    for (std::size_t j = 0; j < flat.tables["weights"][2].size(); ++j) single += float(flat.tables["weights"][2][j]);
    // 46 + 28 terms are summed: at most so many roundings of the sum of their sizes.
    cases.value("H15b", "40 kernels so wide that all are 1, weights of 5e7: fz",
                {double(single), estimate_of(flat, inside).wrench_S[2], exact, kappa, 80, 0, Textbook::single});
    auto far = inside;
    for (double& value : far) value += 6000;
    const Estimate away = estimate_of(rbf, far);
    cases.marked("H16", "60 widths away from every centre",
                 {as_good(0.0 / 0.0), published(away, 2), TACTILED_OUTSIDE_DOMAIN});

    // Neurons that are driven to 1e4: the textbook's (e^x - e^-x) / (e^x + e^-x) is inf / inf.
    Calibration mlp = calibration_of("generic/mlp");
    for (auto& row : mlp.tables["layer1"])
        for (double& w : row) w *= 1e5;
    Real sum = 0, sizes = 0;
    double naive = 0;
    for (std::size_t k = 0; k < inside.size(); ++k) {
        const Real term = Real(mlp.matrix[2][k]) * (Real(inside[k]) - Real(mlp.zero[k]));
        sum += term, sizes += abs(term);
    }
    const auto& out = mlp.tables["layer2"][2];
    sum += Real(out[0]), sizes += abs(Real(out[0]));
    for (std::size_t j = 0; j < mlp.tables["layer1"].size(); ++j) {
        const auto& w = mlp.tables["layer1"][j];
        Real x(w[0]);
        for (std::size_t k = 0; k < inside.size(); ++k)
            x += Real(w[1 + k]) * (Real(inside[k]) - Real(mlp.zero[k])) / Real(mlp.tables["width"][0][k]);
        const Real term = Real(out[1 + j]) * tanh(x);
        sum += term, sizes += abs(term);
        const double d = double(x);
        naive += out[1 + j] * (std::exp(d) - std::exp(-d)) / (std::exp(d) + std::exp(-d));
    }
    cases.value("G5", "neurons driven far into saturation: fz",
                {naive, estimate_of(mlp, inside).wrench_S[2], sum, double(sizes / abs(sum)), 40});

    // R2: fitted to 1, used to 10 times as much. The matrix goes straight on, the square stays what it is at the edge.
    Calibration square = one_force({0.1}, 0);
    square.method = "quadratic";
    square.channel_least = {-10}, square.channel_most = {10};
    square.tables["width"] = {{5.0}};
    square.tables["quadratic"] = {{0, 0, 0.02}};
    const double edge = 10 + 0.05 * 20, u = 100.0 / 5;
    cases.marked("R2", "a quadratic used to ten times what it was fitted to",
                 {as_good(10 + 0.02 * u * u), published(estimate_of(square, {100}), 2), TACTILED_OUTSIDE_DOMAIN,
                  10 + 0.02 * (edge / 5) * (edge / 5), 1e-14});
    // R4, R6: fitted to standardised channels, fed raw ones.
    Calibration standard = one_force({0.5, 0.2, -0.3}, 0);
    standard.channel_least.assign(3, -3), standard.channel_most.assign(3, 3);
    cases.marked("R6", "fitted to standardised channels, fed raw ones of 179",
                 {as_good(0.4 * 179), published(estimate_of(standard, {179, 181, 177}), 2), TACTILED_OUTSIDE_DOMAIN});
    cases.marked("R4", "a channel 6 % of its width beyond what was calibrated",
                 {as_good(0.5 * 3.36), published(estimate_of(standard, {3.36, 0, 0}), 2), TACTILED_OUTSIDE_DOMAIN});
    // R7: the reading of a saturated channel of a skin cannot be reconstructed.
    cases.marked("R7", "one of three channels at its rail",
                 {as_good(0.5), published(estimate_of(standard, {1, 0, 0}, 0, 1), 2),
                  TACTILED_SATURATED | TACTILED_UNKNOWN_UNCERTAINTY});
    cases.marked("G6", "a frame with a channel too few", {as_good(0.5), published(estimate_of(standard, {1, 0}), 2)});
}

// Each channel of each method in turn, one odd value in an ordinary reading: how many are GOOD with a value that is none, or
// publish no number where they say there is one.
int undetected(const std::string& model, const std::vector<double>& odd) {
    int n = 0;
    for (const Method& method : all_methods()) {
        if (method.model() != model) continue;
        const auto decoupler = made(method.calibration);
        for (const double value : odd)
            for (std::size_t k = 0; k < method.calibration.channels.size(); ++k) {
                auto channel = method.ordinary[5];
                channel[k] = value;
                const Estimate e = decoupler->decouple({.channel = channel, .t_ns = 1'000'000'000});
                for (const auto& name : method.calibration.components) {
                    const double force = e.wrench_S[component_index(name)];
                    const bool bad = e.quality() == TACTILED_BAD;
                    n += std::isfinite(force) == bad || e.quality() == TACTILED_GOOD ? 1 : 0;
                }
            }
    }
    return n;
}

// A denormal or a signed zero is a 0 to every method: the same quality, and a force that differs by less than any register.
int differ_from_zero(const std::string& model, const std::vector<double>& tiny) {
    int n = 0;
    for (const Method& method : all_methods()) {
        if (method.model() != model) continue;
        for (std::size_t k = 0; k < method.calibration.channels.size(); ++k) {
            auto channel = method.ordinary[5];
            channel[k] = 0;
            const Estimate zero = estimate_of(method.calibration, channel);
            for (const double value : tiny) {
                channel[k] = value;
                const Estimate e = estimate_of(method.calibration, channel);
                for (const auto& name : method.calibration.components) {
                    const std::size_t c = component_index(name);
                    const bool same = e.wrench_S[c] == zero.wrench_S[c] ||
                                      std::abs(e.wrench_S[c] - zero.wrench_S[c]) < 1e-300 ||
                                      (std::isnan(e.wrench_S[c]) && std::isnan(zero.wrench_S[c]));
                    n += same && e.quality() == zero.quality() && e.reasons == zero.reasons ? 0 : 1;
                }
            }
        }
    }
    return n;
}

void add_odd_channels(Cases& cases) {
    const auto none_may = [&](const std::string& id, const char* what, int n) {
        cases.value(id, what, {kNaN, double(n), 0, 1, 0, 0, Textbook::none});
    };
    for (const std::string model : {"generic", "table", "hair", "capacitive", "piezo"}) {
        none_may("X " + model, "NaN and infinities in each channel of each method: false values",
                 undetected(model, {kNaN, kInf, -kInf}));
        none_may("Y " + model, "1e300 and more in each channel of each method: false values",
                 undetected(model, {1e300, -1e300, 1.7e308}));
        none_may("Z " + model, "denormals and signed zeros in each channel of each method: not as 0",
                 differ_from_zero(model, {5e-324, -5e-324, 1e-310, -0.0}));
    }
    // At rest with zeros of either sign no force is -0, which prints as "-0" and has another register than 0.
    int minus = 0;
    const std::vector<double> gauges{-0.0, 0.0, -0.0, 0.0, -0.0, 0.0, -0.0, 0.0};
    for (const char* name : {"table/linear", "table/signs", "table/matrix", "table/nonlinear"})
        for (const double f : estimate_of(calibration_of(name), gauges).wrench_S) minus += f == 0 && std::signbit(f) ? 1 : 0;
    cases.value("G7", "forces of -0 at rest", {1, double(minus), 0, 1, 0});
}

}  // namespace

void add_generic_cases(Cases& cases) {
    add_sizes(cases);
    add_corrections(cases);
    add_odd_channels(cases);
}

}  // namespace tactiled::stability
