#include "node/method_costs.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace tactiled {
namespace {

namespace fs = std::filesystem;

class MethodCosts : public testing::Test {
protected:
    MethodCosts() {
        std::string pattern = (fs::temp_directory_path() / "tactiled_costs_XXXXXX").string();
        folder_ = mkdtemp(pattern.data());
    }
    ~MethodCosts() override { fs::remove_all(folder_); }
    [[nodiscard]] MethodCostFile file(std::uint16_t crc = 7, const std::string& below = "/kept") const {
        Calibration calibration;
        calibration.crc = crc;
        return {folder_ + below, "gripper", "left", calibration};
    }
    [[nodiscard]] std::string path() const { return folder_ + "/kept/gripper.left.costs.toml"; }

    std::string folder_;
    const std::vector<MethodCost> costs_{{"rbf", 1.25}, {"matrix", 0.1}};
};

TEST_F(MethodCosts, AreKeptToTheLastBit) {
    EXPECT_TRUE(file().load().empty());
    file().save(costs_);
    EXPECT_EQ(file().load(), costs_);
}

TEST_F(MethodCosts, OfAnotherCalibrationAreNotTaken) {
    file().save(costs_);
    EXPECT_TRUE(file(8).load().empty());
}

TEST_F(MethodCosts, ThatAreDamagedAreNotTaken) {
    file().save(costs_);
    std::ifstream in(path());
    const std::string whole{std::istreambuf_iterator<char>(in), {}};
    ASSERT_FALSE(whole.empty());
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string text = whole;
        text.replace(text.find(from), from.size(), to);
        return text;
    };
    for (const std::string& damaged :
         {std::string(), whole.substr(0, whole.size() / 2), with("1.25", "nan"), with("1.25", "-1"), with("1.25, ", ""),
          with("us = ", "uss = "), std::string(20000, 'x'), with("calibration", "of another build; calibration")}) {
        std::ofstream(path()) << damaged;
        EXPECT_TRUE(file().load().empty()) << damaged;
    }
    file().save(costs_);
    EXPECT_EQ(file().load(), costs_);
}

TEST_F(MethodCosts, ThatCannotBeKeptStopNobody) {
    std::ofstream(folder_ + "/kept") << "a file where the folder should be";
    EXPECT_NO_THROW(file().save(costs_));
    EXPECT_TRUE(file().load().empty());
    Calibration calibration;
    const MethodCostFile nowhere("", "gripper", "left", calibration);
    EXPECT_NO_THROW(nowhere.save(costs_));
    EXPECT_TRUE(nowhere.load().empty());
}

TEST_F(MethodCosts, AreKeptWhereSystemdOrTheUserKeepsSuchThings) {
    ::setenv("HOME", "/home/u", 1);
    ::unsetenv("XDG_CACHE_HOME");
    ::unsetenv("STATE_DIRECTORY");
    EXPECT_EQ(method_costs_folder(), "/home/u/.cache/tactiled");
    ::setenv("XDG_CACHE_HOME", "/c", 1);
    EXPECT_EQ(method_costs_folder(), "/c/tactiled");
    ::setenv("STATE_DIRECTORY", "/var/lib/tactiled:/var/lib/other", 1);
    EXPECT_EQ(method_costs_folder(), "/var/lib/tactiled");
    ::unsetenv("XDG_CACHE_HOME");
    ::unsetenv("STATE_DIRECTORY");
}

}  // namespace
}  // namespace tactiled
