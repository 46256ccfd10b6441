// Each reason with the best quality that it allows and its words, and no reason without them (layout.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "node/modbus/table.hpp"
#include "tactiled/layout.h"

namespace tactiled {
namespace {

struct Row {
    std::uint32_t reason;
    std::string constant, word;
    std::uint32_t best;
    int fault;
    std::string fault_constant, meaning, remedy;
};

const std::vector<Row> kTable{
#define ROW(reason, word, best, fault, constant, use, meaning, remedy) \
    {TACTILED_##reason, #reason, word, best, fault, constant, meaning, remedy},
    TACTILED_REASON_TABLE(ROW)
#undef ROW
};

// The contract: what a value with each reason may be at best.
const std::map<std::uint32_t, std::uint32_t> kBest{{TACTILED_NO_DATA_YET, TACTILED_BAD},
                                                   {TACTILED_STALE, TACTILED_BAD},
                                                   {TACTILED_DISCONNECTED, TACTILED_BAD},
                                                   {TACTILED_MISSING_CHANNEL, TACTILED_UNCERTAIN},
                                                   {TACTILED_SATURATED, TACTILED_UNCERTAIN},
                                                   {TACTILED_DISAGREEMENT, TACTILED_UNCERTAIN},
                                                   {TACTILED_OUTSIDE_DOMAIN, TACTILED_UNCERTAIN},
                                                   {TACTILED_UNCALIBRATED, TACTILED_UNCERTAIN},
                                                   {TACTILED_NOT_FINITE, TACTILED_BAD},
                                                   {TACTILED_DAEMON_STOPPED, TACTILED_BAD},
                                                   {TACTILED_TARING, TACTILED_GOOD},
                                                   {TACTILED_READER_OVERRUN, TACTILED_BAD},
                                                   {TACTILED_WRONG_DEVICE, TACTILED_BAD},
                                                   {TACTILED_UNKNOWN_UNCERTAINTY, TACTILED_UNCERTAIN},
                                                   {TACTILED_FROZEN, TACTILED_UNCERTAIN},
                                                   {TACTILED_STEPPED, TACTILED_UNCERTAIN},
                                                   {TACTILED_IDLE_BUS, TACTILED_BAD},
                                                   {TACTILED_WRONG_RATE, TACTILED_GOOD},
                                                   {TACTILED_DRIFTED, TACTILED_GOOD},
                                                   {TACTILED_SENSORS_DIFFER, TACTILED_UNCERTAIN},
                                                   {TACTILED_UNPROVED_AGE, TACTILED_UNCERTAIN},
                                                   {TACTILED_ARRIVAL_ONLY, TACTILED_GOOD},
                                                   {TACTILED_ZERO_UNKNOWN, TACTILED_UNCERTAIN},
                                                   {TACTILED_GLITCHES, TACTILED_UNCERTAIN},
                                                   {TACTILED_ZERO_OLD, TACTILED_UNCERTAIN},
                                                   {TACTILED_TOO_QUIET, TACTILED_UNCERTAIN},
                                                   {TACTILED_NOT_REDUNDANT, TACTILED_UNCERTAIN},
                                                   {TACTILED_TEMPERATURE, TACTILED_UNCERTAIN}};

TEST(Verdict, EachReasonHasQualityAndWords) {
    std::set<std::uint32_t> reasons;
    std::set<std::string> words;
    for (const Row& row : kTable) {
        SCOPED_TRACE(row.constant);
        EXPECT_TRUE(std::has_single_bit(row.reason));
        EXPECT_TRUE(reasons.insert(row.reason).second) << "twice";
        EXPECT_TRUE(!row.word.empty() && words.insert(row.word).second) << "no word, or the word of another reason";
        EXPECT_FALSE(row.meaning.empty());
        EXPECT_FALSE(row.remedy.empty());
        ASSERT_TRUE(kBest.contains(row.reason)) << "state its best quality in this test";
        EXPECT_EQ(row.best, kBest.at(row.reason));
        EXPECT_EQ(tactiled_verdict(row.reason, true), kBest.at(row.reason));
        EXPECT_EQ(tactiled_verdict(row.reason, false), std::uint32_t(TACTILED_BAD));
        // A reason that lowers the quality is a fault of the register map, and no other one is.
        EXPECT_EQ(row.fault != 0, row.best != TACTILED_GOOD);
        EXPECT_EQ(row.fault_constant.empty(), row.fault == 0);
        EXPECT_EQ(modbus::fault_of(row.reason), row.fault);
    }
    EXPECT_EQ(reasons.size(), kBest.size());
}

TEST(Verdict, IsTheWorstThatAReasonAllows) {
    EXPECT_EQ(tactiled_verdict(0, true), std::uint32_t(TACTILED_GOOD));
    EXPECT_EQ(tactiled_verdict(0, false), std::uint32_t(TACTILED_BAD));
    for (const auto& [a, best_a] : kBest)
        for (const auto& [b, best_b] : kBest)
            EXPECT_EQ(tactiled_verdict(a | b, true), std::max(best_a, best_b)) << a << " " << b;
}

TEST(Verdict, OfAReasonThatIsNotInTheTableIsUncertain) {
    for (std::uint32_t bit = std::uint32_t(kBest.size()); bit < 32; ++bit)
        EXPECT_EQ(tactiled_verdict(1u << bit, true), std::uint32_t(TACTILED_UNCERTAIN)) << bit;
}

// The first of the table is the worst: a value with two faults reports it.
TEST(Verdict, TheFaultOfTwoIsThatOfTheWorseQuality) {
    for (const Row& a : kTable)
        for (const Row& b : kTable) {
            if (a.best <= b.best || b.fault == 0 || a.reason == TACTILED_READER_OVERRUN) continue;
            EXPECT_EQ(modbus::fault_of(a.reason | b.reason), a.fault) << a.constant << " " << b.constant;
        }
}

TEST(Verdict, OfAWrenchOnTheGripper) {
    const std::map<std::uint32_t, std::uint32_t> best{
        {TACTILED_TOOL_GRAVITY, TACTILED_BAD},    {TACTILED_TOOL_SENSOR, TACTILED_BAD},
        {TACTILED_TOOL_TARE, TACTILED_BAD},       {TACTILED_TOOL_DOUBTED, TACTILED_UNCERTAIN},
        {TACTILED_TOOL_MOVES, TACTILED_GOOD},     {TACTILED_TOOL_TORQUE, TACTILED_GOOD},
        {TACTILED_TOOL_APART, TACTILED_UNCERTAIN}};
    EXPECT_EQ(tactiled_tool_verdict(0), std::uint32_t(TACTILED_GOOD));
    EXPECT_EQ(tactiled_tool_verdict(1u << 20), std::uint32_t(TACTILED_UNCERTAIN)) << "unknown";
    for (const auto& [a, best_a] : best)
        for (const auto& [b, best_b] : best) EXPECT_EQ(tactiled_tool_verdict(a | b), std::max(best_a, best_b));
}

}  // namespace
}  // namespace tactiled
