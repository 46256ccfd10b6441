// The shipped calibrations and recordings are as their comments state.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "decoupling/csv.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/latency.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

const std::string kRoot = TACTILED_SOURCE_DIR;

Calibration loaded(const std::string& name) {
    Problems problems;
    Calibration calibration = load_calibration(kRoot + "/config/calibration/" + name, problems);
    problems.throw_if_any();
    return calibration;
}

// Calls `each` for every row of a recording with its estimate by the calibration.
template <typename Each>
void decouple_file(const Calibration& calibration, const std::string& path, Each each) {
    const auto decoupler = make_decoupler(calibration);
    CsvReader csv(path);
    std::vector<std::size_t> columns;
    for (const auto& name : calibration.channels) columns.push_back(csv.find(name).value());
    std::vector<double> channel(columns.size());
    while (csv.next()) {
        for (std::size_t k = 0; k < columns.size(); ++k) channel[k] = csv.number(columns[k]);
        each(csv.number(0), decouple(*decoupler, channel));
    }
}

TEST(Shipped, SkinIsTheFitOfSessionOne) {
    const Calibration shipped = loaded("skin_eflesh.toml");
    const Calibration fitted =
        fit(read_labelled(kRoot + "/tests/data/eflesh/normal_labelled.csv", {.sessions = {"1"}, .channels = {}}),
            {.model = "generic", .method = "", .serial = "", .date = ""})
            .calibration;
    ASSERT_EQ(shipped.channels, fitted.channels);
    for (std::size_t k = 0; k < fitted.channels.size(); ++k) {
        EXPECT_NEAR(shipped.matrix[0][k], fitted.matrix[0][k], 1e-12);  // N per uT; condition 708 times rounding
        EXPECT_NEAR(shipped.zero[k], fitted.zero[k], 1e-9);             // uT
    }
    EXPECT_NEAR(shipped.sd[0], fitted.sd[0], 1e-9);
    EXPECT_EQ(shipped.channel_unit, "uT");
}

TEST(Shipped, TheCalibrationFileLosesNoBit) {
    const FitReport report =
        fit(read_labelled(kRoot + "/tests/data/eflesh/normal_labelled.csv", {.sessions = {"2"}, .channels = {}}),
            {.model = "generic", .method = "", .serial = "", .channel_unit = "uT", .date = "2026-03-01"});
    const ScratchFile file("");
    save_calibration(report.calibration, file.path());
    Problems problems;
    const Calibration back = load_calibration(file.path(), problems);
    EXPECT_TRUE(problems.empty());
    EXPECT_EQ(back.matrix, report.calibration.matrix);
    EXPECT_EQ(back.zero, report.calibration.zero);
    EXPECT_EQ(back.sd, report.calibration.sd);
}

TEST(Shipped, SkinDemoIsPressedTwice) {
    double min = 0;
    int rows = 0, flagged = 0, presses = 0;
    bool pressed = false;
    decouple_file(loaded("skin_eflesh.toml"), kRoot + "/config/demo/skin_session2.csv",
                  [&](double, const Estimate& estimate) {
                      const double fz = estimate.wrench_S[2];
                      min = std::min(min, fz);
                      ++rows;
                      flagged += estimate.quality() == TACTILED_GOOD ? 0 : 1;
                      if (!pressed && fz < -20) ++presses;
                      pressed = pressed ? fz < -5 : fz < -20;
                  });
    EXPECT_EQ(rows, 720);
    EXPECT_EQ(presses, 2);
    EXPECT_NEAR(min, -33, 1.5);  // N
    EXPECT_LT(flagged, 10);
}

TEST(Shipped, TableDemoRestsPressesAndCircles) {
    const Calibration calibration = loaded("table_documents.toml");
    EXPECT_TRUE(calibration.sd.empty());  // it was not measured
    decouple_file(calibration, kRoot + "/config/demo/table_demo.csv", [&](double t_s, const Estimate& estimate) {
        const auto& f = estimate.wrench_S;
        ASSERT_EQ(estimate.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY}) << t_s;
        const double noise_N = 0.01;  // 20 ppm is 1 mN for a tangential force; 6 sigma
        if (t_s < 2 || t_s > 18) {
            ASSERT_NEAR(std::hypot(f[0], f[1], f[2]), 0, noise_N) << t_s;
        } else if (t_s > 6.5 && t_s < 14) {
            const double angle = 2 * 3.14159265358979 * (t_s - 6.5) / 3.75;
            ASSERT_NEAR(f[0], 0.3 * std::cos(angle), noise_N) << t_s;
            ASSERT_NEAR(f[1], 0.3 * std::sin(angle), noise_N) << t_s;
            ASSERT_NEAR(f[2], -1, noise_N) << t_s;
        }
    });
}

// The paper's figures of the pairs: 7.1e-4 /kPa of SUM and 1.5e-3 /kPa of DIFF, printed to two digits.
TEST(Shipped, HairDocumentsHaveThePapersSensitivities) {
    const Calibration calibration = loaded("hair_documents.toml");
    EXPECT_TRUE(calibration.sd.empty());  // it was not measured under combined load
    const auto decoupler = make_decoupler(calibration);
    const double area_m2 = 2.827e-5;
    const auto expect = [&](const std::vector<double>& hairs, double fx_Pa, double fy_Pa, double fz_Pa, double within_Pa) {
        const Estimate estimate = decouple(*decoupler, hairs);
        EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY});
        EXPECT_NEAR(estimate.wrench_S[0] / area_m2, fx_Pa, within_Pa);
        EXPECT_NEAR(estimate.wrench_S[1] / area_m2, fy_Pa, within_Pa);
        EXPECT_NEAR(estimate.wrench_S[2] / area_m2, fz_Pa, within_Pa);
    };
    expect({0, 0, 0, 0}, 0, 0, 0, 1e-9);
    expect({3.55e-4, 3.55e-4, 3.55e-4, 3.55e-4}, 0, 0, -1000, 60);  // 6 %: the mean of hairs that differ
    expect({-7.5e-4, 0, 7.5e-4, 0}, 1000, 0, 0, 60);
    // 1.5 kPa of press, 0.8 kPa of shear at 150 degrees, by eq. 14
    const double sigma = 3.74e-7 * 1500, tau = 7.91e-7 * 800, c = std::cos(2.6179938779915), s = std::sin(2.6179938779915);
    expect({sigma - tau * c, sigma - tau * s, sigma + tau * c, sigma + tau * s}, 800 * c, 800 * s, -1500, 1e-6);
}

TEST(Shipped, CapacitiveDocumentsHaveTheThesisCurves) {
    const Calibration calibration = loaded("capacitive_documents.toml");
    EXPECT_TRUE(calibration.sd.empty());  // it was not measured under combined load
    const auto decoupler = make_decoupler(calibration);
    const auto side = [](double F) { return 0.0071 * F * F + 0.038 * F + 1.2285; };  // eq. XXXIV
    for (const double N : {0.0, 0.4, 5.0, 10.0})
        for (const double fx : {-1.2, 0.0, 0.3})
            for (const double fy : {-0.7, 0.0, 1.2}) {
                const double Cn = 0.0008 * N * N + 0.0405 * N + 1.3039;  // eq. XXXIII
                const Estimate estimate = decouple(*decoupler, {side(fx), side(-fx), side(fy), side(-fy), Cn});
                EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY});
                EXPECT_NEAR(estimate.wrench_S[0], fx, 1e-9);
                EXPECT_NEAR(estimate.wrench_S[1], fy, 1e-9);
                EXPECT_NEAR(estimate.wrench_S[2], -N, 1e-9);
            }
    // At the curve's end the error is within the header's statement: its mean slopes.
    EXPECT_NEAR(decouple(*decoupler, {1.2285, 1.2285, 1.2285, 1.2285, 1.3039 + 0.485}).wrench_S[2], -10, 1e-9);
}

TEST(Shipped, EachComponentFollowsTheLoadByItsOwnChannels) {
    const auto pad = make_decoupler(loaded("capacitive_documents.toml"));  // C1 C2 C3 C4 Cn
    EXPECT_EQ(pad->timed_by(0), 0b10011u);
    EXPECT_EQ(pad->timed_by(1), 0b11100u);
    EXPECT_EQ(pad->timed_by(2), 0b10000u);
    const Wrench delay_s = delay_of_components_s(*pad, std::vector<double>{0.45, 0.35, 0.25, 0.15, 0.05});
    EXPECT_DOUBLE_EQ(delay_s[0], 0.25);
    EXPECT_DOUBLE_EQ(delay_s[2], 0.05);
    EXPECT_EQ(make_decoupler(loaded("piezo_documents.toml"))->timed_by(2), 0b01u);  // Vp Cn: the film
    EXPECT_EQ(make_decoupler(loaded("skin_eflesh.toml"))->timed_by(2), 0x7FFFu);
}

// The thesis' square wave of 1.66 Hz to 10 N: Cn holds it, Vp shows only its edges, and both together the force at
// once.
TEST(Shipped, PiezoDocumentsHaveTheThesisCurves) {
    const Calibration calibration = loaded("piezo_documents.toml");
    EXPECT_TRUE(calibration.sd.empty());
    const auto decoupler = make_decoupler(calibration);
    double V = 0, drive = 0, sum = 0, held = 1.3039, worst = 0, min_V = 1;
    for (int i = 0; i < 10000; ++i) {  // 1 kHz
        const double N = i < 1000 || std::fmod(i * 1.66e-3, 1.0) < 0.5 ? 0 : 10;
        const double q = 0.0092 * N * N + 0.2917 * N;                           // eq. XXXV
        V = V * std::exp(-1e-3 / 0.1) + (q - drive) * std::exp(-0.5e-3 / 0.1);  // between two frames
        if (q < drive) min_V = std::min(min_V, std::abs(V + drive));            // rest of the previous edge
        drive = q;
        sum += 0.0008 * N * N + 0.0405 * N;
        if (i % 100 == 99) {
            held = 1.3039 + sum / 100;
            sum = 0;
        }
        const std::vector<double> channel{V + 0.0768, held};
        const Estimate estimate = decoupler->decouple({.channel = channel, .t_ns = std::uint64_t(1e9 + i * 1e6)});
        ASSERT_NE(estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);
        if (i >= 1000) worst = std::max(worst, std::abs(estimate.wrench_S[2] + N));
    }
    EXPECT_LT(worst, 0.2);   // N: 2 % of 10 N
    EXPECT_LT(min_V, 0.25);  // V, of 3.8: Vp returns to 0 in half a period, as the thesis draws it
}

}  // namespace
}  // namespace tactiled
