// Signals of CAN messages: published examples of the DBC numbering, and a bit-by-bit encoder.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "drivers/wire/can_signal.hpp"
#include "tests/unit/drivers/can_encode.hpp"

namespace tactiled {
namespace {

using Order = CanSignal::Order;
using Type = CanSignal::Type;
using Bytes = std::array<std::uint8_t, 8>;

CanSignal signal(unsigned start, unsigned length, Order order, Type type, double factor = 1, double offset = 0) {
    CanSignal s;
    s.start = start;
    s.length = length;
    s.order = order;
    s.type = type;
    s.factor = factor;
    s.offset = offset;
    return s;
}

// cantools' README: message 0x1F0 of motohawk.dbc, all Motorola, across the borders of bytes.
TEST(CanSignal, DecodesTheMotorolaExampleOfCantools) {
    const auto temperature = signal(0, 12, Order::motorola, Type::is_signed, 0.01, 250);
    const auto radius = signal(6, 6, Order::motorola, Type::is_unsigned, 0.1);
    const auto enable = signal(7, 1, Order::motorola, Type::is_unsigned);
    const Bytes a{0x80, 0x4A, 0x0F}, b{0xC0, 0x06, 0xE0};
    EXPECT_NEAR(value_of(temperature, a), 255.92, 1e-12);
    EXPECT_EQ(value_of(radius, a), 0);
    EXPECT_EQ(value_of(enable, a), 1);
    EXPECT_NEAR(value_of(temperature, b), 250.55, 1e-12);
    EXPECT_NEAR(value_of(radius, b), 3.2, 1e-12);
    const Bytes min{0x01, 0x00, 0x00};
    EXPECT_NEAR(value_of(temperature, min), 229.52, 1e-12);  // the file's own lower end
}

// CSS Electronics' introduction: J1939 EEC1, EngineSpeed : 24|16@1+ (0.125,0), 621 rpm.
TEST(CanSignal, DecodesTheIntelExampleOfCssElectronics) {
    const auto speed_rpm = signal(24, 16, Order::intel, Type::is_unsigned, 0.125);
    EXPECT_EQ(value_of(speed_rpm, Bytes{0xFF, 0xFF, 0xFF, 0x68, 0x13, 0xFF, 0xFF, 0xFF}), 621);
}

TEST(CanSignal, ReadsFloatsOfBothLengthsAndOrders) {
    const auto bits = std::bit_cast<std::uint32_t>(-12.5f);
    Bytes bytes{};
    for (const Order order : {Order::intel, Order::motorola}) {
        const auto half = signal(order == Order::intel ? 8 : 15, 32, order, Type::is_float, 2);
        test::put_raw(half, bits, bytes);
        EXPECT_EQ(value_of(half, bytes), -25);
        const auto whole = signal(order == Order::intel ? 0 : 7, 64, order, Type::is_float);
        test::put_raw(whole, std::bit_cast<std::uint64_t>(1e-300), bytes);
        EXPECT_EQ(value_of(whole, bytes), 1e-300);
    }
}

TEST(CanSignal, RefusesWhatDoesNotFit) {
    EXPECT_EQ(why_no_signal(signal(48, 16, Order::intel, Type::is_signed), 8), "");
    EXPECT_EQ(why_no_signal(signal(49, 16, Order::intel, Type::is_signed), 8),
              "16 bits from start bit 49 (Intel) need 9 bytes, but the message has 8");
    EXPECT_EQ(why_no_signal(signal(55, 16, Order::motorola, Type::is_signed), 8), "");
    EXPECT_EQ(why_no_signal(signal(54, 16, Order::motorola, Type::is_signed), 8),
              "16 bits from start bit 54 (Motorola) need 9 bytes, but the message has 8");
    EXPECT_EQ(why_no_signal(signal(0, 65, Order::intel, Type::is_signed), 64), "length 65 is outside 1 .. 64 bits");
    EXPECT_EQ(why_no_signal(signal(0, 16, Order::intel, Type::is_float), 8), "a float has 32 or 64 bits, not 16");
    EXPECT_NE(why_no_signal(signal(0, 8, Order::intel, Type::is_signed, 0), 8), "");
}

// Invalid values that a DBC file may have: they must not reach the arithmetic.
TEST(CanSignal, RefusesWhatMakesNoNumber) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
    const auto why = [](unsigned start, unsigned length, Type type, double factor = 1, double offset = 0) {
        return why_no_signal(signal(start, length, Order::intel, type, factor, offset), 8);
    };
    EXPECT_EQ(why(0, 0, Type::is_unsigned), "length 0 is outside 1 .. 64 bits");
    EXPECT_EQ(why(0, 32, Type::is_float), "");
    EXPECT_EQ(why(0, 64, Type::is_float), "");
    EXPECT_EQ(why(512, 8, Type::is_signed), "start bit 512 is outside 0 .. 511");
    EXPECT_EQ(why(4'294'967'295u, 64, Type::is_signed), "start bit 4294967295 is outside 0 .. 511");
    EXPECT_EQ(why(0, 8, Type::is_signed, kNaN), "factor nan makes no number of it; a factor is finite and not 0");
    EXPECT_EQ(why(0, 8, Type::is_signed, -kInf), "factor -inf makes no number of it; a factor is finite and not 0");
    EXPECT_EQ(why(0, 8, Type::is_signed, 1, kInf), "the offset is not finite");
    EXPECT_EQ(why(0, 8, Type::is_signed, 1, kNaN), "the offset is not finite");
}

rc::Gen<CanSignal> signals() {
    return rc::gen::suchThat(
        rc::gen::apply(
            [](unsigned start, unsigned length, bool intel, bool is_signed) {
                return signal(start, length, intel ? Order::intel : Order::motorola,
                              is_signed ? Type::is_signed : Type::is_unsigned);
            },
            rc::gen::inRange(0u, 512u), rc::gen::inRange(1u, 65u), rc::gen::arbitrary<bool>(), rc::gen::arbitrary<bool>()),
        [](const CanSignal& s) { return why_no_signal(s, kCanMaxBytes).empty(); });
}

RC_GTEST_PROP(CanSignal, ReadsWhatWasWrittenBitByBitAndNothingElse, ()) {
    const auto s = *signals();
    const auto raw = *rc::gen::arbitrary<std::uint64_t>();
    std::array<std::uint8_t, kCanMaxBytes> bytes;
    for (auto& byte : bytes) byte = *rc::gen::arbitrary<std::uint8_t>();
    test::put_raw(s, raw, bytes);
    const std::uint64_t mask = s.length == 64 ? ~0ull : (1ull << s.length) - 1;
    RC_ASSERT(raw_of(s, {bytes.data(), bytes_needed(s)}) == (raw & mask));  // no further byte is read
    const double value = value_of(s, bytes);
    const bool negative = s.type == Type::is_signed && (raw >> (s.length - 1) & 1u) != 0;
    const double wanted = negative ? -double(~raw & mask) - 1 : double(raw & mask);
    const double off = std::abs(value - wanted);  // above 2^53 both round
    RC_ASSERT(off <= (s.length <= 53 ? 0 : std::abs(wanted) * 0x1p-52));
}

RC_GTEST_PROP(CanSignal, NeedsTheLastByteThatItsBitsTouch, ()) {
    const auto s = *signals();
    std::array<std::uint8_t, kCanMaxBytes> bytes{};
    test::put_raw(s, ~0ull, bytes);
    std::size_t last = 0;
    for (std::size_t k = 0; k < bytes.size(); ++k)
        if (bytes[k] != 0) last = k + 1;
    RC_ASSERT(bytes_needed(s) == last);
}

}  // namespace
}  // namespace tactiled
