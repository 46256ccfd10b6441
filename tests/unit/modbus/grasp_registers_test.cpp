// The grasp in a PLC's registers: from tactiled_grasp to registers, bits and floats.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "node/modbus/encode.hpp"
#include "node/shm/writer.hpp"
#include "tests/unit/modbus/cells.hpp"

namespace tactiled::modbus {
namespace {

class GraspRegisters : public testing::Test {
protected:
    GraspRegisters() : writer_(plan()) {
        writer_.set_state(TACTILED_RUNNING);
        segment_ = Segment::open(plan().name);
        auto& g = node_.grasp;
        tactiled_forget_grasp(&g);
        g.t_lift_off_ns = monotonic_ns() - 250'000'000;
        g.state = TACTILED_GRIP_HOLDING;
        g.weight_state = TACTILED_WEIGHT_STABLE;
        g.weight_kg = 7.12345;
        g.weight_sd_kg = 0.0021;
        g.grip_N = 12.34f;
        g.recommended_grip_N = 9.5f;
        g.friction = 0.623f;
        g.friction_sd = 0.05f;
        g.object_id = 3;
        g.object_probability = 0.987f;
        g.grasps = 65'537;
        g.slips = 65'540;
        g.slip_mask = 2;
        g.slip_latch = 3;
        g.slip_state[0] = TACTILED_SLIP_INCIPIENT;
        g.slip_state[1] = TACTILED_SLIP_GROSS;
        g.slip_count[1] = 42;
        g.friction_use[1] = 0.915f;
        publish();
    }
    static SegmentPlan plan() {
        SegmentPlan p;
        p.name = "grasp-registers-test-" + std::to_string(::getpid());
        p.history = 64;
        p.sensors.resize(2);
        for (auto& s : p.sensors) s.stale_ms = 10'000;
        return p;
    }
    void publish() {
        tactiled_sample s{};
        s.sequence = node_.sequence;
        s.t_ns = node_.t_ns = monotonic_ns();
        s.quality = TACTILED_GOOD;
        for (unsigned i = 0; i < 2; ++i) {
            writer_.publish(i, s);
            node_.count[i] = node_.sequence + 1;
        }
        writer_.publish(node_);
        ++node_.sequence;
    }
    std::array<std::uint16_t, kGlobalSize> global() const {
        std::array<std::uint16_t, kGlobalSize> out{};
        encode(area_with(Block::global), out, view_of(segment_));
        return out;
    }
    std::array<std::uint16_t, kGraspSize> grasp() const {
        std::array<std::uint16_t, kGraspSize> out{};
        encode(area_with(Block::grasp), out, view_of(segment_));
        return out;
    }
    std::array<std::uint16_t, kSensorSize> sensor(unsigned index) const {
        std::array<std::uint16_t, kSensorSize> out{};
        encode(area_with(Block::sensor), out, view_of(segment_), index);
        return out;
    }
    std::array<std::uint8_t, kInputs> inputs() const {
        std::array<std::uint8_t, kInputs> out{};
        encode_inputs(global(), out);
        return out;
    }
    SegmentWriter writer_;
    Segment segment_;
    tactiled_node node_{};
};

TEST_F(GraspRegisters, TheGlobalBlockHasWeightGripAndSlip) {
    const auto g = global();
    EXPECT_EQ(g[kGripState], TACTILED_GRIP_HOLDING);
    EXPECT_EQ(g[kGripForce], 1234);  // 0.01 N
    EXPECT_EQ(g[kRecGrip], 950);
    EXPECT_EQ(g[kWeight] << 16 | g[kWeight + 1], 71'234);  // 0.1 g
    EXPECT_EQ(g[kWeightG], 7123);
    EXPECT_EQ(g[kWeightSd], 21);
    EXPECT_EQ(g[kWeightState], TACTILED_WEIGHT_STABLE);
    EXPECT_EQ(g[kSlip], 2);
    EXPECT_EQ(g[kSlipLatch], 3);
    EXPECT_EQ(g[kSlipCount], 4);         // wraps
    EXPECT_EQ(g[kStatus] & 0x7C, 0x7C);  // grasped, slip, latched, weight, stable
    EXPECT_EQ(inputs()[kGraspedInput], 1);
    EXPECT_EQ(inputs()[kStableInput], 1);
    EXPECT_EQ(inputs()[kSlipInputs], 1);
    EXPECT_EQ(inputs()[kSlipInputs + 2], 0);
}

TEST_F(GraspRegisters, TheGraspBlockTellsTheObjectAndTheFriction) {
    const auto g = grasp();
    EXPECT_EQ(g[kGraspSeq], g[kGraspSeqEnd]);
    EXPECT_EQ(g[kObjectId], 3);
    EXPECT_EQ(g[kObjectProbability], 987);
    EXPECT_EQ(g[kFriction], 623);
    EXPECT_EQ(g[kFrictionSd], 50);
    EXPECT_EQ(g[kGrasps], 1);  // wraps
    EXPECT_GE(g[kSinceLiftOff], 250);
    EXPECT_LT(g[kSinceLiftOff], 5000);
}

TEST_F(GraspRegisters, TheDoubtsSayWhyAWeightIsNotStableAndOfWhichJaw) {
    std::array<std::uint16_t, kDoubtsSize> d{};
    encode(area_with(Block::doubts), d, view_of(segment_));
    EXPECT_EQ(d[kWeightWhy], 0);
    node_.grasp.weight_doubts = TACTILED_DOUBT_DEAD_SHEAR | TACTILED_DOUBT_LATE;
    node_.grasp.doubtful = 2;
    publish();
    encode(area_with(Block::doubts), d, view_of(segment_));
    EXPECT_EQ(d[kWeightWhy], 0x84);
    EXPECT_EQ(d[kWeightJaws], 2);
    EXPECT_EQ(d[kDoubtsSeq], d[kDoubtsSeqEnd]);
    encode(area_with(Block::doubts), d, view_of_nothing());
    EXPECT_EQ(d[kWeightWhy], 0);
}

TEST_F(GraspRegisters, WithoutAToolItsWrenchIsNotAvailable) {
    std::array<std::uint16_t, kToolSize> t{};
    encode(area_with(Block::tool), t, view_of(segment_));
    EXPECT_EQ(t[kToolStatus], 1u << 15);
    for (unsigned i = 0; i < 6; ++i) {
        EXPECT_EQ(t[kToolForce + i], kNoI16);
        EXPECT_EQ(t[kToolSdForce + i], kNoU16);
    }
    EXPECT_EQ(t[kToolAgeMs], kNoU16);
    EXPECT_EQ(t[kToolMass], kNoU16);
}

TEST(ToolRegisters, ShowTheWrenchItsDeviationAndWhyThereIsNone) {
    View view = view_of_nothing();
    tactiled_tool& tool = view.snapshot.node.tool;
    view.snapshot.node.sequence = 77;
    tool.t_ns = view.snapshot.taken_ns - 12'000'000;
    tool.quality = tool.sensor_quality[1] = TACTILED_UNCERTAIN;
    tool.why = TACTILED_TOOL_DOUBTED | TACTILED_TOOL_MOVES;
    tool.sensors = 3;
    tool.bad = 0;
    tool.mass_kg = 0.8f;
    for (int k = 0; k < 3; ++k) {
        tool.force_G_N[k] = 1.5 - 2 * k;
        tool.torque_G_Nm[k] = 0.02 * k;
        tool.sd_force_N[k] = 0.07;
        tool.sd_torque_Nm[k] = 0.003;
        tool.sensor_force_G_N[1][k] = float(k);
    }
    tool.force_G_N[2] = -400;
    std::array<std::uint16_t, kToolSize> t{};
    encode(area_with(Block::tool), t, view);
    EXPECT_EQ(t[kToolSeq], 77);
    EXPECT_EQ(t[kToolSeqEnd], 77);
    EXPECT_EQ(t[kToolStatus], TACTILED_TOOL_DOUBTED | TACTILED_TOOL_MOVES | 1u << 9 | 1u << 10);
    EXPECT_EQ(t[kToolForce], 150);
    EXPECT_EQ(std::int16_t(t[kToolForce + 1]), -50);
    EXPECT_EQ(std::int16_t(t[kToolForce + 2]), -32767);  // saturates
    EXPECT_EQ(t[kToolTorque + 2], 40);
    EXPECT_EQ(t[kToolSdForce], 7);
    EXPECT_EQ(t[kToolSdTorque], 3);
    EXPECT_EQ(t[kToolSensors], 3);
    EXPECT_EQ(t[kToolAgeMs], 12);
    EXPECT_EQ(t[kToolMass], 800);
    std::array<std::uint16_t, kToolFloatSize> f{};
    encode(area_with(Block::tool_floats), f, view);
    EXPECT_EQ(f[kToolFloatForce], std::bit_cast<std::uint32_t>(1.5f) >> 16);
    encode(area_with(Block::tool_sensors, true), f, view, 1);
    EXPECT_EQ(f[kToolFloatStatus], 1u << 15);  // there is no segment, and so no sensor
    tool.quality = TACTILED_BAD;               // whatever its numbers are
    tool.why = TACTILED_TOOL_GRAVITY;
    encode(area_with(Block::tool), t, view);
    EXPECT_EQ(t[kToolStatus], TACTILED_TOOL_GRAVITY | 1u << 15);
    for (unsigned i = 0; i < 6; ++i) EXPECT_EQ(t[kToolForce + i], kNoI16);
}

TEST_F(GraspRegisters, ASensorBlockTellsItsOwnSlip) {
    EXPECT_EQ(sensor(0)[kSensorStatus] >> 2 & 3, 1);  // incipient
    EXPECT_EQ(sensor(1)[kSensorStatus] >> 2 & 3, 2);  // gross
    EXPECT_EQ(sensor(1)[kSlipState], TACTILED_SLIP_GROSS);
    EXPECT_EQ(sensor(1)[kSensorSlipCount], 42);
    EXPECT_EQ(sensor(1)[kFrictionUse], 915);
    EXPECT_EQ(sensor(0)[kFrictionUse], kNoU16);
    EXPECT_EQ(sensor(5)[kSlipState], kNoU16);  // no such sensor
}

TEST_F(GraspRegisters, FloatsAreInSi) {
    std::array<std::uint16_t, kFloatSize> high{}, low{};
    encode(area_with(Block::floats), high, view_of(segment_));
    encode(area_with(Block::floats, true), low, view_of(segment_));
    const auto f32 = [&](unsigned at) { return std::bit_cast<float>(std::uint32_t(high[at]) << 16 | high[at + 1]); };
    EXPECT_EQ(f32(kFloatWeight), 7.12345f);
    EXPECT_EQ(f32(kFloatWeightSd), 0.0021f);
    EXPECT_EQ(f32(kFloatGrip), 12.34f);
    EXPECT_EQ(f32(kFloatRecGrip), 9.5f);
    EXPECT_EQ(f32(kFloatFriction), 0.623f);
    EXPECT_EQ(f32(kFloatFrictionSd), 0.05f);
    EXPECT_EQ(f32(kFloatObjectProbability), 0.987f);
    EXPECT_EQ(high[kFloatWeight], low[kFloatWeight + 1]);
}

TEST_F(GraspRegisters, WhatIsNotKnownIsASentinelAndNeverZero) {
    tactiled_forget_grasp(&node_.grasp);
    publish();
    const auto g = global();
    EXPECT_EQ(g[kGripState], kNoU16);
    for (const auto at : {kGripForce, kRecGrip, kWeightG, kWeightSd}) EXPECT_EQ(g[at], kNoU16) << at;
    EXPECT_EQ(std::uint32_t(g[kWeight]) << 16 | g[kWeight + 1], kNoI32);
    EXPECT_EQ(g[kStatus] & 0x6C, 0);
    EXPECT_EQ(g[kSlipLatch], 3);  // the slip is latched
    EXPECT_EQ(grasp()[kObjectProbability], kNoU16);
    EXPECT_EQ(grasp()[kSinceLiftOff], kNoU16);
}

TEST_F(GraspRegisters, AWeightThatOverloadsOrCannotBeSeenHasNoNumber) {
    for (const auto state : {TACTILED_WEIGHT_OVERLOAD, TACTILED_WEIGHT_NOT_OBSERVABLE, TACTILED_WEIGHT_NONE}) {
        node_.grasp.weight_state = std::uint32_t(state);
        publish();
        EXPECT_EQ(std::uint32_t(global()[kWeight]) << 16 | global()[kWeight + 1], kNoI32);
        EXPECT_EQ(global()[kStatus] & 1u << 5, 0u);
    }
}

TEST_F(GraspRegisters, AGraspOfALoopThatStandsIsNotKnown) {
    ::usleep(300'000);  // longer than watchdog_ms
    EXPECT_EQ(global()[kGripState], kNoU16);
    EXPECT_EQ(std::uint32_t(global()[kWeight]) << 16 | global()[kWeight + 1], kNoI32);
    EXPECT_EQ(global()[kStatus] & 1u << 2, 0u);
    EXPECT_EQ(sensor(1)[kSlipState], kNoU16);
}

TEST_F(GraspRegisters, AWeightBelowZeroIsOneInTheRegisterThatHasASign) {
    node_.grasp.weight_kg = -0.0123;
    publish();
    EXPECT_EQ(std::int32_t(std::uint32_t(global()[kWeight]) << 16 | global()[kWeight + 1]), -123);
    EXPECT_EQ(global()[kWeightG], 0);
}

TEST(GraspRegistersWithoutASegment, AreSentinels) {
    std::array<std::uint16_t, kGlobalSize> global{};
    encode(area_with(Block::global), global, view_of_nothing());
    EXPECT_EQ(global[kGripState], kNoU16);
    EXPECT_EQ(global[kWeightG], kNoU16);
    EXPECT_EQ(global[kStatus] & 0x7C, 0);
}

TEST(Registers, AThirtyTwoBitWeightSaturatesAndNeverWraps) {
    EXPECT_EQ(i32_of(1e300, 1e-4), 0x7FFFFFFFu);
    EXPECT_EQ(i32_of(-1e300, 1e-4), 0x80000001u);
    EXPECT_EQ(i32_of(std::numeric_limits<double>::quiet_NaN(), 1e-4), kNoI32);
    EXPECT_EQ(std::int32_t(i32_of(-0.00005, 1e-4)), 0);  // halves to even
}

}  // namespace
}  // namespace tactiled::modbus
