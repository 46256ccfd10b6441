#include "node/lab/warning_page.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>

namespace tactiled::ctl {
namespace {

TEST(WarningPage, TheWorstComesFirst) {
    const auto lines = warning_page({"parameter gap = 3 was not used: x", "one session only: x", "zero drift: x",
                                     "fz: no sensor is as good as that: x", "not validated, so no standard deviation: x"});
    ASSERT_EQ(lines.size(), 5u);
    EXPECT_EQ(lines[0].find("not validated"), 0u);
    EXPECT_EQ(lines[1].find("fz: no sensor"), 0u);
    EXPECT_EQ(lines[2].find("zero drift"), 0u);
    EXPECT_EQ(lines[3].find("one session only"), 0u);
    EXPECT_EQ(lines[2], "zero drift: x. Tare after each mounting");
}

TEST(WarningPage, ARemedyAfterAQuestionIsASentence) {
    EXPECT_EQ(warning_page({"are these times in milliseconds?"}).front(),
              "are these times in milliseconds? Name the column t_ms");
}

TEST(WarningPage, WarningsOfOneCauseAreOneLine) {
    std::vector<std::string> warnings;
    for (int i = 0; i < 5000; ++i)
        warnings.push_back("channel c" + std::to_string(i) + " is always 3 in the labelled rows: left out");
    const auto lines = warning_page(warnings);
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_NE(lines[0].find("channel c0 "), std::string::npos);
    EXPECT_NE(lines[0].find("and 4999 more of this kind"), std::string::npos);
    EXPECT_EQ(by_consequence(warnings), warnings);
}

TEST(WarningPage, HasTenLinesAtMost) {
    std::vector<std::string> warnings = {"3 of 9 rows disagree with the rest in fz_N"};
    for (int i = 0; i < 20; ++i) warnings.push_back("  kept: a.csv:" + std::to_string(i));
    EXPECT_EQ(warning_page(warnings).size(), kWarningLines);
    for (int i = 0; i < 20; ++i) warnings.push_back("an unknown cause " + std::to_string(i));
    const auto lines = warning_page(warnings);
    EXPECT_EQ(lines.size(), kWarningLines);
    EXPECT_EQ(lines.back(), "and 12 more causes: --json has all");
}

// Each text of the fits has a row in the table of causes: the words of its code are compared.
TEST(WarningPage, KnowsEachWarningOfTheFits) {
    const std::filesystem::path root = TACTILED_SOURCE_DIR;
    const std::string last = "an unknown cause";
    int found = 0;
    for (const auto& file : std::filesystem::directory_iterator(root / "decoupling/fit")) {
        std::stringstream text;
        text << std::ifstream(file.path()).rdbuf();
        const std::string code = text.str();
        const std::regex begins(R"(warnings\.(push_back|emplace_back)\()");
        for (auto at = std::sregex_iterator(code.begin(), code.end(), begins); at != std::sregex_iterator(); ++at) {
            std::size_t i = std::size_t(at->position() + at->length());
            std::string words;
            for (int depth = 1, quoted = 0; depth > 0; ++i) {
                if (code[i] == '"' && code[i - 1] != '\\')
                    quoted = 1 - quoted;
                else if (quoted != 0)
                    words += code[i];
                else
                    depth += code[i] == '(' ? 1 : code[i] == ')' ? -1 : 0;
            }
            if (words.size() < 20 || words.starts_with("  ")) continue;  // a text from elsewhere, or a detail
            ++found;
            // With a row in the table it comes before an unknown cause, else behind it.
            EXPECT_EQ(warning_page({last, words}).front().find(last), std::string::npos) << file.path() << ": " << words;
        }
    }
    EXPECT_GT(found, 40);
}

}  // namespace
}  // namespace tactiled::ctl
