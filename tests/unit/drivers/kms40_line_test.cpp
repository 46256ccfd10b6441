// The KMS 40's lines.
#include "drivers/wire/kms40_line.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled {
namespace {

TEST(Kms40, ReadsItsLinesAndPassesOverTheAnswersToCommands) {
    for (const std::size_t chunk : {1u, 5u, 4096u}) {
        LinkCounts counts;
        Kms40Decoder decoder(counts);
        const auto frames =
            decode(decoder, bytes_of("L1\nF={-1.5,0.25,3,0.001,-2e-3,0},123\r\nF={4,5,6,7,8,9},124\n"), chunk);
        ASSERT_EQ(frames.size(), 2u);
        ASSERT_EQ(frames[0].n_channels, 6);
        EXPECT_EQ(frames[0].channel[0], -1.5);   // N
        EXPECT_EQ(frames[0].channel[4], -2e-3);  // Nm
        EXPECT_EQ(frames[1].channel[5], 9);
        EXPECT_EQ(counts[TACTILED_LINK_SKIPPED], 3u);
        EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 0u);
    }
}

TEST(Kms40, TakesNothingFromALineThatIsNotWhole) {
    for (const char* line :
         {"F={1,2,3,4,5},1", "F={1,2,3,4,5,6,7},1", "F={1,2,3,4,5,6}", "F={1,2,3,4,5,6},", "F={1,2,3,4,5,6},1x",
          "F={1,2,,4,5,6},1", "F={1,2,nan,4,5,6},1", "F={1,2,inf,4,5,6},1", "F={", "F={1,2,3,4,5,6,1"}) {
        LinkCounts counts;
        Kms40Decoder decoder(counts);
        EXPECT_TRUE(decode(decoder, bytes_of(std::string(line) + "\n")).empty()) << line;
        EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 1u) << line;
    }
    LinkCounts counts;
    Kms40Decoder decoder(counts);
    EXPECT_TRUE(decode(decoder, bytes_of("L1\nF={" + std::string(300, '1') + "\n")).empty());
    EXPECT_EQ(counts[TACTILED_LINK_BAD_LENGTH], 1u);
}

}  // namespace
}  // namespace tactiled
