// The objects that TEACH stores, and its failures.
#include "node/modbus/teaching.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <limits>

#include "tests/unit/config/folder.hpp"
#include "tests/unit/modbus/no_threads.hpp"

namespace tactiled::modbus {
namespace {

class TeachingTest : public testing::Test {
protected:
    Teaching::State teach(std::uint32_t id, double mass_kg, double sd_kg = 0.001) {
        teaching_.settle();
        teaching_.begin(id, {mass_kg, sd_kg, false});
        for (int i = 0; i < 500 && teaching_.state() == Teaching::storing; ++i) ::usleep(5000);
        return teaching_.state();
    }
    [[nodiscard]] std::vector<TaughtObject> kept() const {
        Problems problems;
        auto objects = load_objects(path_, problems);
        EXPECT_TRUE(problems.empty());
        return objects;
    }
    static std::vector<TaughtObject> objects(std::uint32_t n) {
        std::vector<TaughtObject> all;
        for (std::uint32_t id = 1; id <= n; ++id) {
            TaughtObject object;
            object.id = id;
            object.name = "object" + std::to_string(id);
            object.mass_kg = 0.1 * id;
            object.sd_kg = 0.001;
            object.grasps = 1;
            all.push_back(object);
        }
        return all;
    }
    const test::Folder folder_;
    const std::string path_ = folder_ / "objects.toml";
    Teaching teaching_{path_};
};

TEST_F(TeachingTest, ANewObjectFindsRoomAmongThirtyTwoAndNoneBeyond) {
    store_objects(path_, objects(grasp::Grasp::kMaxObjects - 1));
    EXPECT_EQ(teach(99, 9), Teaching::stored);
    EXPECT_EQ(teaching_.objects().size(), grasp::Grasp::kMaxObjects);
    EXPECT_EQ(teach(100, 12), Teaching::failed);
    EXPECT_EQ(kept().size(), grasp::Grasp::kMaxObjects);
    EXPECT_EQ(teach(99, 9.01), Teaching::stored);  // an existing one is taught further
    EXPECT_EQ(kept().back().grasps, 2u);
}

TEST_F(TeachingTest, AWeightThatMayBeNothingIsNotStored) {
    EXPECT_EQ(teach(1, 0.002), Teaching::failed);  // 2 of its standard deviations
    EXPECT_EQ(teach(1, std::numeric_limits<double>::quiet_NaN()), Teaching::failed);
    EXPECT_TRUE(kept().empty());
    EXPECT_EQ(teach(1, 0.02), Teaching::stored);
}

TEST_F(TeachingTest, ADamagedFileIsNotWrittenOver) {
    (void)folder_.write("objects.toml", "format = 1\n[[object]]\nid = 1\n");
    EXPECT_EQ(teach(2, 0.1), Teaching::failed);
    EXPECT_EQ(test::read_file(path_), "format = 1\n[[object]]\nid = 1\n");
}

TEST_F(TeachingTest, WithoutAThreadItFailsAndTheNextMaySucceed) {
    {
        const test::NoThreads no_threads;
        EXPECT_EQ(teach(1, 0.1), Teaching::failed);
    }
    EXPECT_EQ(teach(1, 0.1), Teaching::stored);
}

}  // namespace
}  // namespace tactiled::modbus
