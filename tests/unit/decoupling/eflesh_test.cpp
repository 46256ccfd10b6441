// A real skin: calibrated on one session, tested on another.
#include <gtest/gtest.h>

#include <cmath>

#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

const std::string kFile = TACTILED_SOURCE_DIR "/tests/data/eflesh/normal_labelled.csv";

Labelled session(const std::string& name) { return read_labelled(kFile, {.sessions = {name}, .channels = {}}); }

FitReport fitted_on_session_1() {
    return fit(session("1"), {.model = "generic", .method = "", .serial = "", .channel_unit = "uT", .date = ""});
}

// Full scale is the calibration's: the largest load of session 1, 34.154 N (session 2 goes to 32.339 N).
TEST(Eflesh, AnUnseenSessionIsWithin23PerMilleOfFullScale) {
    const FitReport report = fitted_on_session_1();
    const double full_scale_N = report.calibration.full_scale[0];
    EXPECT_NEAR(full_scale_N, 34.154, 0.001);
    const auto decoupler = make_decoupler(report.calibration);
    double squares = 0;
    int labelled = 0, good = 0, flagged = 0;
    for (const auto& row : session("2").rows) {
        const Estimate estimate = decouple(*decoupler, row.channel);
        ++(estimate.quality() == TACTILED_GOOD ? good : flagged);
        if (std::isnan(row.wrench_S[2])) continue;
        squares += std::pow(estimate.wrench_S[2] - row.wrench_S[2], 2);
        ++labelled;
    }
    const double rms_N = std::sqrt(squares / labelled);
    RecordProperty("rms_N", std::to_string(rms_N));
    EXPECT_EQ(labelled, 1860);
    EXPECT_LE(rms_N, 0.023 * full_scale_N);
    // The same skin in the same range: nearly all of it is in the domain.
    EXPECT_EQ(good + flagged, 3600);
    EXPECT_LT(flagged, 36);
}

// At least 68 % of the errors on held-out rows are within the standard deviation that is published with them, and
// none beyond five times that, also for another session.
TEST(Eflesh, TheClaimedStandardDeviationHoldsForTwoThirdsOfTheErrors) {
    const FitReport report = fitted_on_session_1();
    const Calibration& c = report.calibration;
    ASSERT_EQ(c.sd.size(), 1u);
    int held_out = 0, unseen = 0, labelled = 0;
    for (const auto& [row, estimated] : report.held_out)
        held_out += std::abs(estimated[2] - row->wrench_S[2]) <= std::hypot(c.sd[0], c.sd_slope[0] * estimated[2]) ? 1 : 0;
    EXPECT_GT(held_out / double(report.held_out.size()), 0.67);
    const auto decoupler = make_decoupler(c);
    for (const auto& row : session("2").rows) {
        if (std::isnan(row.wrench_S[2])) continue;
        const Estimate estimate = decouple(*decoupler, row.channel);
        unseen += std::abs(estimate.wrench_S[2] - row.wrench_S[2]) <= estimate.sd[2] ? 1 : 0;
        EXPECT_LT(std::abs(estimate.wrench_S[2] - row.wrench_S[2]), 5 * estimate.sd[2]);
        ++labelled;
    }
    RecordProperty("unseen_within_one_sd_percent", std::to_string(100.0 * unseen / labelled));
    EXPECT_GT(unseen / double(labelled), 0.60);
}

}  // namespace
}  // namespace tactiled
