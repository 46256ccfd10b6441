// Model "hair": a small shear under a large press, leak terms, a nearly incompressible elastomer.
#include <Eigen/Dense>
#include <boost/math/constants/constants.hpp>
#include <cmath>

#include "decoupling/hair/physics.hpp"
#include "decoupling/hair/stages.hpp"
#include "decoupling/solve/domain.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

constexpr double kArea_m2 = 2.827e-5, kNormal_per_Pa = 3.74e-7, kShear_per_Pa = 7.91e-7, kScale_Pa = 2000;

std::vector<double> paper(double sigma, double tau_x, double tau_y) {
    const double s = kNormal_per_Pa * sigma, x = kShear_per_Pa * tau_x, y = kShear_per_Pa * tau_y;
    return {s - x, s - y, s + x, s + y};
}

void add_sums_and_differences(Cases& cases) {
    const Calibration c = calibration_of("hair/sum_diff");
    // H01: the difference of two readings that agree in three digits. Both readings and their difference are exact as
    // doubles.
    const auto r = paper(2000, 0.5, 0);
    const double R0 = 1000.1;
    const auto ratio = [&](double x) { return float(float(R0 * (1 + x)) - float(R0)) / float(R0); };  // single precision
    cases.value("H01", "0.5 Pa of shear under 2 kPa of press: fx",
                {double(ratio(r[2]) - ratio(r[0])) / (2 * kShear_per_Pa) * kArea_m2, estimate_of(c, r).wrench_S[0],
                 (Real(r[2]) - Real(r[0])) / (2 * Real(kShear_per_Pa)) * Real(kArea_m2), 1, 8, 0, Textbook::single});
    // The same on counts with a large rest: sums first, as printed, lose what they share.
    Calibration counts = c;
    counts.zero.assign(4, 1e9);
    std::vector<double> raised;
    for (const double x : r) raised.push_back(1e9 + x);
    const Real sum = (Real(raised[0]) + Real(raised[1]) + Real(raised[2]) + Real(raised[3])) - 4 * Real(1e9);
    const double naive = double((float(raised[0]) + float(raised[1]) + float(raised[2]) + float(raised[3])) - 4e9f);
    cases.value("S1", "2 kPa of press on a rest of 1e9 units: fz",
                {-naive / (4 * kNormal_per_Pa) * kArea_m2, estimate_of(counts, raised).wrench_S[2],
                 -sum / (4 * Real(kNormal_per_Pa)) * Real(kArea_m2), 1, 8, 0, Textbook::single});
    auto lost = paper(1000, 200, -100);
    lost[2] = std::numeric_limits<double>::quiet_NaN();
    cases.marked("S2", "H3 is not a number, three hairs left: fx",
                 {as_good((lost[2] - lost[0]) / (2 * kShear_per_Pa) * kArea_m2), published(estimate_of(c, lost), 0),
                  TACTILED_MISSING_CHANNEL, 200 * kArea_m2, 1e-13});
}

// r = G load + leak(load): solved in 100 digits by Newton's method.
std::array<Real, 3> exact_load(const Calibration& c, const std::vector<double>& r) {
    std::array<Real, 3> load{};
    // Weighted least squares of four hairs, as the product minimises it: the pseudo-inverse of the gains at equal noise.
    const auto& gains = c.tables.at("gains");
    Eigen::Matrix<Real, 4, 3> g;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 3; ++j) g(i, j) = Real(gains[std::size_t(i)][std::size_t(j)]) * Real(kScale_Pa);
    const Eigen::Matrix<Real, 3, 3> gram = g.transpose() * g;
    const Eigen::PartialPivLU<Eigen::Matrix<Real, 3, 3>> lu(gram);
    for (int step = 0; step < 400; ++step) {  // the same contraction as in the product, to its end
        Eigen::Matrix<Real, 4, 1> rest;
        for (int i = 0; i < 4; ++i) {
            const auto& leak = c.tables.at("leak")[std::size_t(i)];
            rest[i] = Real(r[std::size_t(i)]);
            for (std::size_t t = 0; t < kLeakTerms; ++t) {
                Real product(leak[t]);
                for (std::size_t j = 0; j < 3; ++j)
                    for (int n = 0; n < kLeakExponents[t][j]; ++n) product *= load[j];
                rest[i] -= product;
            }
        }
        const Eigen::Matrix<Real, 3, 1> next = lu.solve(g.transpose() * rest);
        for (int j = 0; j < 3; ++j) load[std::size_t(j)] = next[j];
    }
    return load;
}

void add_leak(Cases& cases) {
    Calibration c = calibration_of("hair/matrix");
    for (auto& row : c.tables["leak"])  // contraction 0.4: near the limit of 0.5 for this iteration
        for (double& number : row) number *= 4.5;
    const auto r = paper(1800, -900, 1100);
    const auto load = exact_load(c, r);
    double naive = 0;  // the leak taken off once
    {
        const HairLoad first{1800 / kScale_Pa, -900 / kScale_Pa, 1100 / kScale_Pa};
        const LeakTerms terms = leak_terms(first);
        std::vector<double> rest = r;
        for (std::size_t i = 0; i < 4; ++i)
            for (std::size_t t = 0; t < kLeakTerms; ++t) rest[i] -= c.tables["leak"][i][t] * terms[t];
        naive = (rest[0] + rest[1] + rest[2] + rest[3]) / (4 * kNormal_per_Pa) * kArea_m2;
    }
    // The fixed point of a contraction q = 0.5 at most has the condition 1 / (1 - q) = 2 beside that of the gains, 2.1; the
    // iteration stops at a change of 1e-14 of full scale, so it is 1e-14 q / (1 - q) off.
    cases.value("S3", "leak terms that shrink by 0.4 a step: fz",
                {-naive, estimate_of(c, r).wrench_S[2], -load[0] * Real(kScale_Pa) * Real(kArea_m2), 4.2, 16,
                 2e-14 / std::abs(double(load[0]))});
    for (auto& row : c.tables["leak"])
        for (double& number : row) number *= 4;
    cases.refused("S4", "leak terms on which the iteration would not end", std::numeric_limits<double>::quiet_NaN(),
                  refusal_of(c), "leak terms are too large");
    auto blind = calibration_of("hair/sum_diff");
    blind.tables["gains"][2][0] = -blind.tables["gains"][0][0];
    cases.refused("S5", "hairs H1 H3 that answer a press with opposite signs", std::numeric_limits<double>::infinity(),
                  refusal_of(blind), "SUM has no meaning");
}

// G = E / 2 (1 + nu) has no 1 - 2 nu in it.
void add_incompressible(Cases& cases) {
    Calibration c = calibration_of("hair/physics");
    c.parameters["poisson"] = 0.4999;
    const auto r = paper(1000, 300, 0);
    auto& p = c.parameters;
    const Real pi = boost::math::constants::pi<Real>(), root3 = sqrt(Real(3));
    const Real slender = Real(p["radius_m"]) / Real(p["thickness_m"]);
    const Real mean = 9 * (2 * pi + 5 * root3) / (8 * pi),
               per = Real(p["pi_l_per_Pa"]) * slender * slender / Real(p["width_m"]);
    const Real modulus = 1000 * Real(p["elastomer_kPa"]) / (2 * (1 + Real(0.4999)));
    const Real sensitivity = mean * per * Real(p["k_x_Pa"]) * Real(1.5) * Real(p["radius_m"]) / modulus;
    const Real fx = (Real(r[2]) - Real(r[0])) / (2 * sensitivity) * Real(kArea_m2);
    cases.value("H23c", "physics of a hair in an elastomer with nu = 0.4999: fx",
                {kNaN, estimate_of(c, r).wrench_S[0], fx, 1, 32, 0, Textbook::none});
    c.parameters["poisson"] = 0.50001;
    cases.refused("S6", "an elastomer with nu above 0.5", double(fx), refusal_of(c), "outside 0 .. 0.5");
}

}  // namespace

void add_hair_cases(Cases& cases) {
    add_sums_and_differences(cases);
    add_leak(cases);
    add_incompressible(cases);
}

}  // namespace tactiled::stability
