// Hysteresis in the stated standard deviation: found from loading against unloading, with the peak since the last rest.
#include "decoupling/unloading.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

// Two channels under a press and a shear. After a peak the sensor keeps a memory: a part `memory` of peak - press is left in
// both channels, with a sign that changes from recording to recording, so that no fit can take it out.
class Remembering {
public:
    explicit Remembering(double memory) : memory_(memory) {}

    LabelledRow row(double fx, double press, std::uint64_t t_ns) {
        if (press == 0) peak_ = 0, sign_ = normal_(random_);
        peak_ = std::max(peak_, press);
        const double left = memory_ * sign_ * (peak_ - press);
        return {.line = ++line_,
                .channel = {fx + left + 0.003 * normal_(random_), press + left + 0.003 * normal_(random_)},
                .wrench_S = {fx, kNaN, -press, kNaN, kNaN, kNaN},
                .session = 0,
                .t_ns = t_ns};
    }
    // Courses of a press to a random peak and back, each after a rest of one second.
    Labelled recording(int courses) {
        Labelled labelled{.name = "made", .channels = {"a", "b"}, .sessions = {"one"}, .rows = {}};
        std::uniform_real_distribution<double> uniform(-1, 1);
        for (int course = 0; course < courses; ++course) {
            const double peak = course % 5 == 0 ? 10 : 5 + 5 * std::abs(uniform(random_));
            for (int i = 0; i < 3; ++i) labelled.rows.push_back(row(0, 0, t_ns_ += 500 * kMs));
            for (int i = 1; i < 16; ++i)
                labelled.rows.push_back(row(5 * uniform(random_), peak * std::min(i, 16 - i) / 8, t_ns_ += 500 * kMs));
        }
        return labelled;
    }

private:
    double memory_;
    double peak_ = 0, sign_ = 1;
    std::mt19937 random_{7};
    std::normal_distribution<double> normal_;
    std::int64_t line_ = 1;
    std::uint64_t t_ns_ = 0;
};

Calibration fitted(Remembering& sensor) {
    return fit(sensor.recording(60), {.model = "generic", .method = "matrix", .serial = "", .date = ""}).calibration;
}

TEST(Unloading, IsFoundWhereTheSensorReadsLoadsOtherwiseOnTheWayBack) {
    Remembering sensor(0.05);
    const Calibration calibration = fitted(sensor);
    ASSERT_EQ(calibration.sd_unloading.size(), 2u);
    EXPECT_GT(calibration.sd_unloading[1], 3 * calibration.sd[1]);
}

TEST(Unloading, IsNotStatedForASensorWithoutMemory) {
    Remembering sensor(0);
    EXPECT_TRUE(fitted(sensor).sd_unloading.empty());
}

TEST(Unloading, MakesTheStandardDeviationTrueOnBothWays) {
    Remembering sensor(0.05);
    const auto decoupler = make_decoupler(fitted(sensor));
    const Labelled unseen = sensor.recording(60);
    std::size_t up = 0, up_within = 0, down = 0, down_within = 0, beyond = 0;
    double up_sd = 0, down_sd = 0, press = 0;
    for (const LabelledRow& row : unseen.rows) {
        const Estimate e = decoupler->decouple({.channel = row.channel, .t_ns = row.t_ns});
        const double error = std::abs(e.wrench_S[2] - row.wrench_S[2]), now = -row.wrench_S[2];
        beyond += error > 5 * e.sd[2];
        if (now > press)
            ++up, up_within += error <= e.sd[2], up_sd += e.sd[2];
        else if (now < press && now > 0)
            ++down, down_within += error <= e.sd[2], down_sd += e.sd[2];
        press = now;
    }
    EXPECT_GT(double(up_within) / double(up), 0.6);
    EXPECT_GT(double(down_within) / double(down), 0.6);
    EXPECT_LT(beyond, unseen.rows.size() / 200);
    EXPECT_GT(down_sd / double(down), 2 * up_sd / double(up));
}

TEST(Unloading, ThePeakCountsUntilTheLoadHasRestedForHalfASecond) {
    LoadPeak peak = LoadPeak::rested();
    EXPECT_EQ(peak.next(0.4, 0), 0);
    EXPECT_EQ(peak.next(0.8, 10 * kMs), 0);
    EXPECT_DOUBLE_EQ(peak.next(0.3, 20 * kMs), 0.5);
    EXPECT_DOUBLE_EQ(peak.next(0.01, 30 * kMs), 0.79);
    EXPECT_DOUBLE_EQ(peak.next(0.01, 529 * kMs), 0.79);
    EXPECT_EQ(peak.next(0.01, 530 * kMs), 0);
    EXPECT_EQ(peak.next(0.3, 540 * kMs), 0);
}

TEST(Unloading, APastThatIsNotKnownIsAFullLoad) {
    LoadPeak peak = LoadPeak::rested();
    EXPECT_EQ(peak.next(0.3, 0), 0);
    peak.forget();
    EXPECT_DOUBLE_EQ(peak.next(0.3, kMs), 0.7);
    EXPECT_DOUBLE_EQ(peak.next(kNaN, 2 * kMs), 1);
}

TEST(Unloading, ComesBackFromAFileToTheLastBit) {
    Remembering sensor(0.05);
    Calibration calibration = fitted(sensor);
    calibration.path = "c.toml";
    Problems problems;
    EXPECT_EQ(parse_calibration(calibration_text(calibration), "c.toml", problems).sd_unloading, calibration.sd_unloading);
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
}

TEST(Unloading, ATareIsWhereRestAndLoadBegin) {
    Remembering sensor(0.05);
    const Calibration calibration = fitted(sensor);
    // A tool of 5 % of full scale hangs on the sensor.
    const double hanging = -0.05 * calibration.full_scale[1];
    const auto at_rest = [&](const Wrench& zero_S) {
        const auto decoupler = make_decoupler(calibration);
        Estimate e;
        const double channel[] = {0, -hanging};
        for (std::uint64_t t_ns = 0; t_ns <= 1000 * kMs; t_ns += 100 * kMs)
            e = decoupler->decouple({.channel = channel, .t_ns = t_ns, .zero_S = zero_S});
        return e.sd[2];
    };
    EXPECT_GT(at_rest({}), 0.9 * calibration.sd_unloading[1]) << "never a rest: the past is unknown";
    EXPECT_LT(at_rest({0, 0, hanging}), 0.5 * calibration.sd_unloading[1]);
}

}  // namespace
}  // namespace tactiled
