#include "node/lab/tradeoff.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace tactiled::ctl {
namespace {

using Indices = std::vector<std::size_t>;
const double kUnknown = std::nan("");

TEST(Front, IsWhatNothingBeatsTheFastestFirst) {
    EXPECT_EQ(front({{"slow and good", 2, 1}, {"beaten", 1, 5}, {"fast", 0.1, 4}, {"slower and worse", 3, 2}}),
              (Indices{2, 0}));
}

TEST(Front, KeepsTheFirstOfEqualsAndTheBetterOfEquallyFast) {
    EXPECT_EQ(front({{"a", 1, 3}, {"b", 1, 3}}), Indices{0});
    EXPECT_EQ(front({{"a", 1, 3}, {"b", 1, 2}}), Indices{1});
    EXPECT_EQ(front({{"a", 1, 3}, {"b", 2, 3}}), Indices{0});
}

TEST(Front, LeavesOutWhatIsNotKnown) {
    EXPECT_EQ(front({{"no error", 0.1, kUnknown}, {"no time", kUnknown, 0.1}, {"known", 1, 1}}), Indices{2});
    EXPECT_TRUE(front({}).empty());
}

// Compares with the definition, over random offers with many equal ones.
TEST(Front, HasEveryOfferThatNoOtherBeatsAndNoOther) {
    std::mt19937 random(1);
    for (int trial = 0; trial < 1000; ++trial) {
        std::vector<Offer> offers(1 + random() % 12);
        for (Offer& offer : offers) offer = {"", double(random() % 6), double(random() % 6)};
        const Indices best = front(offers);
        for (std::size_t i = 0; i < offers.size(); ++i) {
            bool beaten = false;
            for (std::size_t j = 0; j < offers.size(); ++j) {
                const bool no_worse =
                    offers[j].time_us <= offers[i].time_us && offers[j].error_percent <= offers[i].error_percent;
                const bool equal =
                    offers[j].time_us == offers[i].time_us && offers[j].error_percent == offers[i].error_percent;
                beaten = beaten || (no_worse && (!equal || j < i));
            }
            EXPECT_EQ(std::find(best.begin(), best.end(), i) == best.end(), beaten) << trial << ' ' << i;
        }
    }
}

TEST(Sentence, NamesTheFrontByBudget) {
    EXPECT_EQ(
        front_sentence("table", {{"map", 1.52, 0.6}, {"linear", 0.05, 2.1}, {"signs", 0.1, 9}}),
        "table: linear from 0.05 us a sample (2.1 % rms of full scale); map from 1.5 us (0.6 %); no other is worth its "
        "time.");
    EXPECT_EQ(front_sentence("piezo", {{"fused", 0.2, 2}}), "piezo: fused from 0.2 us a sample (2 % rms of full scale).");
}

TEST(Sentence, LeavesOutWhatGainsNextToNothing) {
    EXPECT_EQ(front_sentence("pad", {{"ratio", 0.07, 3.00}, {"overlap", 2, 2.99}, {"best", 3, 2}}),
              "pad: ratio from 0.07 us a sample (3 % rms of full scale); best from 3 us (2 %); no other is worth its time.");
}

TEST(Sentence, TellsTheShareWithoutAValueWhereThereIsOne) {
    EXPECT_EQ(front_sentence("pad", {{"a", 1, 3, 0.25}, {"b", 2, 1, 0}}),
              "pad: a from 1 us a sample (3 % rms of full scale, no value in 0.25 %); b from 2 us (1 %).");
}

TEST(Sentence, SaysThatThereIsNothing) {
    EXPECT_EQ(front_sentence("hair", {{"matrix", 1, kUnknown}}), "hair: nothing to choose from.");
}

}  // namespace
}  // namespace tactiled::ctl
