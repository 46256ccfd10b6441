// Taught objects: their file, learning from weighings, and objects that are too similar.
#include "node/objects.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

namespace tactiled {
namespace {

class ObjectsTest : public testing::Test {
protected:
    ObjectsTest() { std::filesystem::create_directory(folder_); }
    ~ObjectsTest() override { std::filesystem::remove_all(folder_); }
    void write(const std::string& text) const { std::ofstream(path_) << text; }
    [[nodiscard]] std::string first_problem() const {
        Problems problems;
        load_objects(path_, problems);
        return problems.empty() ? "" : problems.lines().front();
    }
    static TaughtObject object(std::uint32_t id, const std::string& name, double mass_kg, double sd_kg,
                               unsigned grasps = 5) {
        TaughtObject o;
        o.id = id;
        o.name = name;
        o.mass_kg = mass_kg;
        o.sd_kg = sd_kg;
        o.grasps = grasps;
        return o;
    }
    std::string folder_ = "/tmp/objects-test-" + std::to_string(::getpid());
    std::string path_ = folder_ + "/objects.toml";
};

TEST_F(ObjectsTest, AFileThatIsNotThereTeachesNothing) {
    Problems problems;
    EXPECT_TRUE(load_objects(path_, problems).empty());
    EXPECT_TRUE(problems.empty());
}

TEST_F(ObjectsTest, WhatIsStoredIsRead) {
    const std::vector<TaughtObject> taught{object(1, "bolt", 0.123456789, 0.0012), object(7, "an-egg", 0.057, 1e-4, 20)};
    store_objects(path_, taught);
    Problems problems;
    const auto read = load_objects(path_, problems);
    EXPECT_TRUE(problems.empty()) << problems.lines().front();
    ASSERT_EQ(read.size(), 2u);
    EXPECT_EQ(read[0].name, "bolt");
    EXPECT_EQ(read[0].mass_kg, 0.123456789);
    EXPECT_EQ(read[1].id, 7u);
    EXPECT_EQ(read[1].grasps, 20u);
    EXPECT_EQ(read[1].sd_kg, 1e-4);
}

TEST_F(ObjectsTest, AnErrorIsReportedWithItsLine) {
    const std::string one = "format = 1\n[[object]]\nid = 1\nname = 'a'\nmass_kg = 0.1\nsd_kg = 0.001\n";
    write(one + "[[object]]\nid = 1\nname = 'b'\nmass_kg = 0.2\nsd_kg = 0.001\n");
    EXPECT_NE(first_problem().find("objects.toml:8: "), std::string::npos) << first_problem();
    write(one + "[[object]]\nid = 2\nname = 'a'\nmass_kg = 0.2\nsd_kg = 0.001\n");
    EXPECT_NE(first_problem().find(":9: "), std::string::npos) << first_problem();
    write("format = 2\n");
    EXPECT_NE(first_problem().find("format = 1"), std::string::npos);
    write("format = 1\n[[object]]\nid = 1\nname = 'a'\nmass_kg = 0.1\nsd_kg = 0\n");
    EXPECT_NE(first_problem().find(":6: "), std::string::npos);  // an sd of 0 is certainly wrong
    write("format = 1\n[[object]]\nid = 1\nname = 'a'\nmass_kg = 0\nsd_kg = 0.001\n");
    EXPECT_NE(first_problem().find(":5: "), std::string::npos);  // a mass of 0 is not an object
    write("format = 1\n[[object]]\nid = 1\nname = 'a b'\nmass_kg = 0.1\nsd_kg = 0.001\n");
    EXPECT_NE(first_problem().find(":4: "), std::string::npos);
    write("not toml");
    EXPECT_NE(first_problem(), "");
}

TEST_F(ObjectsTest, AFailedStoreLeavesTheOldFile) {
    store_objects(path_, std::vector{object(1, "bolt", 0.1, 0.001)});
    EXPECT_THROW(store_objects(folder_ + "/nowhere/objects.toml", {}), SetupError);
    Problems problems;
    EXPECT_EQ(load_objects(path_, problems).size(), 1u);
}

TEST(Objects, TheSpreadIsThatFromGraspToGraspAndNeverLessThanAWeighingClaims) {
    const std::vector<Weighing> apart{{0.10, 0.001}, {0.12, 0.001}, {0.11, 0.001}};
    EXPECT_NEAR(summary_of(apart).mass_kg, 0.11, 1e-12);
    EXPECT_NEAR(summary_of(apart).sd_kg, 0.01, 1e-12);
    const std::vector<Weighing> alike{{0.1, 0.002}, {0.1, 0.003}};
    EXPECT_EQ(summary_of(alike).sd_kg, 0.003);
    EXPECT_EQ(summary_of(std::vector<Weighing>{{0.1, 0.004}}).sd_kg, 0.004);
}

TEST(Objects, OneMoreGraspIsAsIfAllHadBeenTaughtAtOnce) {
    const std::vector<Weighing> all{{0.10, 1e-6}, {0.12, 1e-6}, {0.11, 1e-6}, {0.14, 1e-6}};
    TaughtObject step = summary_of(std::span(all).first(2));
    step = with_one_more(with_one_more(step, all[2]), all[3]);
    const TaughtObject whole = summary_of(all);
    EXPECT_EQ(step.grasps, 4u);
    EXPECT_NEAR(step.mass_kg, whole.mass_kg, 1e-12);
    EXPECT_NEAR(step.sd_kg, whole.sd_kg, 1e-12);
}

TEST_F(ObjectsTest, TwoThatOverlapWithinThreeSdEachAreConfused) {
    const std::vector<TaughtObject> taught{object(1, "bolt", 0.100, 0.001), object(2, "nut", 0.120, 0.001)};
    EXPECT_FALSE(confused_with(object(3, "pin", 0.110, 0.001), taught));  // 5 sd of each to both
    const auto near = confused_with(object(3, "pin", 0.115, 0.001), taught);
    ASSERT_TRUE(near);
    EXPECT_EQ(near->other->name, "nut");
    EXPECT_NEAR(near->apart_sd, 2.5, 1e-9);
    EXPECT_FALSE(confused_with(object(2, "nut", 0.119, 0.001), taught));  // itself, taught again
    EXPECT_TRUE(confused_with(object(3, "pin", 0.110, 0.004), taught));   // the wider, the nearer
}

TEST_F(ObjectsTest, WeightsOfAnotherScaleAreNotMixedWithThose) {
    TaughtObject bolt = object(1, "bolt", 0.100, 0.001);
    bolt.scaled = true;
    store_objects(path_, std::vector{bolt, object(2, "nut", 0.1, 0.001)});
    Problems problems;
    const auto read = load_objects(path_, problems);
    ASSERT_TRUE(problems.empty());
    EXPECT_TRUE(read[0].scaled);
    EXPECT_FALSE(read[1].scaled);
    EXPECT_FALSE(confused_with(object(3, "pin", 0.2, 0.001), read));
    const auto near = confused_with(bolt, std::vector{object(2, "nut", 0.1, 0.001)});
    EXPECT_FALSE(near);  // never known at the same time
    const TaughtObject again = with_one_more(bolt, {0.11, 0.002, false});
    EXPECT_EQ(again.mass_kg, 0.11);
    EXPECT_EQ(again.grasps, 1u);
    EXPECT_FALSE(again.scaled);
}

TEST_F(ObjectsTest, OneOfTwoWritersWaitsForTheOther) {
    std::atomic<bool> second{false};
    std::thread other;
    {
        const ObjectsLock lock(path_);
        other = std::thread([&] {
            const ObjectsLock theirs(path_);
            second = true;
        });
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        EXPECT_FALSE(second);
    }
    other.join();
    EXPECT_TRUE(second);
}

TEST_F(ObjectsTest, AFreeIdIsTheLeast) {
    EXPECT_EQ(free_id({}), 1u);
    EXPECT_EQ(free_id(std::vector{object(1, "a", 1, 1), object(3, "b", 2, 1)}), 2u);
}

TEST_F(ObjectsTest, WhereNoLockCanStandNothingIsTaught) {
    EXPECT_THROW(ObjectsLock(folder_ + "/nowhere/objects.toml"), SetupError);
    std::filesystem::create_symlink("/etc/passwd", path_ + ".lock");  // another user's file is not used
    EXPECT_THROW(ObjectsLock{path_}, SetupError);
}

TEST(Objects, OnlyWhatWeighsSomethingForSureIsTaught) {
    EXPECT_TRUE(is_teachable({0.1, 0.001}));
    EXPECT_FALSE(is_teachable({0.1, 0.1 / 3}));
    EXPECT_FALSE(is_teachable({1001, 0.1}));   // the file accepts no more
    EXPECT_FALSE(is_teachable({0.1, 1e-10}));  // an sd that is too small
    EXPECT_TRUE(summary_of(std::vector<Weighing>{{0.1, 0.004, true}}).scaled);
    EXPECT_EQ(summary_of({}).grasps, 0u);
    const std::vector<TaughtObject> none;
    EXPECT_EQ(find_object(none, "bolt"), nullptr);
}

}  // namespace
}  // namespace tactiled
