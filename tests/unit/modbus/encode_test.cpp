// Converts a snapshot to registers, and tests the table of their places.
#include "node/modbus/encode.hpp"

#include <gtest/gtest.h>

#include <unistd.h>
#include <bit>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <set>
#include <string>

#include "node/shm/writer.hpp"
#include "tests/unit/modbus/cells.hpp"

namespace tactiled::modbus {
namespace {

TEST(RegisterMap, NoTwoRegistersShareACellAndEachLiesInItsArea) {
    std::set<unsigned> cells;
    for (const Area& area : areas())
        for (const Register& r : area.registers) {
            const bool offset = area.at != 0 && r.at < area.at;
            const unsigned size = r.type == Type::i32 || r.type == Type::f32 || r.name == "CONST_TEXT" ? 2 : 1;
            for (unsigned i = 0; i < size; ++i) {
                const unsigned at = (offset ? area.at + r.at : r.at) + i;
                EXPECT_TRUE(cells.insert(at).second) << r.name;
                EXPECT_EQ(area_of(at, 1), &area) << r.name;
                EXPECT_LT(offset && area.repeats != 0 ? r.at + i : 0u, std::max<unsigned>(area.repeats, 1)) << r.name;
            }
        }
}

TEST(RegisterMap, EveryRowHasAValueThatIsEncodedOrAWordThatIsKept) {
    for (const Area& area : areas())
        for (const Register& r : area.registers) {
            const bool kept = area.block == Block::controls || area.block == Block::constants || area.block == Block::pages;
            EXPECT_EQ(r.value.of == nullptr, kept) << area.prefix << "." << r.name;
            EXPECT_EQ(r.is_writable(), area.block == Block::controls) << area.prefix << "." << r.name;
        }
}

TEST(RegisterMap, AreasHoldWholeRequestsOnly) {
    EXPECT_NE(area_of(0, 32), nullptr);
    EXPECT_EQ(area_of(0, 33), nullptr);
    EXPECT_EQ(area_of(31, 2), nullptr);
    EXPECT_EQ(area_of(32, 1), nullptr);
    EXPECT_EQ(area_of(99, 2), nullptr);
    EXPECT_NE(area_of(100, 125), nullptr);
    EXPECT_NE(area_of(499, 1), nullptr);
    EXPECT_EQ(area_of(500, 1), nullptr);
    EXPECT_NE(area_of(9011, 1), nullptr);
    EXPECT_EQ(area_of(9099, 1), nullptr);
    EXPECT_NE(area_of(9100, 16), nullptr);
    EXPECT_EQ(area_of(9116, 1), nullptr);
    EXPECT_NE(area_of(11000, 125), nullptr);
    EXPECT_EQ(area_of(11001, 125), nullptr);
    EXPECT_EQ(area_of(65535, 125), nullptr);  // does not wrap
    EXPECT_NE(area_of(2100, 125), nullptr);
    EXPECT_EQ(area_of(2026, 1), nullptr);
    EXPECT_NE(area_of(60, 20), nullptr);
    EXPECT_NE(area_of(2030, 28), nullptr);
    EXPECT_NE(area_of(2500, 112), nullptr);  // four sensors at once
    EXPECT_EQ(area_of(2948, 1), nullptr);
    EXPECT_EQ(area_of(5090, 20), nullptr);  // from the controls into scratch
}

TEST(RegisterMap, AreasAreInTheOrderOfTheirAddressesAndShareNone) {
    const auto all = areas();
    for (std::size_t i = 1; i < all.size(); ++i) EXPECT_GE(all[i].at, all[i - 1].at + all[i - 1].size) << all[i].title;
    for (std::uint32_t at = 0; at < 30'000; at += 7)
        for (const std::uint32_t count : {1u, 2u, 33u, 125u}) {
            std::size_t touched = 0;
            for (const Area& area : all) touched += at < std::uint32_t(area.at) + area.size && area.at < at + count ? 1 : 0;
            const auto found = areas_in(at, count);
            ASSERT_EQ(found.size(), touched) << at << " + " << count;
            for (const Area& area : found) ASSERT_TRUE(at < std::uint32_t(area.at) + area.size && area.at < at + count);
        }
}

TEST(RegisterMap, ACopyIsOfACellThatHasARow) {
    for (const Area& area : areas())
        for (const Copy& copy : area.copies)
            for (unsigned i = 0; i < copy.count; ++i) {
                const auto at = std::uint16_t(area.at + copy.at + i);
                EXPECT_EQ(origin_of(at), copy.from + i);
                const Area* const origin = area_of(copy.from + i, 1);
                ASSERT_NE(origin, nullptr) << at;
                EXPECT_TRUE(origin->copies.empty()) << "a copy of a copy";
                EXPECT_EQ(writable_at(at), writable_at(copy.from + i)) << at;
            }
    EXPECT_EQ(origin_of(5300), 5000);
    EXPECT_EQ(origin_of(5305), 5020);
    EXPECT_EQ(origin_of(5306), 5022);
    EXPECT_EQ(origin_of(5308), 5040);
    EXPECT_EQ(origin_of(5314), 5046);
    EXPECT_EQ(origin_of(650), 61);
    EXPECT_EQ(origin_of(695), 126);
    EXPECT_EQ(origin_of(724), 724);
    EXPECT_EQ(origin_of(0), 0);
}

TEST(RegisterMap, EverySensorReasonHasItsOwnFaultNumber) {
    std::set<std::uint16_t> numbers;
    for (int bit = 0; bit <= 19; ++bit) {
        if ((1 << bit & (TACTILED_TARING | TACTILED_WRONG_RATE | TACTILED_DRIFTED)) != 0)
            continue;  // not a weakness of the value
        const auto fault = fault_of(1u << bit);
        EXPECT_NE(fault, 0) << bit;
        EXPECT_TRUE(numbers.insert(fault).second) << bit;
    }
    EXPECT_EQ(fault_of(0), 0);
    EXPECT_EQ(fault_of(TACTILED_STALE | TACTILED_SATURATED), fault_of(TACTILED_STALE));
}

TEST(Registers, AnyDoubleSaturatesOrIsNotAvailableAndNeverWraps) {
    std::mt19937_64 random(5);
    for (int i = 0; i < 1'000'000; ++i) {
        const std::uint64_t bits = random();
        double value;
        std::memcpy(&value, &bits, sizeof value);
        if (i % 2 == 0) value = double(std::int64_t(bits)) / 9e15;  // half of them in the range of registers: +-1000 N
        bool saturated = false;
        const auto got = std::int16_t(i16_of(value, 0.01, saturated));
        if (std::isnan(value)) {
            EXPECT_EQ(std::uint16_t(got), kNoI16);
        } else if (std::abs(value) >= 327.675) {
            EXPECT_EQ(got, value > 0 ? 32767 : -32767);
            EXPECT_TRUE(saturated || std::abs(value) < 327.68);
        } else {
            ASSERT_NEAR(got * 0.01, value, 0.005 + 1e-9);  // N: half a step
            EXPECT_FALSE(saturated);
        }
        saturated = false;
        const auto magnitude = u16_of(value, 0.01, saturated);
        if (std::isnan(value))
            EXPECT_EQ(magnitude, kNoU16);
        else
            EXPECT_NE(magnitude, kNoU16);
    }
}

TEST(Registers, HalvesGoToEven) {
    bool saturated = false;
    EXPECT_EQ(i16_of(0.5, 1, saturated), 0);
    EXPECT_EQ(i16_of(1.5, 1, saturated), 2);
    EXPECT_EQ(std::int16_t(i16_of(-2.5, 1, saturated)), -2);
}

TEST(Registers, WithoutASegmentEveryValueIsASentinel) {
    const View view = view_of_nothing();
    std::array<std::uint16_t, kGlobalSize> global{};
    encode(area_with(Block::global), global, view);
    EXPECT_EQ(global[kMagic0], 0x5441);
    EXPECT_EQ(global[kOk], 0);
    EXPECT_EQ(global[kStatus] & TACTILED_READY, 0);
    EXPECT_NE(global[kStatus] & TACTILED_FAULT, 0);
    EXPECT_EQ(global[kAgeMs], 65534);
    EXPECT_EQ(global[kWeight] << 16 | global[kWeight + 1], int(kNoI32));
    for (unsigned i = 0; i < kSensorBlocks; ++i) {
        std::array<std::uint16_t, kSensorSize> sensor{};
        encode(area_with(Block::sensor), sensor, view, i);
        for (unsigned at = kFx; at <= kTz; ++at) EXPECT_EQ(sensor[at], kNoI16);
        EXPECT_EQ(sensor[kFMag], kNoU16);
        EXPECT_EQ(sensor[kSensorStatus], 1u << 15 | 1u << 6);  // fault, stale
    }
}

// A live segment with one sensor, and what a PLC reads from it.
class LiveRegisters : public testing::Test {
protected:
    LiveRegisters() : writer_(plan()) {
        writer_.set_state(TACTILED_RUNNING);
        segment_ = Segment::open(plan().name);
    }
    static SegmentPlan plan() {
        SegmentPlan p;
        p.name = "encode-test-" + std::to_string(::getpid());
        p.history = 64;
        p.sensors.resize(1);
        p.sensors[0].stale_ms = 50;
        return p;
    }
    static tactiled_sample good() {
        tactiled_sample s{};
        s.t_ns = monotonic_ns();
        s.quality = TACTILED_GOOD;
        s.temperature_C = 25;
        s.rate_Hz = 1000;
        return s;
    }
    void publish(tactiled_sample s) {
        tactiled_placed placed{};
        placed.sample = s;
        publish(placed);
    }
    void publish(tactiled_placed placed) {
        placed.sample.sequence = number_;
        writer_.publish(0, placed);
        tactiled_node node{};
        node.sequence = number_++;
        node.t_ns = monotonic_ns();
        node.status = TACTILED_READY | TACTILED_ANY_TARING;
        node.worst_cycle_us = 42;
        node.count[0] = number_;
        writer_.publish(node);
    }
    std::array<std::uint16_t, kSensorSize> sensor(unsigned index = 0) const {
        std::array<std::uint16_t, kSensorSize> out{};
        encode(area_with(Block::sensor), out, view_of(segment_), index);
        return out;
    }
    std::array<std::uint16_t, kGlobalSize> global() const {
        std::array<std::uint16_t, kGlobalSize> out{};
        encode(area_with(Block::global), out, view_of(segment_));
        return out;
    }
    SegmentWriter writer_;
    Segment segment_;
    std::uint64_t number_ = 0;
};

TEST_F(LiveRegisters, AStaleSensorShowsNothingOld) {
    publish(good());
    ::usleep(80'000);
    const auto s = sensor();
    EXPECT_EQ(s[kFx], kNoI16);
    EXPECT_EQ(s[kTemp], kNoI16);
    EXPECT_EQ(s[kRate], kNoU16);
}

TEST_F(LiveRegisters, ADeadLoopShowsNothingOfWhatItsSensorsDid) {
    auto busy = good();
    busy.reasons = TACTILED_TARING | TACTILED_SATURATED;
    publish(busy);
    ::usleep(300'000);  // longer than watchdog_ms
    EXPECT_EQ(sensor()[kSensorStatus] & (1u << 7 | 1u << 5), 0u);
    EXPECT_EQ(sensor()[kSensorFault], fault_of(TACTILED_DAEMON_STOPPED));
    EXPECT_EQ(global()[kStatus] & TACTILED_ANY_TARING, 0);
    EXPECT_EQ(global()[kOverload], 0);
    EXPECT_EQ(global()[kCycleWorst], kNoU16);
}

TEST_F(LiveRegisters, TheBoundOfAnAgeIsRoundedUpToMilliseconds) {
    const auto bound = [&](const View& view, unsigned sensor) {
        std::uint16_t out = 0;
        encode(area_with(Block::age_bounds), {&out, 1}, view, sensor);
        return out;
    };
    publish(good());
    EXPECT_EQ(bound(view_of(segment_), 0), 65534) << "no frame yet";
    for (const auto& [bound_ns, ms] : {std::pair{12.0e6, 12}, {12.1e6, 13}, {0.0, 0}, {65'533.5e6, 65534}, {1e15, 65534}}) {
        writer_.set_age(0, TACTILED_BY_CLOCK, bound_ns);
        EXPECT_EQ(bound(view_of(segment_), 0), ms) << bound_ns;
    }
    EXPECT_EQ(bound(view_of(segment_), 1), kNoU16) << "no such sensor";
    EXPECT_EQ(bound(view_of_nothing(), 0), kNoU16);
}

TEST_F(LiveRegisters, StandardDeviationsOfEachComponentAndOfTheMagnitude) {
    const auto sds = [&](unsigned index) {
        std::array<std::uint16_t, kSensorSdSize> out{};
        encode(area_with(Block::sensor_sds), out, view_of(segment_), index);
        return out;
    };
    const auto number = [](const auto& cells, std::size_t at) {
        return std::bit_cast<float>(std::uint32_t(cells[at]) << 16 | cells[at + 1]);
    };
    tactiled_placed placed{};
    placed.sample = good();
    placed.sample.force_S_N[0] = 0, placed.sample.force_S_N[1] = 3, placed.sample.force_S_N[2] = -4;
    for (int c = 0; c < 3; ++c) {
        placed.sample.sd_force_N[c] = 0.1 * (c + 1);
        placed.budget.sd_part[TACTILED_OF_ZERO][c] = float(0.1 * (c + 1));
    }
    placed.budget.correlation[5] = 0.5f;  // fy fz
    publish(placed);
    const auto out = sds(0);
    EXPECT_FLOAT_EQ(number(out, 2), 0.1f);
    EXPECT_FLOAT_EQ(number(out, 6), 0.3f);
    EXPECT_NEAR(number(out, 14), std::sqrt(0.6 * 0.6 * 0.04 + 0.8 * 0.8 * 0.09 - 2 * 0.6 * 0.8 * 0.5 * 0.06), 2e-3);
    EXPECT_NEAR(number(out, 16), 5 + 1.96 * double(number(out, 14)), 1e-5);
    EXPECT_EQ(out[18], TACTILED_OF_ZERO);

    placed.sample.force_S_N[1] = placed.sample.force_S_N[2] = 0;  // below 3 sd: a bound
    publish(placed);
    EXPECT_TRUE(std::isnan(number(sds(0), 14)));
    EXPECT_NEAR(number(sds(0), 16), 1.96 * std::sqrt(0.01 + 0.04 + 0.09), 1e-5);

    placed.sample.quality = TACTILED_BAD;
    tactiled_invalidate(&placed.sample, TACTILED_STALE);
    publish(placed);
    EXPECT_TRUE(std::isnan(number(sds(0), 2)) && std::isnan(number(sds(0), 16)));
    EXPECT_EQ(sds(0)[18], kNoU16);
    EXPECT_TRUE(std::isnan(number(sds(1), 2))) << "no such sensor";
    EXPECT_EQ(sds(1)[18], kNoU16);
}

TEST_F(LiveRegisters, ASampleWithoutAValueIsNotZeroNewton) {
    auto none = good();
    none.quality = TACTILED_NO_VALUE;
    publish(none);
    EXPECT_EQ(sensor()[kFx], kNoI16);
}

TEST_F(LiveRegisters, ForcesBeyondTheRegisterAreSaid) {
    auto heavy = good();
    heavy.force_S_N[2] = -400;
    publish(heavy);
    EXPECT_EQ(std::int16_t(sensor()[kFz]), -32767);
    EXPECT_NE(sensor()[kSensorStatus] & 1u << 4, 0u);
    EXPECT_EQ(global()[kOverload], 1);
    EXPECT_NE(global()[kStatus] & 1u << 7, 0u);
}

TEST_F(LiveRegisters, ARegisterOfTheWrenchAtTheEndOfItsRangeIsAnOverloadAndAPeakIsNot) {
    const auto overload = [&](const tactiled_sample& s) {
        publish(s);
        EXPECT_EQ((sensor()[kSensorStatus] & 1u << 4) != 0, global()[kOverload] == 1);
        return global()[kOverload] == 1;
    };
    for (int axis = 0; axis < 3; ++axis) {
        auto torque = good(), centre = good();
        torque.torque_S_Nm[axis] = 32.8;  // Nm, of 32.767
        EXPECT_TRUE(overload(torque)) << axis;
        if (axis == 2) break;
        centre.cop_S_m[axis] = -0.328;  // m, of 0.32767
        EXPECT_TRUE(overload(centre)) << axis;
    }
    auto others = good();
    others.peak_N = 700;  // of 655.34
    others.temperature_C = 4000;
    others.rate_Hz = 1e5;
    EXPECT_FALSE(overload(others));
    EXPECT_EQ(sensor()[kPeak], 65534);
    EXPECT_EQ(sensor()[kTemp], 32767);
}

TEST_F(LiveRegisters, ASmallSensorHasSmallerCountsAndItsScaleSaysSo) {
    auto s = good();
    const double force[] = {0.0321, -0.04, -0.34};
    std::copy_n(force, 3, s.force_S_N);
    s.peak_N = 0.341f;
    publish(s);
    EXPECT_EQ(std::int16_t(sensor()[kFz]), -34);  // 0.01 N, unless configured
    EXPECT_EQ(std::int16_t(sensor()[kScale]), -2);
    std::array<int, kSensorBlocks> scales;
    scales.fill(-2);
    scales[0] = -4;
    View view = view_of(segment_);
    view.force_scales = &scales;
    std::array<std::uint16_t, kSensorSize> out{};
    encode(area_with(Block::sensor), out, view, 0);
    EXPECT_EQ(std::int16_t(out[kScale]), -4);
    EXPECT_EQ(std::int16_t(out[kFx]), 321);
    EXPECT_EQ(std::int16_t(out[kFy]), -400);
    EXPECT_EQ(std::int16_t(out[kFz]), -3400);
    EXPECT_EQ(out[kFTang], 513);
    EXPECT_EQ(out[kFMag], 3438);
    EXPECT_EQ(out[kPeak], 3410);
    EXPECT_EQ(out[kTx], sensor()[kTx]);  // torques have no other count
    // The range of the register ends earlier, and both the block and the node report it.
    s.force_S_N[2] = -3.4;
    publish(s);
    view = view_of(segment_);
    view.force_scales = &scales;
    encode(area_with(Block::sensor), out, view, 0);
    EXPECT_EQ(std::int16_t(out[kFz]), -32767);
    EXPECT_NE(out[kSensorStatus] & 1u << 4, 0u);
    std::array<std::uint16_t, kGlobalSize> all{};
    encode(area_with(Block::global), all, view);
    EXPECT_EQ(all[kOverload], 1);
    EXPECT_EQ(global()[kOverload], 0);
}

TEST_F(LiveRegisters, FloatsAreTheForcesInBothWordOrders) {
    auto s = good();
    const double force[] = {1234.5, -0.001, -12.25};
    std::copy_n(force, 3, s.force_S_N);
    s.torque_S_Nm[2] = std::numeric_limits<double>::quiet_NaN();
    s.cop_S_m[0] = 1e300;
    publish(s);
    std::array<std::uint16_t, kSensorFloatSize> high{}, low{};
    const View view = view_of(segment_);
    encode(area_with(Block::sensor_floats), high, view, 0);
    encode(area_with(Block::sensor_floats, true), low, view, 0);
    EXPECT_EQ(high[kFloatForce], 0x449A);  // 1234.5 = 449A 5000
    EXPECT_EQ(high[kFloatForce + 1], 0x5000);
    for (unsigned at = kFloatForce; at < kFloatSensorSeqEnd; at += 2) {
        EXPECT_EQ(high[at], low[at + 1]) << at;
        EXPECT_EQ(high[at + 1], low[at]) << at;
    }
    EXPECT_EQ(high[kFloatTorque + 4], 0x7FC0);  // NaN
    EXPECT_EQ(high[kFloatCop], 0x7FC0);         // beyond float32: no infinity
    EXPECT_EQ(high[kFloatSensorSeq], high[kFloatSensorSeqEnd]);
    EXPECT_EQ(high[kFloatStatus], sensor()[kSensorStatus]);
    encode(area_with(Block::sensor_floats), high, view, 5);  // no such sensor
    EXPECT_EQ(high[kFloatForce], 0x7FC0);
}

TEST_F(LiveRegisters, ContactOverloadAndPeakAreShown) {
    auto s = good();
    s.state = TACTILED_CONTACT | TACTILED_OVERLOAD | TACTILED_LOW_PASS;
    s.peak_N = 7.25f;
    publish(s);
    EXPECT_EQ(sensor()[kSensorStatus] & (1u << 1 | 1u << 4 | 1u << 10), 1u << 1 | 1u << 4 | 1u << 10);
    EXPECT_EQ(sensor()[kPeak], 725);
    EXPECT_EQ(global()[kContact], 1);
    EXPECT_EQ(global()[kOverload], 1);
    std::array<std::uint8_t, kInputs> inputs{};
    encode_inputs(global(), inputs);
    EXPECT_EQ(inputs[kContactInputs], 1);
    EXPECT_EQ(inputs[kOkInputs], 1);
    EXPECT_EQ(inputs[kOverloadInputs], 1);
    EXPECT_EQ(inputs[kContactInputs + 1], 0);
    ::usleep(80'000);  // stale: the past value must not seem present
    EXPECT_EQ(global()[kContact], 0);
}

TEST_F(LiveRegisters, FaultIsZeroForAGoodValueAndForNoOther) {
    auto s = good();
    s.reasons = TACTILED_UNKNOWN_UNCERTAINTY;
    publish(s);
    EXPECT_EQ(sensor()[kSensorFault], 0);
    s.quality = TACTILED_UNCERTAIN;
    s.reasons = 1u << 31;  // a reason of a later version
    publish(s);
    EXPECT_EQ(sensor()[kSensorFault], kFaultUnknown);
    EXPECT_EQ(sensor(3)[kSensorFault], kFaultNoSensor);
}

TEST(Registers, NoFrameEverIsNotAsYoungAsTheMachine) {
    View view = view_of_nothing();
    view.snapshot.taken_ns = 5'000'000'000u;
    std::array<std::uint16_t, kGlobalSize> global{};
    encode(area_with(Block::global), global, view);
    EXPECT_EQ(global[kAgeMs], 65534);
}

TEST(Registers, ConstantsAreWhatTheMapSays) {
    const auto c = constants();
    EXPECT_EQ(std::int16_t(c[1]), -1234);
    const auto f32 = [&](unsigned high, unsigned low) {
        const std::uint32_t bits = std::uint32_t(c[high]) << 16 | c[low];
        float value;
        std::memcpy(&value, &bits, 4);
        return value;
    };
    EXPECT_EQ(f32(4, 5), 1234.5f);
    EXPECT_EQ(f32(7, 6), 1234.5f);
    std::string text;
    for (unsigned i = 8; i < 12; ++i) text += {char(c[i] >> 8), char(c[i] & 255)};
    EXPECT_EQ(text, "ABCDEFGH");
}

TEST_F(LiveRegisters, ASampleNewerThanTheSnapshotIsOfAgeZero) {
    auto s = good();
    s.t_ns += 1'000'000'000;
    publish(s);
    EXPECT_EQ(sensor()[kSensorAgeMs], 0);
    EXPECT_EQ(global()[kAgeMs], 0);
}

TEST_F(LiveRegisters, ADeadLoopIsSimulatedAllTheSame) {
    tactiled_node node{};
    node.t_ns = monotonic_ns();
    node.status = TACTILED_READY | TACTILED_SIMULATED | TACTILED_ANY_UNCALIBRATED | TACTILED_WARNING;
    node.count[0] = 1;
    writer_.publish(0, good());
    writer_.publish(node);
    ::usleep(300'000);  // longer than watchdog_ms
    EXPECT_EQ(global()[kStatus],
              TACTILED_SIMULATED | TACTILED_ANY_UNCALIBRATED | TACTILED_WARNING | TACTILED_FAULT | TACTILED_ANY_STALE);
}

TEST_F(LiveRegisters, ANodeWithAStaleSensorIsNotReady) {
    publish(good());
    EXPECT_EQ(global()[kStatus] & (TACTILED_READY | TACTILED_ANY_STALE), TACTILED_READY);
    ::usleep(80'000);  // the loop runs, its sensor is silent
    EXPECT_EQ(global()[kStatus] & (TACTILED_READY | TACTILED_ANY_STALE), TACTILED_ANY_STALE);
    EXPECT_EQ(global()[kStale], 1);
}

TEST_F(LiveRegisters, EachCellIsItsOwnField) {
    auto s = good();
    s.cop_S_m[0] = 0.001;
    s.cop_S_m[1] = -0.002;
    s.tare_count = 3;
    s.missing = 1u << 2;
    s.saturated = 1u << 4;
    s.lost = 9;
    publish(s);
    EXPECT_EQ(std::int16_t(sensor()[kCopX]), 100);  // 0.01 mm
    EXPECT_EQ(std::int16_t(sensor()[kCopY]), -200);
    EXPECT_EQ(sensor()[kTareCount], 3);
    EXPECT_EQ(sensor()[kSensorStatus], 1u << 0 | 1u << 8);  // good, tared
    EXPECT_EQ(sensor()[kRawState], 1u << 2 | 1u << 4);
    EXPECT_EQ(sensor()[kLost], 9);
}

TEST(Registers, TheBlinkingInputChangesEachSecond) {
    std::array<std::uint16_t, kGlobalSize> global{};
    std::array<std::uint8_t, kInputs> inputs{};
    for (std::uint16_t beat = 0; beat < 40; ++beat) {
        global[kHeartbeat] = beat;  // 10 per second
        encode_inputs(global, inputs);
        EXPECT_EQ(inputs[kBlinkInput], beat / 10 % 2) << beat;
    }
}

}  // namespace
}  // namespace tactiled::modbus
