// Benefit of averaging hairs: the stress that one hair, a pair and all four detect above their noise, through model
// "hair", against the time a sample.
#include <fmt/format.h>

#include <cmath>
#include <random>

#include "tests/bench/costs/cost.hpp"
#include "tests/bench/costs/turns.hpp"
#include "tests/unit/decoupling/threshold.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kNormal_Pa = 1000, kShear_Pa = 500;  // half and a quarter of the paper's range
constexpr double kNone = kNaN;

// The sensor with these of its four hairs, and the components that they can measure.
Calibration with_hairs(Calibration calibration, const std::vector<std::size_t>& hairs,
                       const std::vector<std::string>& components) {
    const Calibration whole = calibration;
    calibration.channels.clear();
    calibration.zero.clear();
    calibration.tables["gains"].clear();
    calibration.tables["noise"] = {{}};
    for (const std::size_t k : hairs) {
        calibration.channels.push_back(whole.channels[k]);
        calibration.zero.push_back(whole.zero[k]);
        calibration.tables["gains"].push_back(whole.tables.at("gains")[k]);
        calibration.tables["noise"][0].push_back(whole.tables.at("noise")[0][k]);
    }
    calibration.components = components;
    calibration.full_scale.resize(components.size());
    return calibration;
}

// Noisy readings of the load, one after the other.
std::vector<double> readings(const Calibration& calibration, std::size_t samples) {
    const auto &gains = calibration.tables.at("gains"), &noise = calibration.tables.at("noise");
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    std::vector<double> result;
    for (std::size_t i = 0; i < samples; ++i)
        for (std::size_t k = 0; k < gains.size(); ++k)
            result.push_back(gains[k][0] * kNormal_Pa + gains[k][1] * kShear_Pa + noise[0][k] * normal(random));
    return result;
}

double sd(const std::vector<double>& values) {
    double mean = 0, squares = 0;
    for (const double v : values) mean += v / double(values.size());
    for (const double v : values) squares += (v - mean) * (v - mean);
    return std::sqrt(squares / double(values.size() - 1));
}

Cost measure(const CostSetup& setup) {
    const Calibration four = shipped_calibration(setup, "hair_documents.toml"),
                      pair = with_hairs(four, {0, 2}, {"fx", "fz"}), one = with_hairs(four, {0}, {});
    const std::size_t n = setup.samples_or(40'000);
    const double area_m2 = four.parameters.at("area_m2"), noise = one.tables.at("noise")[0][0];
    const double per_normal_Pa = one.tables.at("gains")[0][0], per_shear_Pa = -one.tables.at("gains")[0][1];
    const auto reading_1 = readings(one, n), reading_2 = readings(pair, n), reading_4 = readings(four, n);

    struct Noise {
        double normal_Pa, shear_Pa;
    };
    const auto through = [&](const Calibration& calibration, const std::vector<double>& reading) {
        const auto decoupler = make_decoupler(calibration);
        const std::size_t channels = calibration.channels.size();
        std::vector<double> normal_Pa, shear_Pa;
        for (std::size_t i = 0; i < n; ++i) {
            const Estimate e = decoupler->decouple({.channel = {&reading[i * channels], channels}, .t_ns = i + 1});
            normal_Pa.push_back(-e.wrench_S[2] / area_m2);
            shear_Pa.push_back(e.wrench_S[0] / area_m2);
        }
        return Noise{sd(normal_Pa), sd(shear_Pa)};
    };
    const double alone = sd(reading_1);  // standard deviation of one hair, which cannot separate the stresses
    const Noise of_pair = through(pair, reading_2), of_four = through(four, reading_4);

    const auto runs = [n](std::shared_ptr<Decoupler> decoupler, const std::vector<double>& reading, std::size_t channels) {
        return [=, &reading](std::size_t first, std::size_t last) {
            double sum = 0;
            for (std::size_t i = first; i < last; ++i)
                sum += decoupler->decouple({.channel = {&reading[i % n * channels], channels}, .t_ns = i + 1}).wrench_S[2];
            return sum;
        };
    };
    const auto ns = ns_alternating({[&](std::size_t first, std::size_t last) {
                                        double sum = 0;
                                        for (std::size_t i = first; i < last; ++i) sum += reading_1[i % n] / per_normal_Pa;
                                        return sum;
                                    },
                                    runs(make_decoupler(pair), reading_2, 2), runs(make_decoupler(four), reading_4, 4)},
                                   n);
    Cost cost;
    cost.columns = {"hairs",    "normal_Pa",      "normal_ideal_Pa",  "normal_printed_Pa",
                    "shear_Pa", "shear_ideal_Pa", "shear_printed_Pa", "ns"};
    const auto ideal = [&](int hairs) { return sum_threshold_Pa(hairs, noise, per_normal_Pa); };
    const double diff = diff_threshold_Pa(noise, per_shear_Pa);
    cost.rows = {
        {"one",
         {alone / per_normal_Pa, ideal(1), 13.7, alone / per_shear_Pa, threshold_Pa(noise, per_shear_Pa), 6.9, ns[0]}},
        {"two, SUM and DIFF", {of_pair.normal_Pa, ideal(2), kNone, of_pair.shear_Pa, diff, 5.1, ns[1]}},
        {"four", {of_four.normal_Pa, ideal(4), 7.2, of_four.shear_Pa, diff, 5.1, ns[2]}}};
    Figure::Series normal{"press, measured", Symbol::circle, Stroke::solid},
        shear{"shear, measured", Symbol::square, Stroke::solid},
        normal_printed{"press, printed", Symbol::ring, Stroke::none, {}, kBlue},
        shear_printed{"shear, printed", Symbol::cross, Stroke::none, {}, kOrange};
    for (const auto& row : cost.rows) {
        normal.points.push_back({row.values[6], row.values[0], row.name});
        shear.points.push_back({row.values[6], row.values[3], row.name});
        normal_printed.points.push_back({row.values[6], row.values[2], ""});
        shear_printed.points.push_back({row.values[6], row.values[5], ""});
    }
    cost.figure = {"Hairs: least stress that can be told, against time",
                   {"time a sample, ns (one hair: a division, no check)", true},
                   {"one standard deviation, Pa", false},
                   {normal, shear, normal_printed, shear_printed}};
    cost.advice = fmt::format(
        "Take four hairs: they tell a press of {:.1f} Pa where one tells {:.1f} Pa ({:.2f} times finer) for {:.0f} "
        "ns a sample more, and they alone tell a press from both shears.",
        of_four.normal_Pa, alone / per_normal_Pa, alone / per_normal_Pa / of_four.normal_Pa, ns[2] - ns[0]);
    return cost;
}

}  // namespace

extern const CostEntry hairs_cost;
const CostEntry hairs_cost{"hairs", "averaging four hairs against one: detection threshold against time",
                           "decoupling/costs_hairs.svg", measure};

}  // namespace tactiled::ctl
