// The bytes of RDT.
#include "node/bridges/rdt_packet.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tactiled::bridges::rdt {
namespace {

tactiled_sample good() {
    tactiled_sample s{};
    s.quality = TACTILED_GOOD;
    const double values[6] = {1, -2, 3.5, 0.1, -0.2, 0.3};
    for (int i = 0; i < 3; ++i) {
        s.force_S_N[i] = values[i];
        s.torque_S_Nm[i] = values[3 + i];
    }
    return s;
}

std::uint32_t word(const Record& record, std::size_t n) {
    return std::uint32_t(record[4 * n]) << 24 | std::uint32_t(record[4 * n + 1]) << 16 |
           std::uint32_t(record[4 * n + 2]) << 8 | record[4 * n + 3];
}

TEST(RdtPacket, ARequestIsEightBytesWithItsHeader) {
    const std::uint8_t start[] = {0x12, 0x34, 0, 2, 0, 0, 1, 2};
    const auto request = parse_request(start);
    ASSERT_TRUE(request);
    EXPECT_EQ(request->command, kStream);
    EXPECT_EQ(request->count, 258u);
    const std::uint8_t other[] = {0x12, 0x35, 0, 2, 0, 0, 0, 0};
    EXPECT_FALSE(parse_request(other));
    EXPECT_FALSE(parse_request(std::span(start).first(7)));
    EXPECT_FALSE(parse_request({}));
}

TEST(RdtPacket, ARecordHasSequencesStatusAndCountsOfAMillion) {
    const auto values = values_of(good(), 0);
    ASSERT_TRUE(values);
    const auto record = encode(7, 99, 0x80020000, *values, {});
    ASSERT_TRUE(record);
    EXPECT_EQ(word(*record, 0), 7u);
    EXPECT_EQ(word(*record, 1), 99u);
    EXPECT_EQ(word(*record, 2), 0x80020000u);
    const std::int32_t counts[] = {1'000'000, -2'000'000, 3'500'000, 100'000, -200'000, 300'000};
    for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(std::int32_t(word(*record, 3 + i)), counts[i]) << i;
}

TEST(RdtPacket, AValueThatIsNotKnownIsNoRecord) {
    for (const std::uint32_t quality : {0u, unsigned(TACTILED_BAD), 4u}) {
        tactiled_sample s = good();
        s.quality = quality;
        EXPECT_FALSE(values_of(s, 0)) << quality;
    }
    tactiled_sample s = good();
    s.quality = TACTILED_UNCERTAIN;
    EXPECT_TRUE(values_of(s, 0));
    s.torque_S_Nm[1] = std::nan("");
    EXPECT_FALSE(values_of(s, 0));
    EXPECT_FALSE(values_of(s, 1u << 5));
    const auto values = values_of(s, 1u << 4);
    ASSERT_TRUE(values);
    EXPECT_EQ((*values)[4], 0);
    EXPECT_EQ((*values)[5], 0.3);
}

TEST(RdtPacket, AForceBeyondTheCountsIsNoRecord) {
    Wrench values{};
    values[2] = 2147.483647;
    EXPECT_TRUE(encode(0, 0, 0, values, {}));
    values[2] = -2147.4836485;
    EXPECT_FALSE(encode(0, 0, 0, values, {}));
    EXPECT_TRUE(encode(0, 0, 0, values, {1000, 1e6}));
    values[2] = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(encode(0, 0, 0, values, {}));
}

}  // namespace
}  // namespace tactiled::bridges::rdt
