// The raw taxels of a frame as a message of a recording.
#include "drivers/mcap/taxels_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace tactiled::mcap {
namespace {

TEST(TaxelsMessage, EveryBitComesBack) {
    const std::vector<float> value = {
        1.5f, std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity(), -0.f, 3e-45f, 16'777'217.f};
    std::string bytes;
    encode_taxels({{2, 3}, value}, 1'234, 1'700'000'000'000'000'123u, bytes);
    RecordedTaxels taxels;
    ASSERT_TRUE(decode_taxels(bytes, taxels));
    EXPECT_EQ(taxels.t_ns, 1'234u);
    EXPECT_EQ(taxels.shape, (TaxelShape{2, 3}));
    ASSERT_EQ(taxels.value.size(), value.size());
    EXPECT_EQ(std::memcmp(taxels.value.data(), value.data(), value.size() * sizeof(float)), 0);
}

TEST(TaxelsMessage, AMessageThatIsCutOrHasAnotherNumberOfValuesIsRefused) {
    std::string bytes;
    encode_taxels({{2, 3}, std::vector<float>(6)}, 0, 0, bytes);
    RecordedTaxels taxels;
    for (std::size_t size = 0; size < bytes.size(); ++size)
        EXPECT_FALSE(decode_taxels(std::span(bytes.data(), size), taxels)) << size;
    encode_taxels({{2, 3}, std::vector<float>(5)}, 0, 0, bytes);
    EXPECT_FALSE(decode_taxels(bytes, taxels));
    encode_taxels({{4097, 1}, std::vector<float>(4097)}, 0, 0, bytes);
    EXPECT_FALSE(decode_taxels(bytes, taxels));
    encode_taxels({{1, 9}, std::vector<float>(9)}, 0, 0, bytes);
    EXPECT_FALSE(decode_taxels(bytes, taxels));
}

}  // namespace
}  // namespace tactiled::mcap
