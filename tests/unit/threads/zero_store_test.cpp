// Zeros of tares over a restart: restored only for the same sensor, else known to be lost.
#include "node/zero_store.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tactiled/reader.hpp"
#include "tests/unit/milliseconds.hpp"
#include "tests/unit/node/through.hpp"

namespace tactiled {
namespace {

class ZeroStoreTest : public testing::Test {
protected:
    ZeroStoreTest() { std::filesystem::create_directories(folder_); }
    ~ZeroStoreTest() override { std::filesystem::remove_all(folder_); }

    static ZeroOwner owner() { return {"left", "A1", 7, {"through"}, true}; }
    static std::vector<Sensor> sensors() {
        Sensor::Setup setup;
        setup.channel_of_frame = {0, 1, 2};
        setup.frame_channels = 3;
        setup.zero_id = 7;
        setup.decoupler = std::make_unique<Through>();
        std::vector<Sensor> all;
        all.emplace_back(std::move(setup));
        all[0].start(1, 0);
        return all;
    }
    tactiled_sample send(Sensor& sensor, double z) {
        Frame f;
        f.t_ns = now_ns_ += kMs;
        f.n_channels = 3;
        f.channel = {0, 0, z};
        return sensor.sample(f, now_ns_);
    }
    void tare(Sensor& sensor, double z) {
        (void)send(sensor, z);
        sensor.begin_tare(now_ns_);
        for (int i = 0; i <= 100; ++i) (void)send(sensor, z);
        EXPECT_EQ(sensor.poll_tare(now_ns_), Sensor::Tare::done);
    }
    bool keep(ZeroStore& store, const Sensor& sensor) {
        store.add(0, sensor);
        const std::uint32_t number = store.commit();
        for (int i = 0; i < 1000 && !store.is_done(number); ++i) ::usleep(5000);
        EXPECT_TRUE(store.is_done(number));
        return number != 0 && store.is_usable();
    }
    // Runs once, tares at -20 N and ends.
    void run_and_tare(bool is_killed = false) {
        ZeroStore store({path_, path_}, {owner()});
        auto before = sensors();
        tare(before[0], -20);
        EXPECT_TRUE(keep(store, before[0]));
        if (!is_killed) store.keep_last(before);
    }
    // Returns the second sample of the next run, which confirms the first.
    tactiled_sample after(const ZeroOwner& now, double z = -20, const std::map<std::string, tactiled_sample>& killed = {}) {
        ZeroStore store({path_, path_}, {now});
        auto next = sensors();
        store.restore(next, killed);
        (void)send(next[0], z);
        return send(next[0], z);
    }
    static void expect_lost(const tactiled_sample& s) {
        EXPECT_EQ(s.quality, unsigned(TACTILED_UNCERTAIN));
        EXPECT_NE(s.reasons & TACTILED_ZERO_UNKNOWN, 0u);
        EXPECT_TRUE(std::isnan(s.sd_force_N[2]));
        EXPECT_EQ(s.tare_count, 0u);
    }
    void write(const std::string& text) { std::ofstream(path_) << text; }
    std::string text() const {
        std::ifstream file(path_);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    std::string folder_ = "/tmp/zero-store-test-" + std::to_string(::getpid()), path_ = folder_ + "/of/node.zeros.toml";
    std::uint64_t now_ns_ = kMs;
};

TEST_F(ZeroStoreTest, ATareIsRestoredToTheLastBit) {
    run_and_tare();
    const tactiled_sample s = after(owner());
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.reasons, 0u);
    EXPECT_NEAR(s.force_S_N[2], 0, 1e-12);
    EXPECT_EQ(s.raw_force_S_N[2], -20);
    EXPECT_EQ(s.tare_count, 1u);
}

// The device may have been started again meanwhile, and may have taken its load for zero.
TEST_F(ZeroStoreTest, ARestoredZeroIsDoubtedUnderAnotherForce) {
    run_and_tare();
    EXPECT_NE(text().find("[[sensor.last]]"), std::string::npos);
    const tactiled_sample s = after(owner(), -15);
    EXPECT_EQ(s.reasons, std::uint32_t(TACTILED_ZERO_UNKNOWN | TACTILED_UNKNOWN_UNCERTAINTY));
    EXPECT_EQ(s.force_S_N[2], 5) << "its number is kept";
    EXPECT_EQ(s.tare_count, 1u);
    EXPECT_EQ(text().find("[[sensor.last]]"), std::string::npos);
    EXPECT_NE(after(owner(), -20).reasons & TACTILED_ZERO_UNKNOWN, 0u) << "after a run that ended without a word";
}

// Each restart may have moved the zero by as much as is not seen, always the same way.
TEST_F(ZeroStoreTest, RestartsWithTheSameForceAgeTheZero) {
    run_and_tare();
    std::vector<double> sd_N;
    for (int run = 0; run < 6; ++run) {
        ZeroStore store({path_, path_}, {owner()});
        auto next = sensors();
        store.restore(next);
        (void)send(next[0], -20);
        const tactiled_sample s = send(next[0], -20);
        EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
        sd_N.push_back(s.sd_force_N[2]);
        store.keep_last(next);
    }
    EXPECT_NEAR(sd_N.back(), Through::kSd_N * std::hypot(1, 2), 0.01 * Through::kSd_N) << "6 restarts of 1 sd each";
}

TEST_F(ZeroStoreTest, AfterAKillTheSegmentHasTheLastForce) {
    run_and_tare(true);
    tactiled_sample last{};
    last.quality = TACTILED_GOOD;
    last.raw_force_S_N[2] = -15;
    std::fill(std::begin(last.sd_force_N), std::end(last.sd_force_N), Through::kSd_N);
    EXPECT_EQ(after(owner(), -15, {{"left", last}}).quality, unsigned(TACTILED_GOOD));
    EXPECT_NE(after(owner(), -20, {{"left", last}}).reasons & TACTILED_ZERO_UNKNOWN, 0u);
    EXPECT_NE(after(owner(), -20).reasons & TACTILED_ZERO_UNKNOWN, 0u) << "after a power failure";
    last.reasons = TACTILED_UNKNOWN_UNCERTAINTY;
    EXPECT_NE(after(owner(), -15, {{"left", last}}).reasons & TACTILED_ZERO_UNKNOWN, 0u) << "saturated";
    last.quality = TACTILED_BAD;
    EXPECT_NE(after(owner(), -15, {{"left", last}}).reasons & TACTILED_ZERO_UNKNOWN, 0u);
}

TEST_F(ZeroStoreTest, TheDoubtOfASensorThatIsNotTaredLastsUntilATare) {
    tactiled_sample last{};
    last.reasons = TACTILED_ZERO_UNKNOWN;
    last.quality = TACTILED_UNCERTAIN;
    EXPECT_NE(after(owner(), -20, {{"left", last}}).reasons & TACTILED_ZERO_UNKNOWN, 0u) << "killed";
    EXPECT_EQ(after(owner(), -20).quality, unsigned(TACTILED_GOOD)) << "power failed";
    {
        ZeroStore store({path_, path_}, {owner()});
        auto before = sensors();
        for (int i = 0; i < 5; ++i) (void)send(before[0], -20);
        now_ns_ += 5'000 * kMs;
        for (int i = 0; i < 5; ++i) (void)send(before[0], -15);
        ASSERT_TRUE(before[0].doubts_zero());
        store.keep_last(before);
    }
    EXPECT_NE(after(owner(), -20).reasons & TACTILED_ZERO_UNKNOWN, 0u);
}

TEST_F(ZeroStoreTest, TwoDaemonsDoNotShareAFile) {
    run_and_tare(true);
    const std::string before = text();
    {
        ZeroStore first({path_, path_}, {owner()});
        EXPECT_TRUE(first.is_usable());
        EXPECT_THROW(ZeroStore({path_, path_}, {owner()}), SetupError);
    }
    EXPECT_EQ(text(), before);
    EXPECT_EQ(after(owner()).tare_count, 1u) << "the lock ends with its holder";
}

TEST_F(ZeroStoreTest, WithForgetATaredSensorHasNoKnownZeroUntilItIsTaredAgainOrUntared) {
    run_and_tare();
    ZeroOwner forgets = owner();
    forgets.restore = false;
    expect_lost(after(forgets));
    expect_lost(after(forgets));  // also after each further start
    for (const bool untares : {false, true}) {
        ZeroStore store({path_, path_}, {forgets});
        auto next = sensors();
        store.restore(next);
        (void)send(next[0], -20);
        ASSERT_TRUE(next[0].can_tare());
        if (untares)
            next[0].begin_untare();
        else
            tare(next[0], -20);
        const tactiled_sample s = send(next[0], -20);
        EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
        EXPECT_NEAR(s.force_S_N[2], untares ? -20 : 0, 1e-12);
    }
}

TEST_F(ZeroStoreTest, AnotherCalibrationSerialOrMethodHasLostTheTare) {
    run_and_tare();
    ZeroOwner other = owner();
    other.id = 8;
    expect_lost(after(other));
    other = owner();
    other.serial = "A2";
    expect_lost(after(other));
    other = owner();
    other.methods = {"matrix"};
    expect_lost(after(other));
    other = owner();
    other.sensor = "right";  // never tared
    EXPECT_EQ(after(other).quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(after(owner()).tare_count, 1u) << "the file still has it";
}

TEST_F(ZeroStoreTest, OfMethodAutoEachMethodHasItsOwn) {
    ZeroOwner two = owner();
    two.methods = {"exact", "fast"};
    {
        ZeroStore store({path_, path_}, {two});
        auto before = sensors();
        TaredZero zero{3, 2, {}};  // "fast" has no zero
        zero.of_method[0] = {0, 0, -20, 0, 0, 0};
        before[0].restore_zero(zero, 0, std::nullopt);
        EXPECT_TRUE(keep(store, before[0]));
    }
    two.methods = {"fast", "exact"};
    ZeroStore store({path_, path_}, {two});
    auto next = sensors();
    store.restore(next);
    const TaredZero zero = next[0].tared_zero();
    EXPECT_EQ(zero.tare_count, 3u);
    EXPECT_EQ(zero.unknown, 1u);
    EXPECT_EQ(zero.of_method[1][2], -20);
}

TEST_F(ZeroStoreTest, AnUntareIsKeptToo) {
    run_and_tare();
    {
        ZeroStore store({path_, path_}, {owner()});
        auto next = sensors();
        store.restore(next);
        next[0].begin_untare();
        EXPECT_TRUE(keep(store, next[0]));
    }
    EXPECT_EQ(after(owner()).force_S_N[2], -20);
    EXPECT_EQ(after(owner()).quality, unsigned(TACTILED_GOOD));
}

// Most of these tares are handed over while the file is being written.
TEST_F(ZeroStoreTest, ATareIsDoneOnceItIsInTheFile) {
    ZeroStore store({path_, path_}, {owner()});
    auto before = sensors();
    for (int i = 1; i <= 40; ++i) {
        tare(before[0], -i);
        if (i % 4 == 0) {
            EXPECT_TRUE(keep(store, before[0]));
            EXPECT_NE(text().find("tare_count = " + std::to_string(i)), std::string::npos) << i;
        } else {
            store.add(0, before[0]);
            EXPECT_NE(store.commit(), 0u) << i;
        }
    }
}

TEST_F(ZeroStoreTest, ADamagedFileMayHaveHeldAnyTare) {
    run_and_tare();
    for (const std::string& damaged :
         {std::string("format = 1\n[[sensor]]\nname = \"left\"\n"), text().substr(0, text().size() / 2),
          std::string("format = 3\n"), std::string("\0\1\2", 3)}) {
        write(damaged);
        expect_lost(after(owner()));
        expect_lost(after(owner()));  // the file was written again, and still contains it
    }
}

TEST_F(ZeroStoreTest, ADamagedBitOrACharacterTooFewIsFound) {
    run_and_tare();
    const std::string good = text();
    for (std::size_t i = 0; i < good.rfind("crc"); i += 3) {
        for (const bool removes : {false, true}) {
            std::string damaged = good;
            if (removes)
                damaged.erase(i, 1);
            else
                damaged[i] = char(damaged[i] ^ 1 << i % 7);
            write(damaged);
            expect_lost(after(owner()));
        }
    }
    for (std::size_t i = good.rfind("crc"); i + 1 < good.size(); ++i) {  // the last line
        std::string damaged = good;
        write(damaged.erase(i, 1));
        expect_lost(after(owner()));
    }
    write("# no tare\nformat = 2\n");
    expect_lost(after(owner()));
}

TEST_F(ZeroStoreTest, ALinkToNothingMayHaveLedToAnyTare) {
    std::filesystem::create_directories(folder_ + "/of");
    std::filesystem::create_symlink(folder_ + "/nothing", path_);
    expect_lost(after(owner()));
}

TEST_F(ZeroStoreTest, AZeroThatWasAboutToChangeIsNotKnownAfterARestart) {
    run_and_tare();
    {
        ZeroStore store({path_, path_}, {owner()});
        auto next = sensors();
        store.restore(next);
        store.add_change(0, next[0]);
        const std::uint32_t number = store.commit();
        for (int i = 0; i < 1000 && !store.is_done(number); ++i) ::usleep(5000);
    }
    expect_lost(after(owner()));
}

TEST_F(ZeroStoreTest, AFileThatCannotBeReadOrWrittenLeavesTheStoreUnusable) {
    std::filesystem::create_directories(path_);  // a folder in its place
    ZeroStore store({path_, path_}, {owner()});
    EXPECT_FALSE(store.is_usable());
    auto next = sensors();
    store.restore(next);
    expect_lost(send(next[0], -20));
    auto fresh = sensors();
    tare(fresh[0], -20);
    EXPECT_FALSE(keep(store, fresh[0]));
    std::filesystem::remove_all(path_);
    for (int i = 0; i < 400 && !store.is_usable(); ++i) ::usleep(10'000);
    EXPECT_TRUE(store.is_usable()) << "it is tried again each second";
    EXPECT_FALSE(ZeroStore({}, {owner()}).is_usable());
}

TEST_F(ZeroStoreTest, ASensorThatAReloadExchangedStaysTaredInTheFile) {
    run_and_tare();
    {
        ZeroStore store({path_, path_}, {owner()});
        auto next = sensors();
        store.restore(next);
        next[0].lose_zero();
        store.add(0, next[0]);
        (void)store.commit();
        ::usleep(100'000);
    }
    EXPECT_EQ(after(owner()).tare_count, 1u);
}

TEST(ZerosPath, IsConfiguredOrOfSystemdOrTheUsersOwn) {
    const char* const kept[] = {"STATE_DIRECTORY", "XDG_STATE_HOME", "HOME"};
    std::string before[3];
    for (int i = 0; i < 3; ++i)
        if (const char* const value = std::getenv(kept[i])) before[i] = value;
    ::setenv("STATE_DIRECTORY", "/state:/other", 1);
    ::setenv("XDG_STATE_HOME", "/xdg", 1);
    ::setenv("HOME", "/home/me", 1);
    EXPECT_EQ(zero_files("/a/b.toml", "n").written, "/a/b.toml");
    EXPECT_EQ(zero_files("", "n").written, "/state/n.zeros.toml");
    ::unsetenv("STATE_DIRECTORY");
    if (::access("/var/lib/tactiled", W_OK) != 0) {
        EXPECT_EQ(zero_files("", "n").written, "/xdg/tactiled/n.zeros.toml");
        ::unsetenv("XDG_STATE_HOME");
        EXPECT_EQ(zero_files("", "n").written, "/home/me/.local/state/tactiled/n.zeros.toml");
        ::unsetenv("HOME");
        EXPECT_EQ(zero_files("", "n").written, "/var/lib/tactiled/n.zeros.toml");  // the log says that it cannot be written
    }
    for (int i = 0; i < 3; ++i)
        if (!before[i].empty()) ::setenv(kept[i], before[i].c_str(), 1);
}

// A tare must not be forgotten because its folder cannot be written any more, or because another user starts the daemon.
TEST_F(ZeroStoreTest, TheFileThatWasWrittenLastIsReadWhereverItIs) {
    const std::string first = folder_ + "/first", last = folder_ + "/last", none = folder_ + "/none";
    const std::string in_first = first + "/n.zeros.toml", in_last = last + "/n.zeros.toml";
    for (const auto& folder : {first, last}) std::filesystem::create_directories(folder);
    const auto files = [](std::vector<std::string> folders) {
        const ZeroFiles found = zero_files_in(folders, "n");
        return std::pair(found.written, found.read);
    };
    EXPECT_EQ(files({none, first, last}), std::pair(in_first, in_first));
    EXPECT_EQ(files({none, last}), std::pair(in_last, in_last));
    std::ofstream(in_last) << "a";
    EXPECT_EQ(files({first, last}), std::pair(in_first, in_last));
    std::ofstream(in_first) << "a";
    const auto now = std::filesystem::last_write_time(in_last);
    std::filesystem::last_write_time(in_first, now + std::chrono::seconds(1));
    EXPECT_EQ(files({first, last}), std::pair(in_first, in_first));
    std::filesystem::last_write_time(in_first, now - std::chrono::seconds(1));
    EXPECT_EQ(files({first, last}), std::pair(in_first, in_last));
}

}  // namespace
}  // namespace tactiled
