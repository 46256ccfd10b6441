// From a snapshot to registers, and the table that says where.
#include "node/modbus/encode.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <set>
#include <string>

namespace tactiled::modbus {
namespace {

// Version 1.0 of the map is a promise: these addresses never move.
TEST(RegisterMap, AddressesOfVersion1StayWhereTheyAre) {
    const std::pair<const char*, int> global[] = {
        {"MAGIC0", 0}, {"MAGIC1", 1}, {"MAP_VER", 2}, {"N_SENSORS", 3}, {"SEQ", 4}, {"HEARTBEAT", 5}, {"AGE_MS", 6}, {"STATUS", 7},
        {"FAULT", 8}, {"WARN", 9}, {"OK", 10}, {"CONTACT", 11}, {"SLIP", 12}, {"SLIP_LATCH", 13}, {"OVERLOAD", 14}, {"STALE", 15},
        {"GRIP_FORCE", 16}, {"GRIP_STATE", 17}, {"WEIGHT_G", 18}, {"WEIGHT_STATE", 19}, {"WEIGHT", 20}, {"WEIGHT_SD", 22}, {"REC_GRIP", 23},
        {"SLIP_COUNT", 24}, {"CMD_SEQ_ACK", 25}, {"CMD_STATE", 26}, {"CMD_RESULT", 27}, {"CAL_ID", 28}, {"PLC_HB_ECHO", 29},
        {"CYCLE_WORST", 30}, {"SEQ_END", 31}};
    const std::pair<const char*, int> sensor[] = {
        {"SEQ", 0}, {"STATUS", 1}, {"FAULT", 2}, {"AGE_MS", 3}, {"FX", 4}, {"FY", 5}, {"FZ", 6}, {"TX", 7}, {"TY", 8}, {"TZ", 9},
        {"F_TANG", 10}, {"F_MAG", 11}, {"COP_X", 12}, {"COP_Y", 13}, {"FRICTION_USE", 14}, {"SLIP_STATE", 15}, {"SLIP_COUNT", 16},
        {"PEAK", 17}, {"TEMP", 18}, {"SCALE", 19}, {"TARE_COUNT", 20}, {"RATE", 21}, {"LOST", 22}, {"RAW_STATE", 23}, {"SEQ_END", 24}};
    const auto same = [](auto registers, const auto& expected) {
        ASSERT_EQ(registers.size(), std::size(expected));
        for (std::size_t i = 0; i < registers.size(); ++i) {
            EXPECT_EQ(registers[i].name, expected[i].first);
            EXPECT_EQ(registers[i].at, expected[i].second) << registers[i].name;
        }
    };
    same(global_registers(), global);
    same(sensor_registers(), sensor);
    EXPECT_EQ(kSensorsAt, 100);
    EXPECT_EQ(kSensorSize, 25);
    EXPECT_EQ(kConstantsAt, 9000);
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
    EXPECT_EQ(area_of(65535, 125), nullptr);  // does not wrap
}

TEST(RegisterMap, EverySensorReasonHasItsOwnFaultNumber) {
    std::set<std::uint16_t> numbers;
    for (int bit = 0; bit <= 13; ++bit) {
        if (1 << bit == TACTILED_TARING) continue;  // no weakness of the value
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
        if (i % 2 == 0) value = double(std::int64_t(bits)) / 9e15;  // half of them where registers live: +-1000 N
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
    encode_global(view, global);
    EXPECT_EQ(global[kMagic0], 0x5441);
    EXPECT_EQ(global[kOk], 0);
    EXPECT_EQ(global[kStatus] & TACTILED_READY, 0);
    EXPECT_NE(global[kStatus] & TACTILED_FAULT, 0);
    EXPECT_EQ(global[kAgeMs], 65534);
    EXPECT_EQ(global[kWeight] << 16 | global[kWeight + 1], int(kNoI32));
    for (unsigned i = 0; i < kSensorBlocks; ++i) {
        std::array<std::uint16_t, kSensorSize> sensor{};
        encode_sensor(view, i, sensor);
        for (unsigned at = kFx; at <= kTz; ++at) EXPECT_EQ(sensor[at], kNoI16);
        EXPECT_EQ(sensor[kFMag], kNoU16);
        EXPECT_EQ(sensor[kSensorStatus], 1u << 15 | 1u << 6);  // fault, stale
    }
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

}  // namespace
}  // namespace tactiled::modbus
