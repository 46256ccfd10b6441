// The file of what a known weight taught: whole or not at all, and only where it belongs.
#include "node/known_weight.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace tactiled {
namespace {

constexpr std::uint32_t kJaws = 0x12345678;
constexpr std::int64_t kNow_s = 1'800'000'000;

grasp::Check some_check() {
    grasp::Check c;
    c.mass_kg = 0.06;
    c.scale = 1.0123456789;
    c.age_s = 3600;
    c.leak[1].press_N = 0.28;
    c.leak[1].sd_N = 2e-4;
    c.leak[1].followed = true;
    for (std::size_t k = 0; k < grasp::Leak::kKnots; ++k) c.leak[1].shear_N[k] = {1e-4 * double(k), -1e-3};
    return c;
}

class KnownWeight : public testing::Test {
protected:
    KnownWeight() {
        char folder[] = "/tmp/tactiled-known-XXXXXX";
        folder_ = ::mkdtemp(folder);
        path_ = folder_ + "/known.toml";
    }
    ~KnownWeight() override { std::filesystem::remove_all(folder_); }
    std::optional<grasp::Check> load(std::uint32_t of = kJaws, std::int64_t now_s = kNow_s) {
        why_not_.clear();
        return load_check(path_, of, now_s, why_not_);
    }
    void write(const std::string& text) { std::ofstream(path_) << text; }
    [[nodiscard]] std::string text() const {
        std::stringstream all;
        all << std::ifstream(path_).rdbuf();
        return all.str();
    }
    std::string folder_, path_, why_not_;
};

TEST_F(KnownWeight, ComesBackAsItWasAndOlder) {
    EXPECT_FALSE(load());
    EXPECT_EQ(why_not_, "");  // nobody showed one: no news
    store_check(path_, {some_check(), kJaws}, kNow_s);
    auto back = load(kJaws, kNow_s + 86400);
    ASSERT_TRUE(back) << why_not_;
    EXPECT_EQ(back->age_s, 86400 + 3600);
    back->age_s = 3600;
    EXPECT_NEAR(back->scale, 1.0123456789, 1e-8);
    back->scale = some_check().scale;
    EXPECT_EQ(*back, some_check());
}

TEST_F(KnownWeight, OfOtherJawsIsRefused) {
    store_check(path_, {some_check(), kJaws}, kNow_s);
    EXPECT_FALSE(load(kJaws + 1));
    EXPECT_NE(why_not_.find("other calibrations"), std::string::npos);
    EXPECT_NE(why_not_.find("tactilectl weigh known"), std::string::npos);
}

TEST_F(KnownWeight, ASpoiltFileIsNoneAndSaysWhy) {
    store_check(path_, {some_check(), kJaws}, kNow_s);
    const std::string good = text();
    const auto without = [&](const std::string& what, const std::string& other) {
        std::string bad = good;
        bad.replace(bad.find(what), what.size(), other);
        return bad;
    };
    for (const std::string& bad :
         {good.substr(0, good.size() / 2), std::string(), without("mass_kg = 0.06", "mass_kg = nan"),
          without("format = 1", "format = 2"), without("scale =", "scales ="), without("scale = 1.", "scale = -1."),
          without("press_N", "presses_N"), without("y_N = [-0.001, ", "y_N = ["), without("jaw = 1", "jaw = 8")}) {
        write(bad);
        EXPECT_FALSE(load()) << bad;
        EXPECT_NE(why_not_, "") << bad;
    }
    write(good);
    EXPECT_TRUE(load());
}

TEST_F(KnownWeight, AClockThatForgotTheDateMakesItOld) {
    store_check(path_, {some_check(), kJaws}, kNow_s);
    EXPECT_EQ(load(kJaws, 1000)->age_s, 30 * 86400.0);
}

TEST_F(KnownWeight, WhatIsForgottenLeavesNoFile) {
    store_check(path_, {some_check(), kJaws}, kNow_s);
    store_check(path_, {grasp::Check{}, kJaws}, kNow_s);
    EXPECT_FALSE(std::filesystem::exists(path_));
    store_check(path_, {grasp::Check{}, kJaws}, kNow_s);  // and once more
}

TEST_F(KnownWeight, TheKeeperStoresWhatItIsHandedAndTheLastOfItBeforeItEnds) {
    Ring<KeptCheck> checks{4};
    const auto hand_over = [&](double mass_kg) {
        KeptCheck* const slot = checks.claim();
        ASSERT_NE(slot, nullptr);
        *slot = {some_check(), kJaws};
        slot->check.mass_kg = mass_kg;
        checks.push();
        checks.commit();
    };
    {
        const CheckKeeper keeper(path_, checks);
        hand_over(0.1);
        for (int i = 0; i < 300 && !std::filesystem::exists(path_); ++i) ::usleep(10'000);
        EXPECT_EQ(load(kJaws, calendar_s() + 10)->mass_kg, 0.1);
        hand_over(0.2);
    }
    EXPECT_EQ(load(kJaws, calendar_s() + 10)->mass_kg, 0.2);
}

TEST_F(KnownWeight, ADiskThatRefusesKeepsTheOldFile) {
    store_check(path_, {some_check(), kJaws}, kNow_s);
    const std::string before = text();
    EXPECT_THROW(store_check(folder_ + "/none/known.toml", {some_check(), kJaws}, kNow_s), SetupError);
    EXPECT_EQ(text(), before);
}

}  // namespace
}  // namespace tactiled
