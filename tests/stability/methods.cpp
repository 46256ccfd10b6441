#include "tests/stability/methods.hpp"

#include <cmath>
#include <cstdlib>
#include <functional>
#include <random>

#include "decoupling/solve/domain.hpp"

namespace tactiled::stability {
namespace {

constexpr std::size_t kOrdinary = 64;

// fx fy fz in N, moving by 1/100 of the range a sample.
std::array<double, 3> finger(std::size_t i) {
    const double t = double(i) / 100;
    return {0.25 * std::sin(1.7 * t + 1), 0.25 * std::cos(2.3 * t), -0.5 - 0.4 * std::sin(t)};
}

using Forward = std::function<std::vector<double>(const std::array<double, 3>&)>;

Method with_readings(std::string name, Calibration calibration, const Forward& forward, bool remembers = false) {
    Method method{std::move(name), std::move(calibration), {}, remembers};
    method.calibration.path = method.name;
    method.calibration.model = method.name.substr(0, method.name.find('/'));
    method.calibration.method = method.name.substr(method.name.find('/') + 1);
    for (std::size_t i = 0; i < kOrdinary; ++i) method.ordinary.push_back(forward(finger(i)));
    return method;
}

Calibration of(std::vector<std::string> channels, std::vector<std::string> components) {
    Calibration calibration;
    calibration.zero.assign(channels.size(), 0.0);
    calibration.channels = std::move(channels);
    calibration.components = std::move(components);
    calibration.sd.assign(calibration.components.size(), 0.01);
    return calibration;
}

const std::vector<std::string> kForces{"fx", "fy", "fz"};

void add_generic(std::vector<Method>& methods) {
    constexpr std::size_t n = 6, kCentres = 40, kNeurons = 12;
    std::mt19937_64 random(20260401);
    std::uniform_real_distribution<double> any(-1, 1);
    const auto table = [&](std::size_t rows, std::size_t columns, double size) {
        std::vector<std::vector<double>> result(rows, std::vector<double>(columns));
        for (auto& row : result)
            for (double& number : row) number = size * any(random);
        return result;
    };
    Calibration c = of({"A", "B", "C", "D", "E", "F"}, kForces);
    c.zero = {100, -3, 2e4, 0, 7, -250};
    c.full_scale = {1, 1, 2};
    c.matrix = table(3, n, 0.01);
    c.tables["width"] = {std::vector<double>(n, 20.0)};
    for (const double zero : c.zero) {
        c.channel_least.push_back(zero - 60);
        c.channel_most.push_back(zero + 60);
    }
    const std::vector<double> zero = c.zero;
    const auto forward = [zero](const std::array<double, 3>& f) {
        std::vector<double> r;
        for (std::size_t k = 0; k < n; ++k)
            r.push_back(zero[k] + 40 * (f[0] * std::sin(1.0 + double(k)) + f[1] * std::cos(double(3 * k)) + 0.5 * f[2]));
        return r;
    };
    methods.push_back(with_readings("generic/matrix", c, forward));
    c.tables["quadratic"] = table(3, 1 + n + n * (n + 1) / 2, 0.02);
    methods.push_back(with_readings("generic/quadratic", c, forward));
    c.tables["centres"] = table(kCentres, n, 3);
    c.tables["weights"] = table(3, kCentres, 0.05);
    c.parameters["spread"] = 2;
    methods.push_back(with_readings("generic/rbf", c, forward));
    c.tables.erase("quadratic");
    c.parameters.clear();
    c.tables["layer1"] = table(kNeurons, 1 + n, 0.5);
    c.tables["layer2"] = table(3, 1 + kNeurons, 0.05);
    methods.push_back(with_readings("generic/mlp", c, forward));
}

constexpr double kNormal_per_N = 19366e-6, kTangential_per_N = 10847e-6, kOuter_per_N = 8582e-6;

std::vector<double> gauges(const std::array<double, 3>& f) {
    const double x = kTangential_per_N * f[0], y = kTangential_per_N * f[1], n = kNormal_per_N * -f[2];
    const double outer_x = kOuter_per_N * f[0], outer_y = kOuter_per_N * f[1];
    return {n - x, outer_x, n - y, outer_y, n + x, -outer_x, n + y, -outer_y};
}

void add_table(std::vector<Method>& methods) {
    const std::vector<std::string> all{"R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8"};
    Calibration c = of(all, kForces);
    c.full_scale = {1, 1, 1};
    c.parameters = {{"normal_inner", kNormal_per_N},
                    {"tangential_inner", kTangential_per_N},
                    {"tangential_outer", kOuter_per_N},
                    {"noise", 20e-6}};
    methods.push_back(with_readings("table/linear", c, gauges));
    methods.push_back(with_readings("table/signs", c, gauges));
    Calibration bent = c;
    for (double n = 0; n <= 5; n += 0.5) bent.tables["normal_curve"].push_back({n, n * (1 - 0.0451 * n / (1 - 0.0196 * n))});
    bent.tables["hysteresis"] = {
        {0, 0.95, 0.95, 0.95}, {0.05, 0.02, 0.02, 0.02}, {0.1, 0.02, 0.02, 0.02}, {0.2, 0.01, 0.01, 0.01}};
    methods.push_back(with_readings("table/nonlinear", bent, gauges, true));
    Calibration matrix = c;
    matrix.parameters = {{"noise", 20e-6}};
    for (std::size_t k = 0; k < 8; ++k)
        matrix.tables["forward"].push_back({gauges({1, 0, 0})[k], gauges({0, 1, 0})[k], gauges({0, 0, 1})[k]});
    methods.push_back(with_readings("table/matrix", matrix, gauges));

    Problems problems;
    Calibration map = load_calibration(TACTILED_SOURCE_DIR "/config/calibration/table_influence.toml", problems);
    problems.throw_if_any();
    map.sd = {0.01, 0.01, 0.01, 1e-5, 1e-5};
    // A finger that stays 0.28 mm from the middle: on the sixth ring of 20, each of 48 points after the centre.
    const std::vector<double> point = map.tables.at("influence")[1 + 48 * 5 + 7];
    methods.push_back(with_readings(
        "table/map", map,
        [point](const std::array<double, 3>& f) {
            std::vector<double> r(8);
            for (std::size_t k = 0; k < 8; ++k)
                for (std::size_t i = 0; i < 3; ++i) r[k] += 2 * point[2 + 3 * k + i] * f[i];
            return r;
        },
        true));
}

void add_hair(std::vector<Method>& methods) {
    constexpr double kArea_m2 = 2.827e-5, kNormal = 3.74e-7, kShear = 7.91e-7;
    Calibration c = of({"H1", "H2", "H3", "H4"}, kForces);
    c.sd = {1e-4, 1e-4, 1e-4};
    c.full_scale = {0.0565, 0.0565, 0.0565};
    c.parameters = {{"area_m2", kArea_m2},
                    {"normal_scale_Pa", 2000},
                    {"shear_scale_Pa", 2000},
                    {"diff_x_per_Pa", 2 * kShear},
                    {"diff_y_per_Pa", 2 * kShear}};
    c.tables["gains"] = {{kNormal, -kShear, 0}, {kNormal, 0, -kShear}, {kNormal, kShear, 0}, {kNormal, 0, kShear}};
    c.tables["noise"] = {{5.14e-6, 5.14e-6, 5.14e-6, 5.14e-6}};
    const auto forward = [](const std::array<double, 3>& f) {
        const double s = kNormal * -f[2] * 1500, x = kShear * f[0] * 1500, y = kShear * f[1] * 1500;  // Pa a unit
        return std::vector<double>{s - x, s - y, s + x, s + y};
    };
    methods.push_back(with_readings("hair/sum_diff", c, forward));
    Calibration matrix = c;
    matrix.parameters.erase("diff_x_per_Pa");
    matrix.parameters.erase("diff_y_per_Pa");
    for (std::size_t i = 0; i < 4; ++i) {  // a few per cent of what the gains read at full scale
        std::vector<double> leak(16, 0.0);
        leak[0] = 1e-5, leak[1] = 2e-5 * (i == 0 ? -1 : 1), leak[9] = 1.5e-5, leak[12] = 1e-5;
        matrix.tables["leak"].push_back(leak);
    }
    methods.push_back(with_readings("hair/matrix", matrix, forward));
    Calibration physics = c;
    physics.tables.erase("gains");
    physics.parameters = {{"area_m2", kArea_m2},     {"radius_m", 0.7162e-3}, {"width_m", 0.5e-3}, {"thickness_m", 9e-6},
                          {"root_distance_m", 1e-3}, {"k_x_Pa", 4374},        {"k_y_Pa", 11090},   {"friction", 0.5},
                          {"pi_l_per_Pa", 6.25e-10}, {"elastomer_kPa", 750.0}};
    methods.push_back(with_readings("hair/physics", physics, forward));
}

void add_capacitive(std::vector<Method>& methods) {
    Calibration c = of({"C1", "C2", "C3", "C4", "Cn"}, kForces);
    Calibration curves = c;
    curves.zero = {1.2285, 1.2285, 1.2285, 1.2285, 1.3039};
    curves.full_scale = {1.2, 1.2, 10};
    curves.parameters = {{"normal_b", 0.0405}, {"normal_a", 0.0008}, {"normal_range_N", 10}, {"shear_range_N", 1.2}};
    curves.tables["side"] = {4, {0.038, 0.0071, 0, 0}};
    methods.push_back(with_readings("capacitive/quadratic", curves, [](const std::array<double, 3>& f) {
        const auto side = [](double F) { return 0.0071 * F * F + 0.038 * F + 1.2285; };
        return std::vector<double>{side(f[0]), side(-f[0]), side(f[1]), side(-f[1]),
                                   0.0008 * f[2] * f[2] - 0.0405 * f[2] + 1.3039};
    }));
    Calibration pad = c;
    pad.zero = {0.3562, 0.3662, 0.3462, 0.3562, 0.5038};
    pad.parameters = {{"stray_C1", 0.3}, {"stray_C2", 0.31},  {"stray_C3", 0.29},           {"stray_C4", 0.3},
                      {"stray_Cn", 0.4}, {"stiffening", 0.1}, {"shear_gap_exponent", -0.4}, {"normal_stiffness_N", 31.0}};
    const std::vector<double> zero = pad.zero;
    const auto forward = [zero](const std::array<double, 3>& f) {
        const double u = 1 - 0.03 * f[2], x = 0.3 * f[0], y = 0.3 * f[1];
        const double part[] = {u * (1 + x), u * (1 - x), u * (1 + y), u * (1 - y), u};
        std::vector<double> r;
        for (std::size_t e = 0; e < 5; ++e) r.push_back(zero[e] + (e == 4 ? 0.1038 : 0.0562) * (part[e] - 1));
        return r;
    };
    Calibration ratio = pad;
    ratio.parameters["shear_scale_N"] = 3;
    methods.push_back(with_readings("capacitive/ratio", ratio, forward));
    Calibration overlap = pad;
    overlap.parameters.insert({{"shear_stiffness_N_per_m", 1195},
                               {"noise", 1e-5},
                               {"disc_radius_m", 4e-3},
                               {"inner_radius_m", 2.5e-3},
                               {"outer_radius_m", 6e-3},
                               {"opening_rad", 1.3962634015954636},
                               {"centre_radius_m", 2e-3},
                               {"gap_m", 3e-3}});
    methods.push_back(with_readings("capacitive/overlap", overlap, forward));
}

void add_piezo(std::vector<Method>& methods) {
    Calibration c = of({"Vp", "Cn"}, {"fz"});
    c.sd = {0.05};
    c.zero = {0.0768, 1.3039};
    c.parameters = {{"gain_b", 0.2917},   {"gain_a", 0.0092},       {"normal_b", 0.0405},
                    {"normal_a", 0.0008}, {"normal_range_N", 10.0}, {"leak_tau_s", 1.0}};
    methods.push_back(with_readings(
        "piezo/fused", c,
        [](const std::array<double, 3>& f) {
            return std::vector<double>{0.0768 - 0.3 * (f[2] + 0.5), 1.3039 - 0.0405 * f[2]};
        },
        true));
}

}  // namespace

std::vector<Method> all_methods() {
    std::vector<Method> methods;
    add_generic(methods);
    add_table(methods);
    add_hair(methods);
    add_capacitive(methods);
    add_piezo(methods);
    return methods;
}

Calibration calibration_of(const std::string& name) {
    for (Method& method : all_methods())
        if (method.name == name) return std::move(method.calibration);
    std::abort();
}

std::unique_ptr<Decoupler> made(const Calibration& calibration) { return make_decoupler(calibration); }

}  // namespace tactiled::stability
