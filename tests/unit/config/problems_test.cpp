#include <gtest/gtest.h>

#include "config/options.hpp"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;

TEST(Problems, AreSortedByFileAndLine) {
    Problems problems;
    problems.add("b.toml", 2, "second");
    problems.add("a.toml", 11, "eleventh");
    problems.add("a.toml", 9, "later", 5);
    problems.add("a.toml", 9, "ninth", 4);
    problems.add("a.toml", 0, "whole");
    EXPECT_EQ(problems.lines(),
              (Lines{"a.toml: whole", "a.toml:9:4: ninth", "a.toml:9:5: later", "a.toml:11: eleventh", "b.toml:2: second"}));
}

TEST(Problems, AreReportedOnce) {
    Problems problems;
    problems.add("a", 1, "x");
    problems.add("a", 1, "x");
    EXPECT_EQ(problems.lines(), Lines{"a:1: x"});
}

TEST(Problems, AreThrownAllTogether) {
    Problems problems;
    EXPECT_NO_THROW(problems.throw_if_any());
    problems.add("a", 2, "y");
    problems.add("a", 1, "x");
    try {
        problems.throw_if_any();
        FAIL() << "nothing thrown";
    } catch (const SetupError& error) { EXPECT_STREQ(error.what(), "a:1: x\na:2: y"); }
}

struct Slip {
    const char *typed, *meant;  // "" = no name is similar enough
};

TEST(NearestName, FindsWhatWasMeant) {
    const Lines known{"name",     "driver",   "device",  "baud", "format",
                      "channels", "stale_ms", "tare_ms", "cpu",  "saturates_at"};
    const Slip slips[] = {{"devcie", "device"},
                          {"Device", "device"},
                          {"dvice", "device"},
                          {"devicee", "device"},
                          {"baudrate", "baud"},
                          {"stale", "stale_ms"},
                          {"stale_mS", "stale_ms"},
                          {"tare", "tare_ms"},
                          {"chanels", "channels"},
                          {"cpus", "cpu"},
                          {"saturate_at", "saturates_at"},
                          {"nmae", "name"},
                          {"gripper", ""},
                          {"zzz", ""},
                          {"x", ""},
                          {"", ""},
                          {"friction", ""}};
    for (const auto& [typed, meant] : slips) EXPECT_EQ(nearest_name(typed, known).value_or(""), meant) << typed;
}

TEST(NearestName, PrefersTheNearer) {
    EXPECT_EQ(nearest_name("usb10", {"usb0", "usb1", "usb110"}).value_or(""), "usb0");
    EXPECT_EQ(nearest_name("tare_ms", {"stale_ms", "tare_ms"}).value_or(""), "tare_ms");
}

TEST(NearestName, OfNothingIsNothing) { EXPECT_FALSE(nearest_name("name", {})); }

TEST(InQuotes, KeepsAFileFromSteeringTheTerminal) {
    EXPECT_EQ(in_quotes("left"), "\"left\"");
    EXPECT_EQ(in_quotes("\x1b[31m\n\x7f"), "\"\\x1b[31m\\x0a\\x7f\"");
    EXPECT_EQ(in_quotes("\xc2\x9b"), "\"\\x9b\"");                         // CSI as one character
    EXPECT_EQ(in_quotes("gr\xc3\xbc\xc3\x9f"), "\"gr\xc3\xbc\xc3\x9f\"");  // UTF-8 letters stay
}

TEST(InQuotes, CutsLongTextBetweenCharacters) {
    std::string text;
    for (int i = 0; i < 100; ++i) text += "\xe2\x82\xac";  // 3 bytes each
    const std::string cut = in_quotes(text);
    EXPECT_EQ(cut.size(), 60 + 2 + 3u);
    EXPECT_EQ(in_quotes(std::string(1000, 'x')), "\"" + std::string(60, 'x') + "...\"");
}

}  // namespace
}  // namespace tactiled
