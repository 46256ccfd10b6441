// What we answer ourselves is, byte by byte, what libmodbus answers.
#include "node/modbus/responder.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <vector>

#include "config/options.hpp"

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;
const Bytes kTareSecond{0x12, 0x34, 0, 0, 0, 6, 9, 5, 0, 1, 0xFF, 0};  // transaction, protocol, length, unit, coil 1 on

TEST(Responder, AnAnswerIsToItsOwnRequestAndToNoOther) {
    EXPECT_TRUE(is_answer_to(kTareSecond, kTareSecond));
    for (const std::size_t at : {0, 1, 2, 3, 4, 5, 6}) {  // each byte of the header
        Bytes other = kTareSecond;
        other[at] ^= 1;
        EXPECT_FALSE(is_answer_to(kTareSecond, other)) << at;
    }
    Bytes more = kTareSecond;
    more.push_back(0);
    EXPECT_FALSE(is_answer_to(kTareSecond, more));
    EXPECT_FALSE(is_answer_to(kTareSecond, Bytes(more.begin(), more.begin() + 7)));  // a header, and nothing in it
    EXPECT_FALSE(is_answer_to(kTareSecond, {}));
}

TEST(Responder, AWrongAnswerIsExceptionFourAndSpoilsNotTheNext) {
    Responder responder;
    Tables tables;
    std::array<std::uint8_t, kMaxAdu> out{};
    // Of a protocol that is not 0, libmodbus' is; check_adu() lets none of these come here.
    const Bytes of_another_protocol{0x12, 0x34, 0, 1, 0, 6, 9, 1, 0, 0, 0, 8};
    ASSERT_EQ(responder.answer(of_another_protocol, tables, out), 9u);
    EXPECT_EQ(out[7], 0x81);
    EXPECT_EQ(out[8], kDeviceFailure);
    ASSERT_EQ(responder.answer(kTareSecond, tables, out), kTareSecond.size());
    EXPECT_TRUE(std::equal(kTareSecond.begin(), kTareSecond.end(), out.begin()));
    EXPECT_EQ(tables.coils[1], 1);
}

TEST(Responder, WithoutADescriptorLeftItSaysSo) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the undefined-behaviour sanitizer, which is built with it, asks a pipe whether an object can be read";
#endif
    rlimit was{};
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &was), 0);
    const rlimit none{0, was.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
    EXPECT_THROW(Responder{}, SetupError);
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &was), 0);
}

RC_GTEST_PROP(Responder, RegistersAreAnsweredAsLibmodbusDoes, ()) {
    static Responder responder;
    const auto& areas_ = areas();
    const Area& area = areas_[*rc::gen::inRange<std::size_t>(0, areas_.size())];
    const auto at = *rc::gen::inRange<std::uint16_t>(area.at, std::uint16_t(area.at + area.size));
    const auto max = std::min(125, area.at + area.size - at);
    const auto count = *rc::gen::inRange<std::uint16_t>(1, std::uint16_t(max + 1));
    const auto function = std::uint8_t(*rc::gen::element(kReadHolding, kReadInputRegisters));
    const auto transaction = *rc::gen::arbitrary<std::uint16_t>();
    const std::vector<std::uint8_t> adu{std::uint8_t(transaction >> 8),
                                        std::uint8_t(transaction),
                                        0,
                                        0,
                                        0,
                                        6,
                                        *rc::gen::arbitrary<std::uint8_t>(),
                                        function,
                                        std::uint8_t(at >> 8),
                                        std::uint8_t(at),
                                        std::uint8_t(count >> 8),
                                        std::uint8_t(count)};
    Tables tables;
    for (unsigned i = 0; i < count; ++i) tables.registers[at + i] = *rc::gen::arbitrary<std::uint16_t>();

    std::array<std::uint8_t, kMaxAdu> ours{}, theirs{};
    const std::size_t n = registers_adu(adu, std::span(tables.registers).subspan(at, count), ours);
    RC_ASSERT(n == responder.answer(adu, tables, theirs));
    RC_ASSERT(std::equal(ours.begin(), ours.begin() + std::ptrdiff_t(n), theirs.begin()));
}

}  // namespace
}  // namespace tactiled::modbus
