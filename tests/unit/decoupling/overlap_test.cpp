#include "decoupling/capacitive/sector_overlap.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <sstream>

#include "decoupling/capacitive/pad.hpp"
#include "decoupling/solve/curve.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double degrees(double angle) { return angle * kPi / 180; }

double area(const Sector& sector, double R, double dx, double dy) {
    return area_at_rest(sector, R) + overlap(sector, R, dx, dy).change;
}

// The same area by counting: the share of a fine polar grid in the disc. Uses no formula of the edge.
double area_by_counting(const Sector& sector, double R, double dx, double dy, int n = 1500) {
    double sum = 0;
    const double dr = (sector.outer - sector.inner) / n, dt = 2 * sector.half_opening / n;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double r = sector.inner + (i + 0.5) * dr, t = sector.centre - sector.half_opening + (j + 0.5) * dt;
            if (std::hypot(r * std::cos(t) - dx, r * std::sin(t) - dy) < R) sum += r * dr * dt;
        }
    return sum;
}

// Quadrature with 30 digits: R = 5, inner radius 3, 80 degrees; mm.
TEST(Overlap, HasTheAreasOfThirtyDigitQuadrature) {
    const auto of = [](double centre, double shift) { return area({3, 7, degrees(centre), degrees(40)}, 5, shift, 0); };
    EXPECT_NEAR(of(0, 1), 18.0726374079756, 5e-14);
    EXPECT_NEAR(of(90, 1), 10.6777033362576, 5e-14);
    EXPECT_NEAR(of(180, 1), 5.25238477056405, 5e-14);
    EXPECT_NEAR(of(270, 1), 10.6777033362576, 5e-14);
    EXPECT_NEAR(of(0, 0.5), 14.5049316536622, 5e-14);
    EXPECT_NEAR(of(90, 0.5), 11.0470062436372, 5e-14);
    EXPECT_NEAR(of(180, 0.5), 8.08148471011823, 5e-14);
}

// Hard case H08: 1 pm of shift; the difference of two areas keeps 7 digits.
TEST(Overlap, ChangeOfAPicometreIsExact) {
    const double half = 0.7;
    const Overlap change = overlap({3e-3, 7e-3, 0, half}, 5e-3, 1e-12, 0);
    EXPECT_NEAR(change.change / 6.442176872869635066575359e-15, 1, 5e-15);
}

TEST(Overlap, OfFourSectorsCancelsToTheSecondOrder) {
    double sum = 0;
    for (const double centre : {0., 90., 180., 270.})
        sum += overlap({3, 7, degrees(centre), degrees(40)}, 5, 1e-4, 2e-4).change;
    EXPECT_NEAR(sum, 0, 1e-14);  // mm^2; each alone 1e-3
}

// cap_overlap.csv: fine quadrature of the electrodes of the finite-element model, R = 4 mm, inner radius 2.5 mm.
TEST(Overlap, AgreesWithTheIndependentTable) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/fem/cap_overlap.csv");
    std::string line;
    std::getline(file, line);
    int rows = 0;
    while (std::getline(file, line)) {
        std::istringstream cells(line);
        std::string cell;
        std::vector<double> number;
        while (std::getline(cells, cell, ',')) number.push_back(std::stod(cell));
        const double dx = number[0] * std::cos(degrees(number[1])), dy = number[0] * std::sin(degrees(number[1]));
        for (const auto& [column, centre] : {std::pair{2, 0.}, {3, 180.}, {4, 90.}, {5, 270.}})
            EXPECT_NEAR(area({2.5, 7, degrees(centre), degrees(40)}, 4, dx, dy), number[std::size_t(column)], 2e-6) << line;
        ++rows;
    }
    EXPECT_EQ(rows, 39);
}

TEST(Overlap, ClipsAtBothRadiiForEveryShift) {
    std::mt19937 random(20260302);
    std::uniform_real_distribution<double> any(0, 1);
    for (int i = 0; i < 30; ++i) {
        const double R = 3 + 4 * any(random), shift = 0.95 * R * any(random), phi = 2 * kPi * any(random);
        const double inner = 4 * any(random), outer = inner + 0.5 + 4 * any(random);
        const Sector sector{i % 5 == 0 ? 0 : inner, outer, 2 * kPi * any(random) - kPi,
                            i % 5 == 0 ? kPi : 0.1 + 1.4 * any(random)};
        const double dx = shift * std::cos(phi), dy = shift * std::sin(phi);
        const double counted = area_by_counting(sector, R, dx, dy);
        EXPECT_NEAR(area(sector, R, dx, dy), counted, 2e-3 * outer * outer) << i;
        EXPECT_GE(area(sector, R, dx, dy), -1e-12);
        // The derivative against a difference.
        const double h = 1e-6;
        const Overlap at = overlap(sector, R, dx, dy);
        if (shift < h) continue;
        EXPECT_NEAR(at.d_dx, (area(sector, R, dx + h, dy) - area(sector, R, dx - h, dy)) / (2 * h), 1e-5) << i;
        EXPECT_NEAR(at.d_dy, (area(sector, R, dx, dy + h) - area(sector, R, dx, dy - h)) / (2 * h), 1e-5) << i;
    }
}

TEST(Overlap, HasNoStepWhereClippingBegins) {
    const Sector sector{3, 5.5, 0, degrees(40)};
    for (const double touch : {0.5, 2.0}) {  // R + d = outer, R - d = inner
        const double before = area(sector, 5, touch * (1 - 1e-9), 0), after = area(sector, 5, touch * (1 + 1e-9), 0);
        EXPECT_NEAR(before, after, 1e-7);
    }
}

// The thesis' eq. XXVI takes gamma a d instead of 2 a d sin(gamma / 2) at first order (errata 1.7).
TEST(Overlap, ShowsTheErrorOfTheConcentricFormula) {
    const auto ratio = [](double gamma) { return gamma * 5 * 1e-6 / overlap({3, 7, 0, gamma / 2}, 5, 1e-6, 0).change; };
    EXPECT_NEAR(ratio(degrees(80)), 1.0861, 5e-5);
    EXPECT_NEAR(ratio(degrees(90)), 1.1107, 5e-5);
    const double sideways = overlap({3, 7, degrees(90), degrees(40)}, 5, 0.01, 0).change;
    EXPECT_NEAR(sideways, -0.5 * 0.01 * 0.01 * std::sin(degrees(80)), 1e-8);
}

// ---- curve.hpp
TEST(Curve, InvertsWithoutCancellation) {
    const Curve normal(0.0405, 0.0008, 0, 10);                                                       // eq. XXXIII
    EXPECT_NEAR(normal.inverse(1.303900001 - 1.3039).F / 2.469135457303791728427245e-8, 1, 1e-14);   // H02
    EXPECT_NEAR(Curve(0.0405, 1e-18, 0, 10).inverse(0.4).F / 9.876543209876541038232449, 1, 1e-15);  // H03
    EXPECT_EQ(Curve(0.0405, 0, 0, 10).inverse(0.4).F, 0.4 / 0.0405);
    EXPECT_EQ(discriminant(94906265.625, 189812534.0, -94906268.375), 7.5625);  // H05
}

// H04: the falling electrode of eq. XXXIV. The reading 1.1776 pF is below the minimum of the curve.
TEST(Curve, EndsAtItsVertex) {
    const Curve shear(0.038, 0.0071, -3, 3);
    const auto force = shear.inverse(1.1776 - 1.2285);
    EXPECT_NEAR(force.F, -2.676056338028169, 1e-14);
    EXPECT_NEAR(force.slope, 0, 1e-15);
    EXPECT_EQ(shear.inverse(-1e300).F, force.F);
}

TEST(Curve, GoesOnStraightAndStaysMonotone) {
    for (const double a : {0.0008, -0.0008, 0.0, 0.0071, -0.0071}) {
        const Curve curve(0.0405, a, -1.2, 10);
        double last = -1e9;
        for (double y = -1; y < 2; y += 1e-3) {
            const double F = curve.inverse(y).F;
            ASSERT_GE(F, last);
            last = F;
            if (curve.inverse(y).slope > 1e-4) { ASSERT_NEAR(curve.y(F), y, 1e-12); }
        }
    }
    const Curve normal(0.0405, 0.0008, 0, 10);
    EXPECT_NEAR(normal.inverse(0.485 + 0.0565).F, 11, 1e-12);  // end slope 0.0405 + 2 * 0.0008 * 10 pF/N
    EXPECT_NEAR(normal.inverse(-0.0405).F, -1, 1e-12);
}

// ---- pad.hpp
TEST(Pad, BondedModulusIsThatOfGentAndLindley) {
    EXPECT_NEAR(bonded_disc_modulus(1e5, 1e9, 1), 299910.02699190244, 1e-9);  // H23b, Pa
}

TEST(Pad, LawIsMonotoneForEveryExponentAndExactForTheSmallestPress) {
    for (const double q : {-2.0, -0.5, 0.0, 0.13, 1.0}) {
        const PadLaw law{30, q, 1, 0};
        double last = -1e300;
        for (double v = kMinCloseness - 1; v < kMaxCloseness - 1; v += 0.01) {
            ASSERT_GT(law.press_N(v), last) << q << " " << v;
            last = law.press_N(v);
        }
        EXPECT_NEAR(law.press_N(1e-14) / 30e-14, 1, 1e-13);
    }
    const PadLaw neo_hookean{30, 0, 1, 0};
    EXPECT_NEAR(neo_hookean.press_N(0.25), 10 * (1.5625 - 0.8), 1e-13);  // K/3 (u^2 - 1/u), u = 1.25
}

}  // namespace
}  // namespace tactiled
