#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <sstream>

#include "decoupling/fit/capacitive_fit.hpp"
#include "decoupling/fit/capacitive_model.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr double kPi = 3.14159265358979323846;
const std::vector<std::string> kChannels{"C1", "C2", "C3", "C4", "Cn"};

Calibration capacitive_calibration(const std::string& method) {
    Calibration calibration;
    calibration.path = "pad.toml";
    calibration.model = "capacitive";
    calibration.method = method;
    calibration.channels = kChannels;
    calibration.components = {"fx", "fy", "fz"};
    calibration.sd = {0.01, 0.01, 0.05};
    return calibration;
}

// The thesis' curves: eq. XXXIII for Cn, eq. XXXIV for each side electrode; no press on those, as printed.
Calibration thesis_calibration() {
    Calibration calibration = capacitive_calibration("quadratic");
    calibration.zero = {1.2285, 1.2285, 1.2285, 1.2285, 1.3039};
    calibration.parameters = {{"normal_b", 0.0405}, {"normal_a", 0.0008}, {"normal_range_N", 10.0}, {"shear_range_N", 1.2}};
    calibration.tables["side"] = {4, {0.038, 0.0071, 0, 0}};
    return calibration;
}

// What the thesis' sensor reads, from the printed equations.
std::vector<double> thesis_reading(double fx, double fy, double press) {
    const auto side = [](double F) { return 0.0071 * F * F + 0.038 * F + 1.2285; };
    return {side(fx), side(-fx), side(fy), side(-fy), 0.0008 * press * press + 0.0405 * press + 1.3039};
}

// Constants by hand: a pad over electrodes of the finite-element model, with stray capacitance.
Calibration overlap_calibration() {
    Calibration calibration = capacitive_calibration("overlap");
    calibration.zero = {0.0562 + 0.3, 0.0562 + 0.31, 0.0562 + 0.29, 0.0562 + 0.3, 0.1038 + 0.4};
    calibration.parameters = {{"stray_C1", 0.3},
                              {"stray_C2", 0.31},
                              {"stray_C3", 0.29},
                              {"stray_C4", 0.3},
                              {"stray_Cn", 0.4},
                              {"normal_stiffness_N", 31},
                              {"stiffening", 0.1},
                              {"shear_stiffness_N_per_m", 1195},
                              {"shear_gap_exponent", -0.4},
                              {"noise", 1e-5},
                              {"disc_radius_m", 4e-3},
                              {"inner_radius_m", 2.5e-3},
                              {"outer_radius_m", 6e-3},
                              {"opening_rad", 80 * kPi / 180},
                              {"centre_radius_m", 2e-3},
                              {"gap_m", 3e-3}};
    return calibration;
}

// Area that a disc of radius R at (dx, dy) shares with a sector, by quadrature over the angle; knows the edge, no closed
// form.
double sector_area_mm2(double R, double inner, double outer, double centre, double opening, double dx, double dy) {
    const int n = 400;
    const double d = std::hypot(dx, dy), phi = std::atan2(dy, dx);
    double sum = 0;
    for (int i = 0; i < n; ++i) {
        const double t = centre - opening / 2 + (i + 0.5) * opening / n - phi;
        const double edge = std::clamp(d * std::cos(t) + std::sqrt(R * R - std::pow(d * std::sin(t), 2)), inner, outer);
        sum += 0.5 * (edge * edge - inner * inner) * opening / n;
    }
    return sum;
}

// What the electrodes of overlap_calibration() read, pF, for closeness u and a shift in mm.
std::vector<double> pad_reading(const Calibration& calibration, double u, double dx, double dy) {
    std::vector<double> reading;
    const double rest = sector_area_mm2(4, 2.5, 6, 0, 80 * kPi / 180, 0, 0);
    const double centres[] = {0, kPi, kPi / 2, -kPi / 2};
    for (std::size_t e = 0; e < 4; ++e) {
        const double area = sector_area_mm2(4, 2.5, 6, centres[e], 80 * kPi / 180, dx, dy);
        reading.push_back(calibration.parameters.at("stray_" + kChannels[e]) + 0.0562 * u * area / rest);
    }
    reading.push_back(0.4 + 0.1038 * u * sector_area_mm2(4, 0, 2, 0, 2 * kPi, dx, dy) / (4 * kPi));
    return reading;
}

struct Pad {
    double fx, fy, fz;
};
Pad pad_force(double u, double dx_mm, double dy_mm) {
    const double k = 1.195 * std::pow(u, -0.4);
    const double lift = 0.5 * 0.4 * k * u * (dx_mm * dx_mm + dy_mm * dy_mm) / 3;  // half p k u shift^2 / gap
    return {k * dx_mm, k * dy_mm, -31.0 / 3 * (u * u - 1 / u) * std::pow(u, 0.1) + lift};
}

// ---- quadratic
// Errors of the converter, pF. Its accuracy of 4 fF is no noise: an offset of a channel goes into its zero, one of the
// converter is common to all channels. `each_pF`: independent of channel and sample.
struct ThesisError {
    double press_rms, press_worst, shear_rms, shear_worst;  // % of 10 N, of 1.2 N
};
ThesisError thesis_error(double common_pF, double each_pF) {
    const auto decoupler = make_decoupler(thesis_calibration());
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 1);
    std::uniform_real_distribution<double> any(-1, 1);
    ThesisError error{};
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
        const double fx = 1.2 * any(random), fy = 1.2 * any(random), press = 5 + 5 * any(random);
        auto reading = thesis_reading(fx, fy, press);
        const double common = common_pF * any(random);
        for (auto& pF : reading) pF += common + each_pF * noise(random);
        const Estimate estimate = decouple(*decoupler, reading);
        const double press_error = 10 * std::abs(-estimate.wrench_S[2] - press);
        const double shear_error = 100 / 1.2 * std::abs(estimate.wrench_S[0] - fx);
        error.press_rms += press_error * press_error / n;
        error.shear_rms += shear_error * shear_error / n;
        error.press_worst = std::max(error.press_worst, press_error);
        error.shear_worst = std::max(error.shear_worst, shear_error);
    }
    error.press_rms = std::sqrt(error.press_rms);
    error.shear_rms = std::sqrt(error.shear_rms);
    std::printf(
        "thesis' curves, %g fF common, %g fF each: press rms %.3f %% of 10 N, worst %.2f %%; shear rms %.3f %% of 1.2 N, "
        "worst "
        "%.2f %%\n",
        1e3 * common_pF, 1e3 * each_pF, error.press_rms, error.press_worst, error.shear_rms, error.shear_worst);
    return error;
}

TEST(Capacitive, QuadraticIsWithinTheThesisErrorsOnItsOwnCurves) {
    const ThesisError resolution = thesis_error(0, 4e-5);  // ten times 4 aF
    EXPECT_LT(resolution.press_worst, 0.05);
    EXPECT_LT(resolution.shear_worst, 0.5);
    const ThesisError accuracy = thesis_error(0.004, 0.0003);
    EXPECT_LT(accuracy.press_worst, 4.6);
    EXPECT_LT(accuracy.shear_worst, 2.5);
    // Were 4 fF the noise of each reading, no method could keep 2.5 % of 1.2 N: a pair has 0.076 pF/N.
    const ThesisError noise = thesis_error(0, 0.004);
    EXPECT_LT(noise.press_worst, 4.6);
    EXPECT_NEAR(noise.shear_rms, 100 / 1.2 * 0.004 * std::sqrt(2.0) / 0.076, 0.1);
}

TEST(Capacitive, QuadraticIsExactInsideAndStraightOutside) {
    const auto decoupler = make_decoupler(thesis_calibration());
    for (double press = 0; press <= 10; press += 0.25)
        for (const double fx : {-1.2, -0.3, 0.0, 1.2}) {
            const Estimate estimate = decouple(*decoupler, thesis_reading(fx, -0.5 * fx, press));
            ASSERT_NEAR(estimate.wrench_S[0], fx, 1e-13);
            ASSERT_NEAR(estimate.wrench_S[1], -0.5 * fx, 1e-13);
            ASSERT_NEAR(estimate.wrench_S[2], -press, 1e-13);
            ASSERT_EQ(estimate.quality, TACTILED_GOOD);
        }
    const double end = 0.0008 * 100 + 0.405 + 1.3039;
    const Estimate beyond = decouple(*decoupler, {1.2285, 1.2285, 1.2285, 1.2285, end + 0.0565 * 2});  // pF
    EXPECT_NEAR(beyond.wrench_S[2], -12, 1e-12);
    EXPECT_EQ(beyond.reasons, std::uint32_t{TACTILED_OUTSIDE_DOMAIN});
}

// The thesis' single curve has no real root 0.051 pF below its rest (errata 1.9); the difference of the pair has one.
TEST(Capacitive, APairGoesOnWhereOneElectrodeEnds) {
    Calibration calibration = thesis_calibration();
    calibration.parameters["shear_range_N"] = 3;
    const auto decoupler = make_decoupler(calibration);
    const auto reading = thesis_reading(2.7, 0, 0);
    EXPECT_NEAR(decouple(*decoupler, reading).wrench_S[0], 2.7, 1e-12);
    const Estimate falling = decouple(*decoupler, {kNaN, 1.1776, 1.2285, 1.2285, 1.3039});  // below the vertex of C2
    EXPECT_NEAR(falling.wrench_S[0], 2.676056338028169, 1e-12);
    EXPECT_EQ(falling.reasons,
              std::uint32_t{TACTILED_MISSING_CHANNEL | TACTILED_OUTSIDE_DOMAIN | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_TRUE(std::isnan(falling.sd[0]));
    const Estimate near = decouple(*decoupler, {kNaN, 1.1780, 1.2285, 1.2285, 1.3039});
    EXPECT_GT(near.sd[0], 0.01 * 4);  // N; the slope is a tenth of that at rest
}

TEST(Capacitive, OneElectrodeOfAPairIsEnoughWithALargerDeviation) {
    Calibration calibration = thesis_calibration();
    for (std::size_t e = 0; e < 4; ++e) calibration.tables["side"][e] = {0.038, 0.0071, 0.005 + 0.001 * double(e), 0.0001};
    const auto decoupler = make_decoupler(calibration);
    auto reading = thesis_reading(0.7, -0.4, 6);
    for (std::size_t e = 0; e < 4; ++e) reading[e] += (0.005 + 0.001 * double(e)) * 6 + 0.0001 * 36;
    EXPECT_NEAR(decouple(*decoupler, reading).wrench_S[0], 0.7, 1e-12);
    for (std::size_t missing = 0; missing < 4; ++missing) {
        const Estimate estimate = decouple(*decoupler, reading, 1u << missing);
        EXPECT_NEAR(estimate.wrench_S[0], 0.7, 1e-12);
        EXPECT_NEAR(estimate.wrench_S[1], -0.4, 1e-12);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        EXPECT_GT(estimate.sd[missing / 2], 0.0105);
        EXPECT_EQ(estimate.sd[1 - missing / 2], 0.01);
    }
    EXPECT_EQ(decouple(*decoupler, reading, 0b11).quality, TACTILED_BAD);
    EXPECT_EQ(decouple(*decoupler, reading, 0b10000).quality, TACTILED_BAD);
}

// ---- ratio and overlap
TEST(Capacitive, OverlapSolvesGapAndShiftTogether) {
    const Calibration calibration = overlap_calibration();
    const auto decoupler = make_decoupler(calibration);
    for (const double u : {0.9, 1.0, 1.2, 1.6})
        for (const double shift_mm : {0.0, 0.01, 0.5, 1.2})
            for (double azimuth = 0; azimuth < 2 * kPi; azimuth += 0.3) {
                const double dx = shift_mm * std::cos(azimuth), dy = shift_mm * std::sin(azimuth);
                const Estimate estimate = decouple(*decoupler, pad_reading(calibration, u, dx, dy));
                const Pad force = pad_force(u, dx, dy);
                SCOPED_TRACE(testing::Message() << u << " " << shift_mm << " " << azimuth);
                ASSERT_NEAR(estimate.wrench_S[0], force.fx, 3e-5);
                ASSERT_NEAR(estimate.wrench_S[1], force.fy, 3e-5);
                ASSERT_NEAR(estimate.wrench_S[2], force.fz, 1e-4);
                ASSERT_EQ(estimate.quality, TACTILED_GOOD);
            }
}

// The disc's edge passes the sectors' inner and outer radius, and uncovers the centre.
TEST(Capacitive, OverlapFollowsShiftsThatUncoverElectrodes) {
    const Calibration calibration = overlap_calibration();
    const auto decoupler = make_decoupler(calibration);
    for (const double shift_mm : {1.8, 2.4, 3.0})
        for (double azimuth = 0; azimuth < 2 * kPi; azimuth += 0.1) {
            const double dx = shift_mm * std::cos(azimuth), dy = shift_mm * std::sin(azimuth);
            const Estimate estimate = decouple(*decoupler, pad_reading(calibration, 1.2, dx, dy));
            const Pad force = pad_force(1.2, dx, dy);
            ASSERT_NEAR(estimate.wrench_S[0], force.fx, 0.005) << shift_mm << " " << azimuth;
            ASSERT_NEAR(estimate.wrench_S[1], force.fy, 0.005) << shift_mm << " " << azimuth;
            ASSERT_NEAR(estimate.wrench_S[2], force.fz, 0.03) << shift_mm << " " << azimuth;
            ASSERT_EQ(estimate.reasons, 0u) << shift_mm << " " << azimuth;
        }
}

TEST(Capacitive, OverlapGoesOnWithoutAnyOneElectrode) {
    const Calibration calibration = overlap_calibration();
    const auto decoupler = make_decoupler(calibration);
    const auto reading = pad_reading(calibration, 1.25, 0.6, -0.4);
    const Pad force = pad_force(1.25, 0.6, -0.4);
    for (std::size_t missing = 0; missing < 5; ++missing) {
        const Estimate estimate = decouple(*decoupler, reading, 1u << missing);
        SCOPED_TRACE(missing);
        EXPECT_NEAR(estimate.wrench_S[0], force.fx, 1e-4);
        EXPECT_NEAR(estimate.wrench_S[1], force.fy, 1e-4);
        EXPECT_NEAR(estimate.wrench_S[2], force.fz, 1e-3);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        EXPECT_GT(estimate.sd[0] + estimate.sd[1] + estimate.sd[2], 0.07 * 1.02);
    }
    EXPECT_EQ(decouple(*decoupler, reading, 0b00111).quality, TACTILED_BAD);  // two left
    EXPECT_EQ(decouple(*decoupler, reading, 0b10010).quality, TACTILED_UNCERTAIN);
}

TEST(Capacitive, OverlapFindsAnElectrodeThatIsWrong) {
    const Calibration calibration = overlap_calibration();
    auto reading = pad_reading(calibration, 1.25, 0.6, -0.4);
    EXPECT_LT(decouple(*make_decoupler(calibration), reading).residual, 1);
    reading[2] -= 0.01;  // pF
    const Estimate estimate = decouple(*make_decoupler(calibration), reading);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_GT(estimate.residual, 6);
}

TEST(Capacitive, RatioDoesNotDependOnTheGap) {
    Calibration calibration = overlap_calibration();
    calibration.method = "ratio";
    // sensitivity of C1 to a shift: 2 R sin(40 deg) / A
    const double per_mm = 2 * 4 * std::sin(40 * kPi / 180) / sector_area_mm2(4, 2.5, 6, 0, 80 * kPi / 180, 0, 0);
    for (const char* name : {"shear_stiffness_N_per_m", "noise", "disc_radius_m", "inner_radius_m", "outer_radius_m",
                             "opening_rad", "centre_radius_m", "gap_m"})
        calibration.parameters.erase(name);
    calibration.parameters["shear_scale_N"] = 1.195 / per_mm;
    const auto decoupler = make_decoupler(calibration);
    for (const double u : {0.9, 1.0, 1.3, 1.6}) {
        const Estimate estimate = decouple(*decoupler, pad_reading(calibration, u, 0.2, 0.1));
        const Pad force = pad_force(u, 0.2, 0.1);
        EXPECT_NEAR(estimate.wrench_S[0], force.fx, 0.002 * 0.25) << u;  // N; the third order of the shift
        EXPECT_NEAR(estimate.wrench_S[1], force.fy, 0.002 * 0.25) << u;
        EXPECT_NEAR(estimate.wrench_S[2], force.fz, 0.006) << u;  // N: what a shift does to the press is not in it
    }
}

TEST(Capacitive, RatioKnowsElectrodesOfUnequalSize) {
    Calibration calibration = capacitive_calibration("ratio");
    calibration.zero = {0.36, 0.35, 0.36, 0.36, 0.5};  // pF, C1 and C2 are not of one size
    calibration.parameters = {{"stray_C1", 0.3}, {"stray_C2", 0.3},          {"stray_C3", 0.3},     {"stray_C4", 0.3},
                              {"stray_Cn", 0.4}, {"normal_stiffness_N", 30}, {"shear_scale_N", 1.5}};
    const auto decoupler = make_decoupler(calibration);
    const double u = 1.25, shift = 0.2;  // in lengths over which an electrode doubles
    const std::vector<double> reading{0.3 + 0.06 * u * (1 + shift), 0.3 + 0.05 * u * (1 - shift), 0.3 + 0.06 * u,
                                      0.3 + 0.06 * u, 0.4 + 0.1 * u};
    const Estimate estimate = decouple(*decoupler, reading);
    EXPECT_NEAR(estimate.wrench_S[0], 1.5 * shift, 1e-14);
    EXPECT_NEAR(estimate.wrench_S[1], 0, 1e-14);
    EXPECT_NEAR(estimate.wrench_S[2], -10 * (u * u - 1 / u), 1e-13);
}

// ---- what comes in
TEST(Capacitive, IsFiniteOrBadForAnyBits) {
    Calibration ratio = overlap_calibration();
    ratio.method = "ratio";
    for (const char* name : {"shear_stiffness_N_per_m", "noise", "disc_radius_m", "inner_radius_m", "outer_radius_m",
                             "opening_rad", "centre_radius_m", "gap_m"})
        ratio.parameters.erase(name);
    ratio.parameters["shear_scale_N"] = 1.5;
    std::mt19937_64 random(20260304);
    const double inf = std::numeric_limits<double>::infinity();
    const double kinds[] = {0.35, 1.3, 0.5, kNaN, inf, -inf, 1e308, -1e308, -0.0, 5e-324};
    for (const Calibration& calibration : {thesis_calibration(), ratio, overlap_calibration()}) {
        const auto decoupler = make_decoupler(calibration);
        for (int i = 0; i < 50000; ++i) {
            std::vector<double> reading(5);
            for (auto& number : reading) {
                const auto bits = random();
                if (i % 2 == 0)
                    std::memcpy(&number, &bits, sizeof number);
                else
                    number = i % 4 == 1 ? kinds[bits % 10] : 3 * double(bits % 1000) / 1000 - 1;
            }
            const Estimate estimate = decouple(*decoupler, reading, std::uint32_t(random() & random() & random()),
                                               std::uint32_t(random() & random() & random()));
            for (std::size_t c = 0; c < 3; ++c)
                ASSERT_EQ(std::isfinite(estimate.wrench_S[c]), estimate.quality != TACTILED_BAD);
            ASSERT_TRUE(estimate.quality != TACTILED_BAD || estimate.reasons != 0u);
            if (estimate.quality == TACTILED_GOOD) {
                for (std::size_t c = 0; c < 3; ++c) ASSERT_GE(estimate.sd[c], 0.0099);
            }
        }
        // The same reading gives the same bits whatever came before.
        const auto reading = pad_reading(overlap_calibration(), 1.2, 0.3, 0.1);
        const Wrench after = decouple(*decoupler, reading).wrench_S,
                     fresh = decouple(*make_decoupler(calibration), reading).wrench_S;
        for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(after[c], fresh[c]);
    }
}

TEST(Capacitive, PressAndShearAreMonotoneInTheirChannels) {
    const Calibration calibration = overlap_calibration();
    for (const Calibration& one : {thesis_calibration(), calibration}) {
        const auto decoupler = make_decoupler(one);
        double last = -1e300;
        for (double pF = -1; pF < 4; pF += 0.01) {
            auto reading = one.zero;
            reading[4] += pF * 0.1;
            if (one.method == "overlap")  // all electrodes follow the gap
                for (std::size_t e = 0; e < 4; ++e) reading[e] += pF * 0.1 * 0.0562 / 0.1038;
            const double press = -decouple(*decoupler, reading).wrench_S[2];
            ASSERT_GE(press, last) << pF;
            last = press;
        }
        last = -1e300;
        for (double pF = -0.03; pF < 0.03; pF += 0.001) {
            auto reading = one.zero;
            reading[0] += pF;
            reading[1] -= pF;
            const double fx = decouple(*decoupler, reading).wrench_S[0];
            ASSERT_GT(fx, last) << pF;
            last = fx;
        }
    }
}

TEST(Capacitive, RefusesCalibrationsThatItCannotUse) {
    const auto refusal = [](const Calibration& calibration) {
        Problems problems;
        EXPECT_EQ(make_decoupler(calibration, problems), nullptr);
        return problems.empty() ? std::string() : problems.lines().front();
    };
    Calibration calibration = overlap_calibration();
    calibration.channels[3] = "C5";
    EXPECT_NE(refusal(calibration).find("\"C5\""), std::string::npos);
    calibration = overlap_calibration();
    calibration.channels[3] = "C1";
    EXPECT_NE(refusal(calibration).find("\"C1\" twice"), std::string::npos);
    calibration = overlap_calibration();
    calibration.parameters["stray_Cn"] = 0.6;
    EXPECT_NE(refusal(calibration).find("stray_Cn"), std::string::npos);
    calibration = overlap_calibration();
    calibration.parameters.erase("disc_radius_m");
    EXPECT_NE(refusal(calibration).find("disc_radius_m is missing"), std::string::npos);
    calibration = overlap_calibration();
    calibration.parameters["disc_radius_m"] = 7e-3;
    EXPECT_NE(refusal(calibration).find("disc_radius_m < outer_radius_m"), std::string::npos);
    calibration = overlap_calibration();
    calibration.parameters["stiffening"] = 2;  // the law would not be monotone
    EXPECT_NE(refusal(calibration).find("stiffening"), std::string::npos);
    calibration = overlap_calibration();
    calibration.components[2] = "mz";
    EXPECT_NE(refusal(calibration).find("\"mz\""), std::string::npos);
    calibration = thesis_calibration();
    calibration.tables.clear();
    EXPECT_NE(refusal(calibration).find("table side"), std::string::npos);
    calibration = thesis_calibration();
    calibration.parameters["normal_bb"] = 1;
    EXPECT_NE(refusal(calibration).find("did you mean normal_b?"), std::string::npos);
}

// ---- fits, on finite elements
std::vector<std::vector<std::string>> cells_of(const std::string& name) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/fem/" + name);
    std::vector<std::vector<std::string>> rows;
    std::string line;
    std::getline(file, line);
    while (std::getline(file, line)) {
        std::vector<std::string> cells;
        std::string cell;
        bool quoted = false;
        for (const char c : line) {
            if (c == '"')
                quoted = !quoted;
            else if (c == ',' && !quoted)
                cells.push_back(std::exchange(cell, ""));
            else
                cell += c;
        }
        cells.push_back(cell);
        rows.push_back(cells);
    }
    return rows;
}

double interpolate(const std::map<double, double>& table, double at) {
    auto above = table.lower_bound(at);
    if (above == table.begin()) ++above;
    if (above == table.end()) --above;
    const auto below = std::prev(above);
    return std::lerp(below->second, above->second, (at - below->first) / (above->first - below->first));
}

// Press from cap_curves.csv (bonded, neo-Hookean), the force that a shift needs and its pull on the press from cap_shear.csv
// (two levels of compression, linear in between and beyond), areas from cap_overlap.csv. Nothing of it knows a formula of
// the models.
struct FiniteElements {
    std::map<double, double> gap_change_mm, Cn_pF;           // by N
    std::map<double, double> shear_N[2], press_change_N[2];  // by mm of shift; free, and at 0.413 mm
    double compressed_mm = 0.4132776854622177;
    struct Area {
        double shift_mm, azimuth_deg, mm2[4];
    };
    std::vector<Area> areas;

    FiniteElements() {
        for (const auto& row : cells_of("cap_curves.csv"))
            if (row[0] == "normal" && row[1] == "bonded") {
                gap_change_mm[std::stod(row[2])] = std::stod(row[4]);
                Cn_pF[std::stod(row[2])] = std::stod(row[6]);
            }
        std::map<double, double> fz[2];
        for (const auto& row : cells_of("cap_shear.csv")) {
            const int level = row[0].starts_with("Fz free") ? 0 : 1;
            shear_N[level][std::stod(row[1])] = std::stod(row[3]);
            fz[level][std::stod(row[1])] = std::stod(row[4]);
        }
        shear_N[1][0] = 0;
        // Fz at no shift, from a parabola through the first and the last: the shear runs have a coarser mesh, 5.6 % stiffer,
        // so that only the change is used.
        const double at_rest = (16 * fz[1].at(0.25) - fz[1].at(1.0)) / 15;
        for (const auto& [mm, N] : fz[0]) press_change_N[0][mm] = -N;
        for (const auto& [mm, N] : fz[1]) press_change_N[1][mm] = at_rest - N;
        press_change_N[1][0] = 0;
        for (const auto& row : cells_of("cap_overlap.csv"))
            areas.push_back({std::stod(row[0]),
                             std::stod(row[1]),
                             {std::stod(row[2]), std::stod(row[3]), std::stod(row[4]), std::stod(row[5])}});
    }

    // Quarter turns and the mirror bring 0, 22.5 and 45 degrees everywhere.
    [[nodiscard]] LabelledRow row(const Area& area, int quarter, bool mirrored, double press_N) const {
        const double gap_mm = 3 - interpolate(gap_change_mm, press_N),
                     share = interpolate(gap_change_mm, press_N) / compressed_mm;
        const auto at_share = [&](const std::map<double, double>* table) {
            return std::lerp(interpolate(table[0], area.shift_mm), interpolate(table[1], area.shift_mm), share);
        };
        const double shear = at_share(shear_N), press = press_N + at_share(press_change_N);
        const double angle = (mirrored ? -1 : 1) * area.azimuth_deg * kPi / 180 + quarter * kPi / 2;
        // C1 +x, C3 +y, C2 -x, C4 -y in the order of the angle.
        const int counter_clockwise[4] = {0, 2, 1, 3};
        std::array<double, 4> by_angle{area.mm2[0], area.mm2[mirrored ? 3 : 2], area.mm2[1], area.mm2[mirrored ? 2 : 3]};
        LabelledRow result{.line = 0, .channel = std::vector<double>(5)};
        const double rest_mm2 = 6.806784082778003, rest_pF = 0.056250641692087745;
        for (int k = 0; k < 4; ++k)
            result.channel[std::size_t(counter_clockwise[(k + quarter) % 4])] =
                0.35 + rest_pF * by_angle[std::size_t(k)] / rest_mm2 * 3 / gap_mm;
        result.channel[4] = 0.37 + interpolate(Cn_pF, press_N);
        result.wrench_S = {shear * std::cos(angle), shear * std::sin(angle), -press, kNaN, kNaN, kNaN};
        return result;
    }
};

struct Rms {
    double shear_N, press_N;
};
Rms rms_of(const Calibration& calibration, const Rows& rows) {
    const auto decoupler = make_decoupler(calibration);
    Rms rms{0, 0};
    for (const auto* row : rows) {
        const Estimate estimate = decouple(*decoupler, row->channel);
        rms.shear_N +=
            (std::pow(estimate.wrench_S[0] - row->wrench_S[0], 2) + std::pow(estimate.wrench_S[1] - row->wrench_S[1], 2)) /
            2;
        rms.press_N += std::pow(estimate.wrench_S[2] - row->wrench_S[2], 2);
    }
    return {std::sqrt(rms.shear_N / double(rows.size())), std::sqrt(rms.press_N / double(rows.size()))};
}

std::vector<LabelledRow> fem_rows(bool on_axis, double noise_pF, unsigned seed) {
    static const FiniteElements fem;
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, noise_pF);
    std::vector<LabelledRow> rows;
    for (const double press : {0.0, 1.0, 2.5, 5.0, 7.5, 10.0})
        for (const auto& area : fem.areas) {
            if ((area.azimuth_deg == 0) != on_axis || (area.shift_mm == 0) > on_axis) continue;
            for (int quarter = 0; quarter < 4; ++quarter)
                for (const bool mirrored : {false, true}) {
                    if (mirrored && area.azimuth_deg != 22.5) continue;
                    // On the axes as one calibrates: press alone, shear alone, and shear under 5 N.
                    if (on_axis && area.shift_mm > 0 && press != 0 && press != 5) continue;
                    rows.push_back(fem.row(area, quarter, mirrored, press));
                    for (auto& pF : rows.back().channel) pF += noise(random);
                }
        }
    return rows;
}

Rows pointers_to(const std::vector<LabelledRow>& rows) {
    Rows result;
    for (const auto& row : rows) result.push_back(&row);
    return result;
}

using FitFunction = void (*)(const Rows&, Calibration&, std::vector<std::string>&);
const std::pair<const char*, FitFunction> kFitOf[] = {
    {"quadratic", fit_capacitive_quadratic}, {"ratio", fit_capacitive_ratio}, {"overlap", fit_capacitive_overlap}};

void state_geometry(Calibration& calibration) {
    for (const char* name : {"disc_radius_m", "inner_radius_m", "outer_radius_m", "opening_rad", "centre_radius_m", "gap_m"})
        calibration.parameters[name] = overlap_calibration().parameters.at(name);
}

TEST(CapacitiveFit, OverlapIsBetterThanQuadraticOffTheAxisOnFiniteElements) {
    const double noise_pF = 4e-6 * 10;  // ten times the converter's resolution of 4 aF
    const auto on_axis = fem_rows(true, noise_pF, 1), off_axis = fem_rows(false, noise_pF, 2);
    std::map<std::string, Rms> on, off;
    std::printf(
        "finite elements, %zu rows on the axes, %zu off: rms %% of 1.2 N shear, of 10 N press\n"
        "                 shear on    off   press on    off\n",
        on_axis.size(), off_axis.size());
    for (const auto& [name, fit] : kFitOf) {
        Calibration calibration = capacitive_calibration(name);
        if (calibration.method == "overlap") state_geometry(calibration);
        std::vector<std::string> warnings;
        fit(pointers_to(on_axis), calibration, warnings);
        for (const auto& warning : warnings) ADD_FAILURE() << warning;
        on[name] = rms_of(calibration, pointers_to(on_axis));
        off[name] = rms_of(calibration, pointers_to(off_axis));
        if (calibration.method == "overlap") {
            const auto decoupler = make_decoupler(calibration);
            for (const auto& row : off_axis) EXPECT_EQ(decouple(*decoupler, row.channel).quality, TACTILED_GOOD);
        }
        std::printf("%-12s %10.3f %8.3f %8.3f %8.3f   condition %.3g\n", name, 100 * on[name].shear_N / 1.2,
                    100 * off[name].shear_N / 1.2, 10 * on[name].press_N, 10 * off[name].press_N, calibration.condition);
    }
    Calibration assumed = capacitive_calibration("overlap");
    std::vector<std::string> warnings;
    fit_capacitive_overlap(pointers_to(on_axis), assumed, warnings);
    EXPECT_EQ(warnings.size(), 1u);
    const Rms wrong = rms_of(assumed, pointers_to(off_axis));
    std::printf("overlap, assumed geometry (wrong by 20 %%): off the axes %.3f shear, %.3f press\n",
                100 * wrong.shear_N / 1.2, 10 * wrong.press_N);
    EXPECT_LT(wrong.shear_N, off["quadratic"].shear_N);
    EXPECT_LT(20 * off["overlap"].shear_N, off["quadratic"].shear_N);
    EXPECT_LT(off["overlap"].shear_N, 0.01 * 1.2);
    EXPECT_LT(off["overlap"].press_N, 0.7 * off["quadratic"].press_N);
    EXPECT_LT(off["overlap"].shear_N, off["ratio"].shear_N);
}

// A sensor of the models themselves: the fit finds the forces of readings that it had not seen.
TEST(CapacitiveFit, OverlapIsFittedThroughNoiseAndSwappedLabels) {
    const Calibration truth = overlap_calibration();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any(-1, 1);
    std::normal_distribution<double> noise(0, 2e-5);
    std::vector<LabelledRow> rows, fresh;
    for (int i = 0; i < 600; ++i) {
        const double u = 1.15 + 0.2 * any(random), dx = 0.8 * any(random), dy = 0.8 * any(random);
        LabelledRow row{.line = i, .channel = pad_reading(truth, u, dx, dy)};
        const Pad force = pad_force(u, dx, dy);
        row.wrench_S = {force.fx, force.fy, force.fz, kNaN, kNaN, kNaN};
        for (auto& pF : row.channel) pF += noise(random);
        (i < 300 ? rows : fresh).push_back(row);
    }
    std::swap(rows[10].wrench_S, rows[200].wrench_S);
    Calibration calibration = capacitive_calibration("overlap");
    state_geometry(calibration);
    std::vector<std::string> warnings;
    fit_capacitive_overlap(pointers_to(rows), calibration, warnings);
    EXPECT_NEAR(calibration.parameters.at("noise"), 2e-5, 0.4e-5);
    EXPECT_NEAR(calibration.parameters.at("shear_gap_exponent"), -0.4, 0.1);
    EXPECT_NEAR(calibration.parameters.at("shear_stiffness_N_per_m"), 1195, 60);
    const Rms rms = rms_of(calibration, pointers_to(fresh));
    EXPECT_LT(rms.shear_N, 0.002);
    EXPECT_LT(rms.press_N, 0.02);
}

TEST(CapacitiveFit, DerivativesOfTheModelAreThoseOfDifferences) {
    const ElectrodeGeometry geometry{4e-3, 2.5e-3, 6e-3, 1.4, 2e-3, 3e-3};
    const double at[kUnknowns] = {0.3, 0.31, 0.32, 0.33, 0.5, -2.9, -2.8, -2.9, -2.9, -2.3, 3.4, 0.1, 1.6, -0.4};
    using Jet = ceres::Jet<double, kUnknowns>;
    for (const bool exact : {false, true})
        for (const Wrench force : {Wrench{0.6, -0.4, -5}, Wrench{-0.2, 0.9, -0.5}, Wrench{0, 0, -8}, Wrench{3, 1, 0}}) {
            const CapacitiveModel model{exact ? &geometry : nullptr};
            Jet p[kUnknowns], reading[kElectrodes];
            for (int i = 0; i < kUnknowns; ++i) p[i] = Jet(at[i], i);
            model(p, force, reading);
            for (int i = 0; i < kUnknowns; ++i) {
                double more[kUnknowns], less[kUnknowns], above[kElectrodes], below[kElectrodes];
                std::copy(at, at + kUnknowns, more);
                std::copy(at, at + kUnknowns, less);
                more[i] += 1e-5;
                less[i] -= 1e-5;
                model(more, force, above);
                model(less, force, below);
                for (std::size_t e = 0; e < kElectrodes; ++e)
                    EXPECT_NEAR(reading[e].v[i], (above[e] - below[e]) / 2e-5, 2e-8)
                        << exact << " unknown " << i << " electrode " << e;
            }
        }
}

TEST(CapacitiveFit, RefusesWhatDataOrGeometryDoNotDetermine) {
    const auto refusal = [](FitFunction fit, const std::vector<LabelledRow>& rows, Calibration calibration) {
        std::vector<std::string> warnings;
        try {
            fit(pointers_to(rows), calibration, warnings);
        } catch (const Undetermined& what) { return std::string(what.what()); }
        return std::string(warnings.empty() ? "accepted" : "warned: " + warnings.front());
    };
    auto rows = fem_rows(true, 4e-5, 3);
    Calibration calibration = capacitive_calibration("overlap");
    EXPECT_NE(refusal(fit_capacitive_overlap, rows, calibration).find("geometry is not stated"), std::string::npos);
    calibration.parameters["disc_radius_m"] = 4e-3;
    EXPECT_NE(refusal(fit_capacitive_overlap, rows, calibration).find("missing: inner_radius_m"), std::string::npos);
    state_geometry(calibration);
    calibration.channels = {"C2", "C1", "C3", "C4", "Cn"};
    for (const auto& [name, fit] : kFitOf)
        EXPECT_NE(refusal(fit, rows, calibration).find("C1 lies on +x"), std::string::npos) << name;
    calibration.channels = kChannels;
    auto flipped = rows;
    for (auto& row : flipped) row.wrench_S[2] = -row.wrench_S[2];
    for (const auto& [name, fit] : kFitOf)
        EXPECT_NE(refusal(fit, flipped, calibration).find("it must rise"), std::string::npos) << name;
    for (auto& row : rows) row.wrench_S[1] = 0;
    for (const auto& [name, fit] : kFitOf)
        EXPECT_NE(refusal(fit, rows, calibration).find("independently"), std::string::npos) << name;
    calibration.components = {"fz"};
    EXPECT_NE(refusal(fit_capacitive_ratio, rows, calibration).find("labels"), std::string::npos);
    EXPECT_EQ(refusal(fit_capacitive_quadratic, rows, calibration), "accepted");
}

}  // namespace
}  // namespace tactiled
