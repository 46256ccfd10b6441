// [gpio] in a user's configuration.
#include <gtest/gtest.h>

#include "config/tables.hpp"

namespace tactiled {
namespace {

struct Read {
    std::optional<GpioSettings> settings;
    std::string problems;
};

Read read(const std::string& text) {
    Problems problems;
    Options root = Options::parse_text(text, "test.toml", problems);
    (void)root.table("grasp");
    Read read{read_gpio(root), ""};
    root.finish();
    for (const auto& line : problems.lines()) read.problems += line + "\n";
    return read;
}

TEST(Gpio, IsOptionalAndHasItsDefaults) {
    EXPECT_FALSE(read("").settings);
    const auto one = read("[gpio]\nchip = 'gpiochip0'\nfault = 'ESTOP'");
    ASSERT_TRUE(one.settings);
    EXPECT_EQ(one.problems, "");
    EXPECT_EQ(one.settings->fault_is, "low");
    EXPECT_EQ(one.settings->slip_ms, 100);
    EXPECT_EQ(one.settings->alive, "");
}

TEST(Gpio, TellsWhatIsWrong) {
    const auto wrong = [](const std::string& text, const std::string& expected) {
        const std::string problems = read(text).problems;
        EXPECT_NE(problems.find(expected), std::string::npos) << problems;
    };
    wrong("[gpio]\nfault = '17'", "test.toml:1: [gpio]: key \"chip\" is missing");
    wrong("[gpio]\nchip = 'a'", "names no line");
    wrong("[gpio]\nchip = 'a'\nfault = 17", "test.toml:3: ");
    wrong("[gpio]\nchip = 'a'\nfault = '17'\nalive = '17'",
          "test.toml:4: [gpio]: alive = \"17\" is the line of fault already");
    wrong("[gpio]\nchip = 'a'\nslip = '17'", "there is no [grasp]");
    wrong("[gpio]\nchip = 'a'\nfault = '17'\nfault_is = 'up'", "fault_is = \"up\" is unknown");
    EXPECT_EQ(read("[gpio]\nchip = 'a'\nslip = '17'\n[grasp]\n").problems, "");
}

}  // namespace
}  // namespace tactiled
