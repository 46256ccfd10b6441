// Units, times and numbers of labelled files whose meaning is in doubt.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "decoupling/fit/labelled.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

std::string fault_of(const std::string& text) {
    const ScratchFile file(text);
    try {
        (void)read_labelled(file.path(), {});
    } catch (const SetupError& error) { return error.what(); }
    return "";
}

TEST(Labelled, RefusesTimesWithoutTheirParts) {
    const auto text_with = [](const std::string& times, const char* part) {
        std::string text = times + ",B1,fz_N\n";
        for (int i = 0; i < 9; ++i)
            text +=
                fmt::format("{}{},{},{}\n", 1718000000 + i / 3, fmt::format(fmt::runtime(part), i % 3), i * i % 7, i * i);
        return text;
    };
    const ScratchFile file(text_with("header.stamp.secs,header.stamp.nsecs", ",{}00000000"));
    const auto rows = read_labelled(file.path(), {}).rows;
    EXPECT_EQ(rows[1].t_ns - rows[0].t_ns, 100'000'000u);
    for (const char* name : {"stamp.secs", "t_s", "time"})
        EXPECT_NE(fault_of(text_with(name, "")).find("whole seconds with several rows"), std::string::npos) << name;
    EXPECT_EQ(fault_of("t_s,B1,fz_N\n1,1,2\n1,2,5\n2,3,4\n3,3,5\n"), "");
}

TEST(Labelled, RefusesNumbersThatMayHaveMarksOfThousands) {
    const auto complaint_of = [](const std::string& rows) { return fault_of("t_ms\tB1\tB2\tfz_mN\n" + rows); };
    for (const char* rows : {"0\t20,502\t19,801\t-998\n50\t20,502\t19,802\t-14,466\n1,000\t2\t3\t4\n",
                             "0\t20.502\t19.801\t-998\n1050\t20.503\t19.802\t-14.466\n"})
        EXPECT_NE(complaint_of(rows).find("thousands or decimals?"), std::string::npos) << rows;
    for (const char* rows : {"0\t20,502\t19,801\t-0,998\n50\t20,501\t19,802\t-14,466\n",
                             "0\t20.502\t19.80\t-998\n50\t20.503\t19.802\t-14.466\n",
                             "0\t20,502\t19,801\t-998\n50\t20502\t19,802\t-14,466\n", "0\t20502\t19801\t-998\n"})
        EXPECT_EQ(complaint_of(rows), "") << rows;
}

// A sensor of one channel; the name alone does not say which of two columns it is.
TEST(Labelled, TheOnlyColumnLeftIsTheChannel) {
    const ScratchFile film("t_s,Vp,fz_N\n0.1,1,2\n0.2,2,5\n0.3,4,1\n");
    EXPECT_EQ(read_labelled(film.path(), {}).channels, std::vector<std::string>{"Vp"});
    EXPECT_NE(fault_of("t_s,Vp,loss,fz_N\n0.1,1,2,3\n0.2,2,5,7\n0.3,4,1,5\n").find("is it a channel or not: Vp, loss"),
              std::string::npos);
    std::string copy = "t_s,Vp,fz_N\n";
    for (int i = 0; i < 30; ++i) copy += fmt::format("{},{},{}\n", 0.1 * i, i * i % 11, i * i % 11);
    EXPECT_NE(fault_of(copy).find("a copy of fz_N"), std::string::npos) << fault_of(copy);
}

// Another quantity of a thermometer, two words of a unit, and letters that are units, too.
TEST(Labelled, UnitsBelongToTheirQuantity) {
    for (const char* name : {"ntc_kOhm", "temp [deg]", "temp_raw"}) {
        const ScratchFile file(fmt::format("t_s,B1,B2,{},fz_N\n0.1,1,2,3,4\n0.2,2,5,4,1\n", name));
        const std::string columns = read_labelled(file.path(), {}).columns;
        EXPECT_NE(columns.find("no unit of temperature"), std::string::npos) << columns;
    }
    const ScratchFile moment("t/s,B1,Fz/N,Mz/N.m\n0,1,2,3\n0.5,2,3,5\n");
    EXPECT_EQ(read_labelled(moment.path(), {}).rows[0].wrench_S[5], 3);
    const auto channels = [](const std::string& names, const Selection& selection = {}) {
        std::string text = "t_s," + names + ",fz_N\n";
        for (int i = 0; i < 40; ++i)
            text += fmt::format("{},{},{},{},{}\n", 0.01 * i, i % 7 + 0.1 * (i % 3), i % 5, (i * i) % 11,
                                -(i % 4) - 0.01 * (i % 9));
        const ScratchFile file(text);
        try {
            return fmt::format("{}", fmt::join(read_labelled(file.path(), selection).channels, " "));
        } catch (const SetupError& error) { return std::string(error.what()); }
    };
    EXPECT_EQ(channels("ch_a,ch_b,ch_h"), "ch_a ch_b ch_h");
    EXPECT_EQ(channels("ch_A,ch_C,ch_F"), "ch_A ch_C ch_F");
    EXPECT_EQ(channels("R_E,R_S,R_W"), "R_E R_S R_W");
    EXPECT_EQ(channels("ch1_uS,ch2_uS,ch3_uS"), "ch1_uS ch2_uS ch3_uS");
    EXPECT_EQ(channels("B1,B2,TIME_S"), "B1 B2");
    EXPECT_EQ(channels("B1,B2,t_ms", {.sessions = {}, .channels = {"B1", "t_ms"}}), "B1 t_ms");
    EXPECT_NE(channels("F_A,F_B,F_N"), "F_A F_B F_N");
}

}  // namespace
}  // namespace tactiled
