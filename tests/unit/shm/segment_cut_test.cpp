// The file of a segment is truncated, or its daemon dies, during a read.
#include <sys/resource.h>
#include <sys/wait.h>

#include "segment_fixture.hpp"

namespace tactiled {
namespace {

class CutTest : public SegmentTest {
protected:
    // Leaves the file of a killed daemon with a sensor and a link: samples whose components equal their number, GOOD
    // for 10 s.
    void leave_a_file() const {
        const pid_t child = ::fork();
        if (child == 0) {
            SegmentPlan p = plan();
            p.history = 256;
            p.watchdog_ms = 10'000;
            p.sensors[0].stale_ms = 10'000;
            tactiled_link link{};
            std::memcpy(link.name, "link", 5);
            p.links.push_back(link);
            SegmentWriter writer(p);
            writer.set_state(TACTILED_RUNNING);
            beat(writer, 0);
            for (std::uint64_t n = 0; n < 1000; ++n) {
                auto s = sample(n + 1);
                s.sequence = n;
                writer.publish(0, s);
            }
            ::kill(::getpid(), SIGKILL);
        }
        ::waitpid(child, nullptr, 0);
    }
    std::size_t size() const {
        struct stat status {};
        return ::stat(path_.c_str(), &status) == 0 ? std::size_t(status.st_size) : 0;
    }
    // Returns false for a value that the daemon did not publish.
    static bool is_true(const tactiled_sample& s) {
        if (s.quality != TACTILED_GOOD) return std::isnan(s.force_S_N[2]) || s.quality == TACTILED_NO_VALUE;
        const auto number = double(s.sequence + 1);
        return s.force_S_N[0] == number && s.force_S_N[2] == number && s.torque_S_Nm[2] == number &&
               s.raw_force_S_N[2] == number;
    }
};

TEST_F(CutTest, AReaderSurvivesEveryLength) {
    leave_a_file();
    const std::size_t whole = size();
    std::ifstream file(path_, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    std::vector<std::size_t> lengths = {0, 1, 511, 512, 4096, whole - 1, whole - 4096, whole - 4097};
    for (std::size_t at = 1000; at < whole; at += 9973) lengths.push_back(at);
    for (const std::size_t length : lengths) {
        std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
        Reader latest(name_, "s0"), follower(name_, "s0");
        ASSERT_TRUE(latest.is_attached()) << latest.why_not();
        follower.rewind();
        EXPECT_EQ(latest.latest().quality, unsigned(TACTILED_GOOD));
        ASSERT_EQ(::truncate(path_.c_str(), off_t(length)), 0);
        tactiled_sample s = latest.latest();
        EXPECT_TRUE(is_true(s));
        const bool lost_a_page = length <= whole - 4096;
        if (lost_a_page) { EXPECT_EQ(s.quality, unsigned(TACTILED_BAD)) << length; }
        Snapshot snapshot;
        for (int n = 0; n < 300 && follower.next(s); ++n) {
            EXPECT_TRUE(is_true(s)) << length << " of " << whole << ", sample " << s.sequence;
            if (lost_a_page) { EXPECT_EQ(s.quality, unsigned(TACTILED_BAD)) << length; }
        }
        if (lost_a_page && follower.segment().snapshot(snapshot)) {
            EXPECT_NE(snapshot.sensor[0].quality, unsigned(TACTILED_GOOD)) << length;
        }
    }
}

// Truncates at any moment of a read. Each round has a new file.
TEST_F(CutTest, NoTornValueIsGoodWhileTheFileIsCut) {
    leave_a_file();
    std::ifstream file(path_, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    long good = 0, bad = 0;
    for (int round = 0; round < 300; ++round) {
        std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
        std::atomic<int> reading{0};
        std::atomic<bool> cut{false};
        long wrong = 0;
        std::thread reader([&] {
            Reader latest(name_, "s0"), follower(name_, "s0");
            tactiled_sample s{};
            while (!cut || reading < 3) {
                for (int i = 0; i < 200; ++i) {
                    s = latest.latest();
                    wrong += !is_true(s);
                    ++(s.quality == TACTILED_GOOD ? good : bad);
                }
                follower.rewind();
                while (follower.next(s)) wrong += !is_true(s);
                ++reading;
                if (cut) ++reading;
            }
        });
        while (reading == 0) std::this_thread::yield();
        ::usleep(unsigned(round) * 7 % 200);
        ASSERT_EQ(::truncate(path_.c_str(), off_t(std::size_t(round) * 7919 % bytes.size())), 0);
        cut = true;
        reader.join();
        ASSERT_EQ(wrong, 0) << "round " << round;
    }
    EXPECT_GT(good, 0);
    EXPECT_GT(bad, 0);
}

TEST_F(CutTest, AReaderOfATruncatedFileFollowsTheNextDaemon) {
    leave_a_file();
    Reader reader(name_, "s0");
    ASSERT_EQ(::truncate(path_.c_str(), 0), 0);
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_BAD));
    const auto writer = alive();
    writer->publish(0, sample(0));
    ::usleep(20'000);
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_GOOD));
}

std::string a_file_without_bytes(const char*& map) {
    const std::string path = runtime_folder() + "/cut-" + std::to_string(::getpid());
    const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC, 0600);
    EXPECT_EQ(::ftruncate(fd, 4096), 0);
    map = static_cast<const char*>(::mmap(nullptr, 4096, PROT_READ, MAP_SHARED, fd, 0));
    EXPECT_EQ(::ftruncate(fd, 0), 0);
    ::close(fd);
    ::unlink(path.c_str());
    return path;
}

// The handler is for segments: errors of the program itself must not be hidden.
TEST_F(CutTest, ASignalThatConcernsNoSegmentEndsTheProgramAsBefore) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the sanitizer has a handler of its own for SIGBUS, which ends the program with an exit status";
#endif
    const auto writer = alive();
    EXPECT_EXIT(
        {
            const rlimit none{};
            ::setrlimit(RLIMIT_CORE, &none);
            const Segment segment = Segment::open(name_);
            const char* map = nullptr;
            a_file_without_bytes(map);
            ::_exit(*static_cast<const volatile char*>(map));
        },
        testing::KilledBySignal(SIGBUS), "");
    EXPECT_EXIT(
        {
            const Segment segment = Segment::open(name_);
            ::raise(SIGBUS);
            ::_exit(0);
        },
        testing::KilledBySignal(SIGBUS), "");
    EXPECT_EXIT(
        {
            tactiled_mappings.installed = 0;
            struct sigaction own {};
            own.sa_handler = [](int) { ::_exit(42); };
            ::sigaction(SIGBUS, &own, nullptr);
            const Segment segment = Segment::open(name_);
            const char* map = nullptr;
            a_file_without_bytes(map);
            ::_exit(*static_cast<const volatile char*>(map));
        },
        testing::ExitedWithCode(42), "");
}

TEST_F(CutTest, ManySegmentsOpenAndCloseWithoutLosingTheirProtection) {
    leave_a_file();
    for (int i = 0; i < 1000; ++i) EXPECT_TRUE(Segment::open(name_).is_open());
    const Segment last = Segment::open(name_);
    ASSERT_NE(last.c()->entry, nullptr);
    ASSERT_EQ(::truncate(path_.c_str(), 0), 0);
    EXPECT_FALSE(last.is_current());
}

// With stale_ms alone, a dead daemon's last force would seem valid for 10 s.
TEST_F(CutTest, ADaemonThatPublishesNothingForWatchdogMsIsBadWhateverStaleMs) {
    SegmentPlan p = plan();
    p.sensors[0].stale_ms = 10'000;
    p.watchdog_ms = 100;
    SegmentWriter writer(p);
    writer.set_state(TACTILED_RUNNING);
    beat(writer, 0);
    writer.publish(0, sample(0));
    writer.publish(0, sample(1));
    tactiled_node counted{};
    counted.sequence = 1;
    counted.t_ns = monotonic_ns();
    counted.count[0] = 2;
    writer.publish(counted);
    Reader reader(name_, "s0"), follower(name_, "s0");
    follower.rewind();
    tactiled_sample s{};
    ASSERT_TRUE(follower.next(s));
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_GOOD));
    ::usleep(60'000);
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_GOOD));
    ::usleep(60'000);
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(reader.latest().reasons, unsigned(TACTILED_DAEMON_STOPPED));
    EXPECT_TRUE(std::isnan(reader.latest().force_S_N[2]));
    Snapshot snapshot;
    ASSERT_TRUE(reader.segment().snapshot(snapshot));
    EXPECT_EQ(snapshot.sensor[0].quality, unsigned(TACTILED_BAD));
    ASSERT_TRUE(follower.next(s));  // the rest of the ring
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    ASSERT_TRUE(follower.wait(s, 50));  // and the end
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    EXPECT_FALSE(follower.wait(s, 50));
    beat(writer, 2);  // a running daemon with a slow sensor
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_GOOD));
}

}  // namespace
}  // namespace tactiled
