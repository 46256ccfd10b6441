// The table of what each protocol says of a value.
#include "node/bridges/edge.hpp"

#include <cmath>

#include "node/ctl/verb.hpp"
#include "tests/unit/shm/segment_fixture.hpp"

namespace tactiled::bridges {
namespace {

constexpr std::uint32_t kQualities[] = {TACTILED_NO_VALUE, TACTILED_GOOD, TACTILED_UNCERTAIN, TACTILED_BAD, 4, ~0u};

TEST(Edge, GoodAloneIsHealthyInEachProtocol) {
    for (const std::uint32_t quality : kQualities) {
        const bool good = quality == TACTILED_GOOD;
        EXPECT_EQ(is_healthy(quality), good) << quality;
        EXPECT_EQ(diagnostic_level(quality, 0) == 0, good) << quality;
        EXPECT_EQ(rdt_status(quality, 0) == 0, good) << quality;
        EXPECT_EQ(edge_of(quality).word == std::string("good"), good) << quality;
    }
}

TEST(Edge, WordsAreThoseOfTheCommands) {
    for (const std::uint32_t quality : {TACTILED_NO_VALUE, TACTILED_GOOD, TACTILED_UNCERTAIN, TACTILED_BAD})
        EXPECT_EQ(edge_of(quality).word, ctl::quality_text(quality, 0));
}

TEST(Edge, EachReasonHasTheFieldsOfItsVerdict) {
    for (std::size_t bit = 0; bit < ctl::kReasonWords.size(); ++bit) {
        const std::uint32_t reason = 1u << bit, quality = tactiled_verdict(reason, 1);
        const std::uint32_t status = rdt_status(quality, reason);
        EXPECT_EQ(status == 0, quality == TACTILED_GOOD) << ctl::kReasonWords[bit];
        EXPECT_EQ(status >> 31, quality == TACTILED_GOOD ? 0u : 1u) << ctl::kReasonWords[bit];
        EXPECT_EQ((status & 0x7FFFFFFF) == 0, quality == TACTILED_GOOD) << "no bit of its own: " << ctl::kReasonWords[bit];
        EXPECT_EQ(diagnostic_level(quality, reason) == 3, (reason & TACTILED_REASONS_OF_OLD) != 0) << ctl::kReasonWords[bit];
    }
    EXPECT_EQ(rdt_status(TACTILED_UNCERTAIN, TACTILED_SATURATED), 0x80020000u);
    EXPECT_EQ(rdt_status(TACTILED_UNCERTAIN, TACTILED_UNPROVED_AGE | TACTILED_TARING), 0x88000000u);
    EXPECT_EQ(rdt_status(TACTILED_UNCERTAIN, 1u << 31), 0x80000000u);  // a reason that this version does not know
}

TEST(Edge, AGraspIsAsGoodAsItsSensors) {
    tactiled_grasp grasp{};
    grasp.state = TACTILED_GRIP_HOLDING;
    grasp.weight_state = TACTILED_WEIGHT_STABLE;
    EXPECT_EQ(grasp_quality(grasp, TACTILED_GOOD), unsigned(TACTILED_GOOD));
    EXPECT_EQ(weight_quality(grasp, TACTILED_GOOD), unsigned(TACTILED_GOOD));
    EXPECT_EQ(weight_quality(grasp, TACTILED_UNCERTAIN), unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(grasp_quality(grasp, TACTILED_BAD), unsigned(TACTILED_UNCERTAIN));
    grasp.weight_state = TACTILED_WEIGHT_ESTIMATING;
    EXPECT_EQ(weight_quality(grasp, TACTILED_GOOD), unsigned(TACTILED_UNCERTAIN));
    grasp.weight_state = TACTILED_WEIGHT_OVERLOAD;
    EXPECT_EQ(weight_quality(grasp, TACTILED_GOOD), unsigned(TACTILED_BAD));
    tactiled_forget_grasp(&grasp);
    EXPECT_EQ(grasp_quality(grasp, TACTILED_GOOD), unsigned(TACTILED_BAD));
    EXPECT_EQ(weight_quality(grasp, TACTILED_GOOD), unsigned(TACTILED_BAD));
}

TEST(Edge, NoValueIsAsBadAsABadOne) {
    std::array<tactiled_sample, 2> samples{};
    samples[0].quality = TACTILED_GOOD;
    EXPECT_EQ(worst_quality(samples), unsigned(TACTILED_BAD));
    EXPECT_EQ(worst_quality(std::span(samples).first(1)), unsigned(TACTILED_GOOD));
    EXPECT_EQ(worst_quality(std::span(samples).first(0)), unsigned(TACTILED_BAD));
}

using EdgeTest = SegmentTest;

TEST_F(EdgeTest, AValueIsValidUntilAReaderCallsItBad) {
    SegmentPlan quick = plan();
    quick.watchdog_ms = 50;
    SegmentWriter writer(quick);
    writer.set_state(TACTILED_RUNNING);
    beat(writer, 0);
    writer.publish(0, sample(0));
    std::string why;
    const Segment segment = Segment::try_open(name_, why);
    ASSERT_TRUE(segment.is_open()) << why;
    tactiled_sample s;
    tactiled_node node;
    ASSERT_TRUE(segment.latest(0, s));
    ASSERT_TRUE(segment.latest_node(node));
    EXPECT_EQ(worst_quality(segment), unsigned(TACTILED_GOOD));
    const std::uint64_t until_ns = valid_until_ns(segment, 0, s);
    EXPECT_EQ(until_ns,
              std::min(s.t_ns + segment.c()->stale_ms[0] * std::uint64_t(1'000'000), s.t_published_ns + 50'000'000));
    tactiled_sample later;
    segment.latest(0, later, until_ns + 1);
    EXPECT_EQ(later.quality, unsigned(TACTILED_BAD));
    tactiled_node of_later;
    segment.latest_node(of_later, valid_until_ns(segment, node) + 1);
    EXPECT_EQ(of_later.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));
}

}  // namespace
}  // namespace tactiled::bridges
