// The bridges' reader of all sensors, and their common parts.
#include "node/bridges/follower.hpp"

#include "node/bridges/bridge.hpp"
#include "tests/unit/shm/segment_fixture.hpp"

namespace tactiled::bridges {
namespace {

class FollowerTest : public SegmentTest {
protected:
    static std::vector<std::uint64_t> taken(Follower& follower, std::uint32_t sensor, std::uint32_t quality) {
        std::vector<std::uint64_t> numbers;
        for (tactiled_sample s; follower.next(sensor, s);) {
            if (s.quality == quality) numbers.push_back(s.sequence);
        }
        return numbers;
    }
};

TEST_F(FollowerTest, GivesEachSampleOfEachSensorOnce) {
    SegmentWriter writer(plan(2));
    writer.set_state(TACTILED_RUNNING);
    for (std::uint64_t n = 0; n < 3; ++n) writer.publish(0, sample(n));
    writer.publish(1, sample(0));
    beat(writer, 0);
    Follower follower(name_);
    follower.look();
    ASSERT_TRUE(follower.is_alive()) << follower.why();
    EXPECT_EQ(follower.n_sensors(), 2u);
    EXPECT_EQ(taken(follower, 0, TACTILED_GOOD), std::vector<std::uint64_t>{2});  // begins with the newest
    writer.publish(0, sample(3));
    writer.publish(0, sample(4));
    writer.publish(1, sample(1));
    follower.look();
    EXPECT_EQ(taken(follower, 0, TACTILED_GOOD), (std::vector<std::uint64_t>{3, 4}));
    EXPECT_EQ(taken(follower, 1, TACTILED_GOOD), (std::vector<std::uint64_t>{0, 1}));
    tactiled_sample s;
    EXPECT_FALSE(follower.next(0, s));
    EXPECT_FALSE(follower.next(2, s));
    EXPECT_EQ(follower.missed(), 0u);
}

TEST_F(FollowerTest, CountsWhatWasOverwritten) {
    const auto writer = alive();
    writer->publish(0, sample(0));
    Follower follower(name_);
    follower.look();
    EXPECT_EQ(taken(follower, 0, TACTILED_GOOD).size(), 1u);
    for (std::uint64_t n = 1; n <= 200; ++n) writer->publish(0, sample(n));
    beat(*writer, 1);
    follower.look();
    const auto numbers = taken(follower, 0, TACTILED_GOOD);
    EXPECT_EQ(numbers.back(), 200u);
    EXPECT_EQ(numbers.size() + follower.missed(), 200u);
    EXPECT_GT(follower.missed(), 100u);
}

TEST_F(FollowerTest, ADeadDaemonGivesOneBadSampleAndThenItsSuccessorsFirst) {
    SegmentPlan quick = plan();
    quick.watchdog_ms = 50;
    auto writer = std::make_unique<SegmentWriter>(quick);
    writer->set_state(TACTILED_RUNNING);
    writer->publish(0, sample(0));
    beat(*writer, 0);
    Follower follower(name_);
    follower.look();
    EXPECT_EQ(taken(follower, 0, TACTILED_GOOD).size(), 1u);
    const std::uint64_t structure = follower.structure();
    ::usleep(80'000);
    follower.look();
    EXPECT_FALSE(follower.is_alive());
    EXPECT_NE(follower.why(), "");
    tactiled_sample s;
    ASSERT_TRUE(follower.next(0, s));
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    EXPECT_TRUE(std::isnan(s.force_S_N[2]));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    EXPECT_FALSE(follower.next(0, s));
    writer.reset();
    SegmentWriter successor(plan());
    successor.set_state(TACTILED_RUNNING);
    ::usleep(110'000);  // it looks for a successor each 100 ms
    successor.publish(0, sample(0));
    successor.publish(0, sample(1));
    beat(successor, 0);
    follower.look();
    ASSERT_TRUE(follower.is_alive()) << follower.why();
    EXPECT_NE(follower.structure(), structure);
    EXPECT_EQ(taken(follower, 0, TACTILED_GOOD), (std::vector<std::uint64_t>{0, 1}));
}

TEST_F(FollowerTest, ASampleOfADeadDaemonIsNeverGood) {
    SegmentPlan quick = plan();
    quick.watchdog_ms = 50;
    SegmentWriter writer(quick);
    writer.set_state(TACTILED_RUNNING);
    beat(writer, 0);
    Follower follower(name_);
    follower.look();
    ::usleep(80'000);
    writer.publish(0, sample(0));  // published, and then it hung
    follower.look();
    EXPECT_EQ(taken(follower, 0, TACTILED_GOOD).size(), 0u);
}

TEST_F(FollowerTest, WaitsForTheTimeAndNoLonger) {
    Follower follower(name_);
    follower.look();
    EXPECT_FALSE(follower.is_alive());
    const std::uint64_t began_ns = monotonic_ns();
    follower.wait(began_ns + 10'000'000);
    EXPECT_GE(monotonic_ns() - began_ns, 9'000'000u);
}

tactiled_sample at(std::uint64_t t_ms, std::uint32_t quality = TACTILED_GOOD) {
    tactiled_sample s{};
    s.t_published_ns = t_ms * 1'000'000;
    s.quality = quality;
    return s;
}

TEST(Pace, LetsTheRatePassAndEachChangeOfQuality) {
    Pace pace(100);
    int passed = 0;
    for (std::uint64_t t_ms = 1000; t_ms < 2000; ++t_ms) passed += pace.passes(at(t_ms)) ? 1 : 0;
    EXPECT_EQ(passed, 100);
    EXPECT_TRUE(pace.passes(at(2000)));
    EXPECT_FALSE(pace.passes(at(2001)));
    EXPECT_TRUE(pace.passes(at(2002, TACTILED_BAD)));
    EXPECT_FALSE(pace.passes(at(2003, TACTILED_BAD)));
    EXPECT_TRUE(pace.passes(at(2004)));
    EXPECT_TRUE(pace.passes(at(100)));  // another daemon's clock
}

TEST(Pace, WithoutARateEachSamplePasses) {
    Pace pace(0);
    for (std::uint64_t t_ms = 0; t_ms < 10; ++t_ms) EXPECT_TRUE(pace.passes(at(5)));
}

TEST(Words, TopicsAndReasons) {
    EXPECT_EQ(topic_word("gripper-1"), "gripper_1");
    EXPECT_EQ(topic_word("1"), "_1");
    EXPECT_EQ(topic_word(""), "_");
    EXPECT_EQ(reason_words(TACTILED_STALE | TACTILED_SATURATED), (std::vector<std::string>{"stale", "saturated"}));
    EXPECT_NEAR(wall_s(monotonic_ns()), double(::time(nullptr)), 1.1);
}

}  // namespace
}  // namespace tactiled::bridges
