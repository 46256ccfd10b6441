// The drift of a zero that a recording shows, and the scatter of the zeros of its sessions.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

// 600 random presses within half an hour for each session, each on two channels with a noise of 0.1 % of full scale, of a
// sensor whose zero drifts by `drift` of full scale in an hour and differs by `scatter` between the sessions.
Labelled drifting(unsigned seed, double drift, std::size_t sessions, double scatter = 0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Labelled labelled;
    labelled.name = "drifting.csv";
    labelled.channels = {"A", "B"};
    for (std::size_t session = 0; session < sessions; ++session) {
        labelled.sessions.push_back(std::to_string(session));
        const double zero = scatter * normal(random);
        for (int i = 0; i < 600; ++i) {
            const double t_s = 3.0 * i, fx = i % 4 == 0 ? 0 : 10 * uniform(random),
                         fz = i % 4 == 0 ? 0 : 10 * uniform(random);
            const double moved = 10 * (zero + drift * t_s / 3600);
            labelled.rows.push_back({.line = std::int64_t(labelled.rows.size()) + 2,
                                     .channel = {fx + moved + 0.01 * normal(random), fz + 0.01 * normal(random)},
                                     .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN},
                                     .session = session,
                                     .t_ns = 1 + std::uint64_t(t_s * 1e9)});
        }
    }
    return labelled;
}

TEST(ZeroAge, IsTheDriftOfTheRecording) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const FitReport report = fit(drifting(seed, 0.1, 2), by("matrix"));
        ASSERT_EQ(report.calibration.zero_rate_per_h.size(), 2u) << seed;
        EXPECT_NEAR(report.calibration.zero_rate_per_h[0], 1, 0.1) << "N per hour";
        EXPECT_EQ(report.calibration.zero_rate_per_h[1], report.calibration.held_out_rms[1]) << "fz does not drift";
        EXPECT_TRUE(warns(report, "the zero drifted in an hour (zero_rate_per_h): fx by"));
    }
}

TEST(ZeroAge, IsSeenBesideAPauseOfTheRecording) {
    Labelled labelled = drifting(1, 0.1, 1);
    std::erase_if(labelled.rows,
                  [](const LabelledRow& row) { return row.t_ns > 700'000'000'000 && row.t_ns < 1'000'000'000'000; });
    const FitReport report = fit(labelled, by("matrix"));
    ASSERT_EQ(report.calibration.zero_rate_per_h.size(), 2u);
    EXPECT_NEAR(report.calibration.zero_rate_per_h[0], 1, 0.15) << "N per hour";
}

TEST(ZeroAge, OfARecordingWithoutDriftIsNotStated) {
    for (unsigned seed = 1; seed <= 20; ++seed)
        EXPECT_TRUE(fit(drifting(seed, 0, 2), by("matrix")).calibration.zero_rate_per_h.empty()) << seed;
}

// A new sensor rests, and its first load leaves 0.3 % of full scale in a channel. It rests again in the second half only.
TEST(ZeroAge, TheMemoryOfTheFirstLoadIsNoDrift) {
    Labelled labelled = drifting(1, 0, 1);
    for (LabelledRow& row : labelled.rows)
        if (row.t_ns < 100'000'000'000)
            row.channel[0] -= row.wrench_S[0], row.channel[1] -= row.wrench_S[2], row.wrench_S[0] = row.wrench_S[2] = 0;
        else
            row.channel[0] += 0.03;
    std::erase_if(labelled.rows, [](const LabelledRow& row) {
        return row.wrench_S[0] == 0 && row.t_ns > 100'000'000'000 && row.t_ns < 900'000'000'000;
    });
    EXPECT_TRUE(fit(labelled, by("matrix")).calibration.zero_rate_per_h.empty());
}

TEST(ZeroAge, TheScatterOfTheSessionsNeedsFiveOfThem) {
    EXPECT_TRUE(fit(drifting(1, 0, 4, 0.05), by("matrix")).calibration.zero_shift.empty());
    double mean = 0;
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Calibration calibration = fit(drifting(seed, 0, 8, 0.05), by("matrix")).calibration;
        ASSERT_EQ(calibration.zero_shift.size(), 2u);
        mean += calibration.zero_shift[0] / 5;
        EXPECT_LT(calibration.zero_shift[1], 0.02);
    }
    EXPECT_NEAR(mean, 0.5, 0.15) << "5 % of 10 N";
}

}  // namespace
}  // namespace tactiled
