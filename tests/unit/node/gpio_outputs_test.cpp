// The GPIO signs of a node record. tests/kernel/gpio_test.py tests the lines themselves.
#include <gtest/gtest.h>

#include "tests/unit/milliseconds.hpp"

#include "node/gpio_outputs.hpp"

namespace tactiled {
namespace {

tactiled_node healthy(std::uint32_t grip = TACTILED_GRIP_OPEN) {
    tactiled_node node{};
    node.status = TACTILED_READY;
    node.grasp.state = grip;
    return node;
}

TEST(GpioJudge, EverythingIsAFaultButAFreshRecordOfAReadyNode) {
    GpioJudge judge(100);
    EXPECT_TRUE(judge.judge(nullptr, 1).fault);
    tactiled_node node = healthy();
    EXPECT_FALSE(judge.judge(&node, 2).fault);
    node.status = 0;  // a sensor has no value
    EXPECT_TRUE(judge.judge(&node, 3).fault);
    node.status = TACTILED_READY | TACTILED_FAULT;
    EXPECT_TRUE(judge.judge(&node, 4).fault);
    node = healthy(TACTILED_GRIP_HOLDING);
    node.heartbeat = 1;
    EXPECT_TRUE(judge.judge(&node, 5).grasped);
    EXPECT_EQ(judge.judge(nullptr, 6), GpioSigns{});  // no earlier state is kept
}

TEST(GpioJudge, SaysGraspedFromGraspedToSlippingAndNotWhenUnknownOrLost) {
    GpioJudge judge(100);
    for (const auto& [grip, grasped] : {std::pair{TACTILED_GRIP_OPEN, false},
                                        {TACTILED_GRIP_CONTACT, false},
                                        {TACTILED_GRIP_GRASPED, true},
                                        {TACTILED_GRIP_LIFTING, true},
                                        {TACTILED_GRIP_HOLDING, true},
                                        {TACTILED_GRIP_SLIPPING, true},
                                        {TACTILED_GRIP_LOST, false},
                                        {TACTILED_GRIP_UNKNOWN, false}}) {
        const tactiled_node node = healthy(std::uint32_t(grip));
        EXPECT_EQ(judge.judge(&node, 1).grasped, grasped) << grip;
        EXPECT_EQ(judge.judge(&node, 1).slip, grip == TACTILED_GRIP_SLIPPING);
    }
}

TEST(GpioJudge, AShortSlipIsShownForSlipMsAndOneOfBeforeTheStartNotAtAll) {
    GpioJudge judge(100);
    tactiled_node node = healthy(TACTILED_GRIP_HOLDING);
    node.grasp.slips = 7;
    EXPECT_FALSE(judge.judge(&node, 1000 * kMs).slip);
    node.grasp.slips = 8;
    EXPECT_TRUE(judge.judge(&node, 1001 * kMs).slip);
    EXPECT_TRUE(judge.judge(&node, 1100 * kMs).slip);
    EXPECT_FALSE(judge.judge(&node, 1102 * kMs).slip);
}

TEST(GpioJudge, AliveIsTheHeartbeatsLowestBit) {
    GpioJudge judge(100);
    tactiled_node node = healthy();
    for (node.heartbeat = 0; node.heartbeat < 4; ++node.heartbeat)
        EXPECT_EQ(judge.judge(&node, 1).alive, node.heartbeat % 2 == 1);
}

}  // namespace
}  // namespace tactiled
