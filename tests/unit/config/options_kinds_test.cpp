// Values of a wrong kind, each reported by its name.
#include <gtest/gtest.h>

#include "config/options.hpp"
#include "folder.hpp"

namespace tactiled {
namespace {

TEST(OptionsKinds, AValueOfAnotherKindIsReportedByItsName) {
    for (const auto& [value, reported] : {std::pair<std::string, std::string>("'a'", " = \"a\" is a string"),
                                          {"1", " = 1 is an integer"},
                                          {"1.5", " = 1.5 is a number"},
                                          {"2026-03-02", " is a date"},
                                          {"10:00:00", " is a time"},
                                          {"2026-03-02T10:00:00", " is a date with time"},
                                          {"[1]", " is an array"},
                                          {"{a = 1}", " is a table"}}) {
        Problems problems;
        Options options = Options::parse_text("key = " + value + "\n", "t.toml", problems);
        (void)options.flag("key", false);
        EXPECT_EQ(problems.lines(), std::vector<std::string>{"t.toml:1: key" + reported + ", should be true or false"});
    }
    for (const char* value : {"true", "false"}) {
        Problems problems;
        Options options = Options::parse_text(std::string("key = ") + value + "\n", "t.toml", problems);
        (void)options.text("key", "");
        EXPECT_EQ(problems.lines(),
                  std::vector<std::string>{std::string("t.toml:1: key = ") + value + " is a boolean, should be a string"});
    }
}

TEST(OptionsKinds, ARowMayBeEmptyAndIsNotWrongForThat) {
    Problems problems;
    Options options = Options::parse_text("a = [[], [1]]\nb = [[1], ['x']]\nc = [1]\n", "t.toml", problems);
    EXPECT_EQ(options.rows("a"), (std::vector<std::vector<double>>{{}, {1}}));
    EXPECT_TRUE(problems.empty());
    EXPECT_TRUE(options.rows("b").empty());
    EXPECT_TRUE(options.rows("c").empty());
    EXPECT_EQ(problems.lines(),
              (std::vector<std::string>{"t.toml:2: b[1][0] = \"x\" is a string, should be a number",
                                        "t.toml:3: c[0] = 1 is an integer, should be an array of numbers"}));
}

TEST(OptionsKinds, AFileBesideIsNamedOrMissing) {
    const test::Folder folder;
    (void)folder.write("b.txt", "bytes");
    Problems problems;
    Options options = Options::parse_file(folder.write("t.toml", "b = 'b.txt'\nc = 'c.txt'\n"), problems);
    EXPECT_EQ(options.text_file("b", 10)->text, "bytes");
    EXPECT_TRUE(problems.empty());
    EXPECT_FALSE(options.text_file("a", 10));
    EXPECT_FALSE(options.text_file("c", 10));
    const auto lines = problems.lines();
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_NE(lines[0].find("t.toml:1: key \"a\" is missing"), std::string::npos) << lines[0];
    EXPECT_NE(lines[1].find("c.txt: there is no such file"), std::string::npos) << lines[1];
}

}  // namespace
}  // namespace tactiled
