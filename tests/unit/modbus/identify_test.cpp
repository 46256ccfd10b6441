// Function 43 / 14, byte by byte (Modbus Application Protocol 1.1b3, 6.21).
#include "node/modbus/identify.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace tactiled::modbus {
namespace {

std::vector<std::uint8_t> pdu_of(std::uint8_t code, std::uint8_t object) {
    const std::vector<std::uint8_t> adu{0, 1, 0, 0, 0, 5, 1, 43, 14, code, object};
    std::array<std::uint8_t, kMaxAdu> out{};
    const std::size_t size = Identity("node").answer(adu, out);
    EXPECT_EQ(size, 6u + out[5]);
    return {out.begin() + kMbapSize, out.begin() + long(size)};
}

TEST(Identity, SaysItsConformity) {
    for (const int code : {1, 2, 3, 4}) EXPECT_EQ(pdu_of(std::uint8_t(code), 0)[3], 0x82) << code;  // regular, both accesses
}

TEST(Identity, AStreamFromBeyondItsLastObjectStartsAgain) {
    for (const int first : {3, 4, 6, 7, 255}) {  // 3: the first that the basic stream does not have
        const auto pdu = pdu_of(1, std::uint8_t(first));
        EXPECT_EQ(pdu[6], 3) << first;  // objects
        EXPECT_EQ(pdu[7], 0) << first;  // the first of them
    }
    EXPECT_EQ(pdu_of(1, 2)[6], 1);
    EXPECT_EQ(pdu_of(2, 7)[6], 7);
}

}  // namespace
}  // namespace tactiled::modbus
