// Corrections of the matrix (methods quadratic, rbf) where the channels repeat each other or there is nothing to correct.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

// Slow ramps of three loads. With six straight channels most products of channels are noise.
Labelled ramps(unsigned seed, std::size_t channels, double bend) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    Labelled labelled;
    labelled.name = "ramps.csv";
    labelled.sessions = {"a", "b"};
    double gain[6][3], curve[6][3];
    for (std::size_t k = 0; k < channels; ++k) {
        labelled.channels.push_back("c" + std::to_string(k));
        for (int c = 0; c < 3; ++c)
            gain[k][c] = (int(k) % 3 == c ? 1 : 0.3) * (1 + 0.3 * normal(random)), curve[k][c] = bend * normal(random);
    }
    for (int i = 0; i < 530; ++i) {
        double load[3];
        for (int c = 0; c < 3; ++c) {
            const double phase = i * (0.013 + 0.0047 * c) + c;
            load[c] = 4 * std::abs(phase - std::floor(phase + 0.5)) - 1;
        }
        LabelledRow row{.line = i + 2, .channel = {}, .wrench_S = kUnseen, .session = i < 265 ? 0u : 1u};
        for (std::size_t k = 0; k < channels; ++k) {
            double reading = 2e-4 * normal(random);
            for (int c = 0; c < 3; ++c) reading += gain[k][c] * load[c] + curve[k][c] * load[c] * load[c];
            row.channel.push_back(reading);
        }
        for (std::size_t c = 0; c < 3; ++c) row.wrench_S[c] = load[c];
        labelled.rows.push_back(row);
    }
    return labelled;
}

TEST(Corrections, OfAStraightSensorAreNoWorseThanTheMatrix) {
    std::size_t kept = 0;
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Labelled labelled = ramps(seed, 6, 0);
        const double matrix = percent_of_full_scale(fit(labelled, by("matrix")));
        const FitReport quadratic = fit(labelled, by("quadratic")), rbf = fit(labelled, by("rbf"));
        EXPECT_LT(percent_of_full_scale(quadratic), 1.1 * matrix) << seed;
        EXPECT_LT(percent_of_full_scale(rbf), 1.1 * matrix) << seed;
        EXPECT_TRUE(warns(quadratic, "method quadratic keeps method matrix for")) << seed;
        kept += warns(rbf, "method rbf keeps method matrix for") ? 1 : 0;
    }
    EXPECT_GE(kept, 3u);
}

// Eight channels of three loads, nearly straight. Five combinations of the channels show the temperature alone, which is
// another one in each session.
Labelled strain_gauges(unsigned seed, std::size_t sessions) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Labelled labelled;
    labelled.name = "gauges.csv";
    double gain[8][3], curve[8][3], per_K[8];
    for (int k = 0; k < 8; ++k) {
        labelled.channels.push_back("g" + std::to_string(k));
        for (int c = 0; c < 3; ++c) gain[k][c] = 0.3 * normal(random), curve[k][c] = 6e-4 * normal(random);
        per_K[k] = 3e-4 * normal(random);
    }
    for (std::size_t session = 0; session < sessions; ++session) {
        labelled.sessions.push_back(std::to_string(session));
        const double start_K = 2 * normal(random);
        for (int i = 0; i < 400; ++i) {
            double load[3];
            for (double& part : load) part = i % 10 == 0 ? 0 : uniform(random);
            LabelledRow row{
                .line = std::int64_t(labelled.rows.size()) + 2, .channel = {}, .wrench_S = kUnseen, .session = session};
            for (int k = 0; k < 8; ++k) {
                double reading = (start_K + 2 * std::sin(0.01 * i)) * per_K[k] + 7e-5 * normal(random);
                for (int c = 0; c < 3; ++c) reading += gain[k][c] * load[c] + curve[k][c] * load[c] * load[c];
                row.channel.push_back(reading);
            }
            for (std::size_t c = 0; c < 3; ++c) row.wrench_S[c] = 50 * (load[c] + 5e-4 * normal(random));
            labelled.rows.push_back(row);
        }
    }
    return labelled;
}

TEST(Corrections, OfChannelsThatNearlyRepeatEachOtherAreNoWorseThanTheMatrixInAnySession) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
        const Labelled labelled = strain_gauges(seed, 2 + seed % 2);
        const FitReport matrix = fit(labelled, by("matrix"));
        for (const char* method : {"quadratic", "rbf"}) {
            const FitReport report = fit(labelled, by(method));
            for (std::size_t c = 0; c < 3; ++c) {
                EXPECT_LE(report.components[c].held_out_rms, 1.000001 * matrix.components[c].held_out_rms) << method << seed;
                EXPECT_LE(report.calibration.sd[c], 1.2 * matrix.calibration.sd[c]) << method << seed;
            }
        }
    }
}

TEST(Corrections, OfABentSensorLowerTheError) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Labelled labelled = ramps(seed, 3, 0.05);
        const double matrix = percent_of_full_scale(fit(labelled, by("matrix")));
        EXPECT_LT(percent_of_full_scale(fit(labelled, by("quadratic"))), 0.5 * matrix) << seed;
    }
}

TEST(Corrections, OfOneComponentLeaveTheOthersAlone) {
    Labelled labelled = ramps(1, 3, 0);
    for (auto& row : labelled.rows) {
        const double noise = row.channel[0], fx = row.wrench_S[0], fz = row.wrench_S[2];
        const double bent = fz + 0.05 * fz * fz;
        row.channel = {fx, bent, 0.5 * (fx + bent)};
        for (int k = 0; k < 3; ++k) row.channel[std::size_t(k)] += 1e-3 * std::sin(1e5 * noise + k);
        row.wrench_S[1] = kNaN;
    }
    const FitReport matrix = fit(labelled, by("matrix")), quadratic = fit(labelled, by("quadratic"));
    EXPECT_TRUE(warns(quadratic, "method quadratic keeps method matrix for fx:"));
    EXPECT_LT(quadratic.components[1].held_out_rms, 0.4 * matrix.components[1].held_out_rms);
}

// A component with few labels is fitted to the rows that have it.
TEST(Corrections, UseTheRowsOfEachComponent) {
    for (const int every : {20, 2}) {  // one of 20 rows lacks it, or half of them
        Labelled some = waves(2400, 3e-3, 1, true);
        for (std::size_t i = 0; i < some.rows.size(); ++i)
            if (int(i) % every == 0) some.rows[i].wrench_S[2] = kNaN;
        const double before = fit(some, by("matrix")).components[1].held_out_rms;
        for (const char* method : {"quadratic", "rbf"})
            EXPECT_LT(fit(some, by(method)).components[1].held_out_rms, 0.3 * before) << method << every;
    }
}

}  // namespace
}  // namespace tactiled
