// The segment between writer and reader, in real shared memory.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <thread>

#include "node/control.hpp"
#include "node/shm/writer.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

class SegmentTest : public testing::Test {
protected:
    std::string name_ = "test-" + std::to_string(::getpid());
    std::string path_ = "/dev/shm/tactiled." + name_;
    ~SegmentTest() override { ::unlink(path_.c_str()); }

    SegmentPlan plan(std::size_t sensors = 1) const {
        SegmentPlan p;
        p.name = name_;
        p.version = "test";
        p.history = 64;
        for (std::size_t i = 0; i < sensors; ++i) {
            tactiled_sensor s{};
            ("s" + std::to_string(i)).copy(s.name, sizeof s.name - 1);
            s.stale_ms = 100;
            p.sensors.push_back(s);
        }
        return p;
    }
    static tactiled_sample sample(std::uint64_t number) {
        tactiled_sample s{};
        s.sequence = number;
        s.t_ns = monotonic_ns();
        s.quality = TACTILED_GOOD;
        for (int i = 0; i < 3; ++i) s.force_S_N[i] = s.raw_force_S_N[i] = s.torque_S_Nm[i] = double(number);
        return s;
    }
};

TEST_F(SegmentTest, GivesTheNewestAndThenNothingNew) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    Reader reader(name_, "s0");
    ASSERT_TRUE(reader.is_attached()) << reader.why_not();
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_BAD));  // none yet: never zeros that look good
    EXPECT_TRUE(std::isnan(reader.latest().force_S_N[2]));
    tactiled_sample s{};
    EXPECT_FALSE(reader.next(s));
    writer.publish(0, sample(0));
    writer.publish(0, sample(1));
    EXPECT_EQ(reader.latest().force_S_N[2], 1.0);
    ASSERT_TRUE(reader.next(s));
    EXPECT_EQ(s.sequence, 1u);
    EXPECT_FALSE(reader.next(s));
    writer.publish(0, sample(2));
    ASSERT_TRUE(reader.next(s));
    EXPECT_EQ(s.sequence, 2u);
}

TEST_F(SegmentTest, ASlowReaderCountsWhatItLost) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    Reader reader(name_, "s0");
    writer.publish(0, sample(0));
    tactiled_sample s{};
    ASSERT_TRUE(reader.next(s));
    for (std::uint64_t n = 1; n <= 1000; ++n) writer.publish(0, sample(n));
    std::uint64_t got = 0, last = 0;
    while (reader.next(s)) {
        EXPECT_GT(s.sequence, last);
        last = s.sequence;
        ++got;
    }
    EXPECT_EQ(last, 1000u);
    EXPECT_EQ(got + reader.lost(), 1000u);
    EXPECT_GE(got, 64u - 64u / 8u - 2u);
}

TEST_F(SegmentTest, AnOldSampleIsBadAndItsForceIsNoNumber) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    tactiled_sample old = sample(0);
    old.t_ns -= 101'000'000;
    writer.publish(0, old);
    Reader reader(name_, "s0");
    const auto s = reader.latest();
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_STALE));
    EXPECT_TRUE(std::isnan(s.force_S_N[0]));
}

TEST_F(SegmentTest, NoReadIsTornAndNoneWaits) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    writer.publish(0, sample(0));
    std::atomic<bool> stop{false};
    std::thread flood([&] {
        for (std::uint64_t n = 1; !stop; ++n) writer.publish(0, sample(n));
    });
    Reader reader(name_, "s0");
    std::uint64_t reads = 0;
    for (int i = 0; i < 200'000; ++i) {
        const auto s = reader.latest();
        if (s.quality != TACTILED_GOOD) continue;  // lapped in each of its tries: said, not guessed
        ++reads;
        const auto expected = double(s.sequence);
        ASSERT_EQ(s.force_S_N[0], expected);
        ASSERT_EQ(s.force_S_N[2], expected);
        ASSERT_EQ(s.torque_S_Nm[2], expected);
        ASSERT_EQ(s.raw_force_S_N[0], expected);
    }
    stop = true;
    flood.join();
    EXPECT_GT(reads, 100'000u);
}

TEST_F(SegmentTest, NumbersWrapAt32BitsWithoutAGap) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    const std::uint64_t first = (1ull << 32) - 3;
    writer.publish(0, sample(first));
    Reader reader(name_, "s0");
    tactiled_sample s{};
    ASSERT_TRUE(reader.next(s));
    for (std::uint64_t n = first + 1; n < first + 6; ++n) {
        writer.publish(0, sample(n));
        ASSERT_TRUE(reader.next(s)) << n;
        EXPECT_EQ(s.sequence, n);
        EXPECT_EQ(reader.latest().sequence, n);
    }
    EXPECT_EQ(reader.lost(), 0u);
}

TEST_F(SegmentTest, ASecondDaemonIsToldThePidOfTheFirst) {
    SegmentWriter writer(plan());
    try {
        SegmentWriter second(plan());
        FAIL() << "two daemons under one name";
    } catch (const SetupError& error) {
        EXPECT_NE(std::string(error.what()).find("pid " + std::to_string(::getpid())), std::string::npos) << error.what();
    }
    EXPECT_EQ(Segment::open(name_).header().pid, std::uint32_t(::getpid()));
}

TEST_F(SegmentTest, ADeadDaemonsNameIsTakenOverAndItsReadersFollow) {
    const pid_t child = ::fork();
    if (child == 0) {
        SegmentWriter writer(plan());
        writer.set_state(TACTILED_RUNNING);
        for (std::uint64_t n = 0; n < 10; ++n) writer.publish(0, sample(n));
        ::kill(::getpid(), SIGKILL);
    }
    ::waitpid(child, nullptr, 0);
    Reader reader(name_, "s0");
    ASSERT_TRUE(reader.is_attached()) << reader.why_not();
    EXPECT_EQ(reader.latest().sequence, 9u);
    const auto before = reader.segment().header().epoch;
    SegmentWriter successor(plan());
    successor.set_state(TACTILED_RUNNING);
    EXPECT_GT(successor.epoch(), before);
    successor.publish(0, sample(0));
    ::usleep(20'000);  // a reader looks for a successor each 10 ms
    const auto s = reader.latest();
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.sequence, 0u);
    EXPECT_EQ(reader.segment().header().epoch, successor.epoch());
}

TEST_F(SegmentTest, ACleanEndSaysSoAndLeavesNothing) {
    Reader* reader = nullptr;
    {
        SegmentWriter writer(plan());
        writer.set_state(TACTILED_RUNNING);
        writer.publish(0, sample(0));
        reader = new Reader(name_, "s0");
        EXPECT_EQ(reader->latest().quality, unsigned(TACTILED_GOOD));
    }
    const auto s = reader->latest();
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(s.reasons, unsigned(TACTILED_DAEMON_STOPPED));
    delete reader;
    EXPECT_NE(::access(path_.c_str(), F_OK), 0);
}

TEST_F(SegmentTest, ACleanRestartHasANewEpochToo) {
    std::uint32_t before = 0;
    {
        SegmentWriter writer(plan());
        before = writer.epoch();
    }
    ::usleep(20'000);  // no daemon starts faster
    EXPECT_GT(SegmentWriter(plan()).epoch(), before);
}

TEST_F(SegmentTest, AReaderRefusesWhatItCannotRead) {
    const auto why = [&] {
        std::string text;
        EXPECT_FALSE(Segment::try_open(name_, text).is_open());
        return text;
    };
    EXPECT_NE(why().find("no daemon of that name runs"), std::string::npos);
    std::ofstream(path_) << "short";
    EXPECT_NE(why().find("too short"), std::string::npos);
    std::ofstream(path_) << std::string(4096, 'x');
    EXPECT_NE(why().find("no tactiled segment"), std::string::npos);
    ::unlink(path_.c_str());
    {
        SegmentWriter writer(plan(2));
        std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
        const auto patched = [&](std::size_t offset, std::uint32_t value, std::size_t size) {
            std::uint32_t before = 0;
            file.seekg(long(offset)).read(reinterpret_cast<char*>(&before), long(size));
            file.seekp(long(offset)).write(reinterpret_cast<const char*>(&value), long(size)).flush();
            const std::string text = why();
            file.seekp(long(offset)).write(reinterpret_cast<const char*>(&before), long(size)).flush();
            return text;
        };
        EXPECT_NE(patched(offsetof(tactiled_header, major), 2, 2).find("version 2.0, this reader knows 1.0"),
                  std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, byte_order), 0x04030201, 4).find("byte order"), std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, total_size), 1u << 30, 4).find("truncated"), std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, sensor_offset), 1u << 30, 4).find("outside"), std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, node) + offsetof(tactiled_ring, slots), 1u << 20, 4).find("outside"),
                  std::string::npos);
        EXPECT_NE(
            patched(offsetof(tactiled_header, node) + offsetof(tactiled_ring, head_offset), 0xFFFFFFFCu, 4).find("outside"),
            std::string::npos);
        EXPECT_TRUE(Segment::open(name_).is_open());
    }
}

TEST_F(SegmentTest, ReadersMayNotWrite) {
    SegmentWriter writer(plan());
    struct stat status {};
    ASSERT_EQ(::stat(path_.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777u, 0640u);
}

TEST_F(SegmentTest, ASnapshotBelongsTogether) {
    SegmentWriter writer(plan(3));
    writer.set_state(TACTILED_RUNNING);
    std::atomic<bool> stop{false};
    std::thread flood([&] {
        for (std::uint64_t n = 0; !stop; ++n) {
            tactiled_node node{};
            node.sequence = n;
            node.t_ns = monotonic_ns();
            for (std::uint32_t i = 0; i < 3; ++i) {
                writer.publish(i, sample(n));
                node.count[i] = n + 1;
            }
            writer.publish(node);
        }
    });
    const Segment segment = Segment::open(name_);
    Snapshot snapshot;
    while (!segment.snapshot(snapshot)) std::this_thread::yield();  // until the first is out
    std::uint64_t whole = 0;
    for (int i = 0; i < 50'000; ++i) {
        if (!segment.snapshot(snapshot)) continue;
        ++whole;
        for (std::uint32_t k = 0; k < 3; ++k) ASSERT_EQ(snapshot.sensor[k].sequence, snapshot.node.sequence);
        ASSERT_EQ(snapshot.sensor[3].quality, unsigned(TACTILED_NO_VALUE));
    }
    stop = true;
    flood.join();
    EXPECT_GT(whole, 25'000u);
}

// A node record, so that the daemon counts as alive.
void beat(SegmentWriter& writer, std::uint64_t number) {
    tactiled_node node{};
    node.sequence = number;
    node.t_ns = monotonic_ns();
    writer.publish(node);
}

TEST_F(SegmentTest, AFollowerIsToldOnceThatTheDaemonIsDead) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    Reader reader(name_, "s0");
    tactiled_sample s{};
    beat(writer, 0);
    writer.publish(0, sample(0));
    ASSERT_TRUE(reader.next(s));
    writer.publish(0, sample(1));
    ::usleep(300'000);  // longer than watchdog_ms, as after kill -9
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_EQ(s.sequence, 1u);                     // first what is left
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));  // and old
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    EXPECT_TRUE(std::isnan(s.force_S_N[2]));
    EXPECT_FALSE(reader.wait(s, 100));  // once
    beat(writer, 1);                    // it had only hung
    writer.publish(0, sample(2));
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_EQ(s.sequence, 2u);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    ::usleep(300'000);
    ASSERT_TRUE(reader.wait(s, 100));  // and hangs again
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
}

TEST_F(SegmentTest, AReaderThatIsAheadOfTheHeadDoesNotGoBack) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    Reader reader(name_, "s0");
    tactiled_sample s{};
    beat(writer, 0);
    for (std::uint64_t n = 0; n < 3; ++n) writer.publish(0, sample(n));
    ASSERT_TRUE(reader.next(s));
    ASSERT_EQ(s.sequence, 2u);
    const int fd = ::open(path_.c_str(), O_RDWR);  // the writer has filled the slot and not yet moved the head
    const std::uint32_t before = 2;
    ASSERT_EQ(::pwrite(fd, &before, sizeof before, off_t(reader.segment().sensor(0).ring.head_offset)), 4);
    ::close(fd);
    for (int i = 0; i < 64; ++i) ASSERT_FALSE(reader.next(s)) << s.sequence;
}

TEST_F(SegmentTest, EveryWayOfWaitingGivesEverySample) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    std::uint64_t number = 0, beats = 0;
    for (const Wait how : {Wait::poll, Wait::predict, Wait::block}) {
        beat(writer, beats++);
        Reader reader(name_, "s0");
        std::atomic<bool> stop{false};
        std::thread daemon([&] {
            while (!stop) {
                writer.publish(0, sample(number++));
                beat(writer, beats++);
                writer.wake_readers();
                ::usleep(1000);
            }
        });
        tactiled_sample s{};
        ASSERT_TRUE(reader.wait(s, 1000, how));
        for (std::uint64_t next = s.sequence + 1, end = next + 200; next < end; ++next) {
            ASSERT_TRUE(reader.wait(s, 1000, how));
            ASSERT_EQ(s.sequence, next);
        }
        EXPECT_EQ(reader.lost(), 0u);
        stop = true;
        daemon.join();
    }
}

TEST_F(SegmentTest, AnotherMinorVersionIsReadAndAnotherMajorRefused) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    tactiled_sample s = sample(0);
    s.peak_N = 3;
    writer.publish(0, s);
    const auto patch = [&](std::size_t offset, auto value) {
        const int fd = ::open(path_.c_str(), O_RDWR);
        ASSERT_EQ(::pwrite(fd, &value, sizeof value, off_t(offset)), ssize_t(sizeof value));
        ::close(fd);
    };
    patch(offsetof(tactiled_header, minor), std::uint16_t(7));
    const auto ring = Segment::open(name_).header().sensor_offset + offsetof(tactiled_sensor, ring);
    patch(ring + offsetof(tactiled_ring, record_size), std::uint32_t(232));  // an older daemon: without state and peak
    tactiled_sample got{};
    ASSERT_TRUE(Segment::open(name_).latest(0, got));
    EXPECT_EQ(got.quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(got.peak_N, 0);
    patch(ring + offsetof(tactiled_ring, record_size), std::uint32_t(248));  // a newer one: with more
    ASSERT_TRUE(Segment::open(name_).latest(0, got));
    EXPECT_EQ(got.peak_N, 3);
    patch(offsetof(tactiled_header, major), std::uint16_t(2));
    std::string why;
    EXPECT_FALSE(Segment::try_open(name_, why).is_open());
    EXPECT_NE(why.find("version 2.7, this reader knows 1.0"), std::string::npos) << why;
}

TEST_F(SegmentTest, AFileThatOthersMayWriteIsNoDaemons) {
    SegmentWriter writer(plan());
    ASSERT_EQ(::chmod(path_.c_str(), 0660), 0);
    std::string why;
    EXPECT_FALSE(Segment::try_open(name_, why).is_open());
    EXPECT_NE(why.find("others than its owner may write it"), std::string::npos);
}

TEST_F(SegmentTest, AReadersLockStopsNoSuccessor) {
    const pid_t child = ::fork();
    if (child == 0) {
        SegmentWriter writer(plan());
        ::kill(::getpid(), SIGKILL);
    }
    ::waitpid(child, nullptr, 0);
    const int fd = ::open(path_.c_str(), O_RDONLY);
    struct flock whole {};
    whole.l_type = F_RDLCK;
    ASSERT_EQ(::fcntl(fd, F_OFD_SETLK, &whole), 0);
    EXPECT_NO_THROW(SegmentWriter{plan()});
    ::close(fd);
}

TEST_F(SegmentTest, SixteenSensorsFitOneMegabyte) {
    SegmentPlan p = plan(16);
    p.history = 0;
    const SegmentWriter writer(p);
    const Segment segment = Segment::open(name_);
    EXPECT_LE(segment.header().total_size, 1'000'000u);
    EXPECT_GE(segment.sensor(15).ring.slots, 128u);
}

TEST_F(SegmentTest, AReaderCannotCutTheWakePage) {
    const SegmentWriter writer(plan());
    EXPECT_NE(::ftruncate(writer.wake_page(), 0), 0);  // the daemon reads it: a SIGBUS
    EXPECT_EQ(::fcntl(writer.wake_page(), F_GET_SEALS), F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL);
}

TEST_F(SegmentTest, AWriterRemovesOnlyItsOwnFile) {
    auto first = std::make_unique<SegmentWriter>(plan());
    ::unlink(path_.c_str());  // by hand
    const SegmentWriter second(plan());
    first.reset();
    EXPECT_EQ(Segment::open(name_).header().epoch, second.epoch());
}

TEST_F(SegmentTest, AReaderOfADeadDaemonsFileIsToldOfTheSuccessor) {
    const pid_t child = ::fork();
    if (child == 0) {
        SegmentWriter writer(plan());
        writer.set_state(TACTILED_RUNNING);
        ::kill(::getpid(), SIGKILL);
    }
    ::waitpid(child, nullptr, 0);
    const Segment old = Segment::open(name_);
    EXPECT_TRUE(old.is_current());
    const SegmentWriter successor(plan());
    EXPECT_FALSE(old.is_current());
    EXPECT_EQ(old.header().state, unsigned(TACTILED_REPLACED));
}

TEST_F(SegmentTest, ABadSampleHasNoContact) {
    tactiled_sample s = sample(0);
    s.state = TACTILED_CONTACT | TACTILED_OVERLOAD;
    s.residual = s.cop_S_m[0] = 1;
    tactiled_invalidate(&s, TACTILED_STALE);
    EXPECT_EQ(s.state, 0u);
    EXPECT_TRUE(std::isnan(s.residual) && std::isnan(s.cop_S_m[0]) && std::isnan(s.cop_S_m[1]));
}

TEST_F(SegmentTest, ASampleNewerThanTheReadersClockIsGood) {
    tactiled_sample s = sample(0);
    const std::uint64_t now_ns = s.t_ns;
    s.t_ns += 1000;
    tactiled_judge(&s, 100, now_ns);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
}

TEST_F(SegmentTest, WhatAnOlderDaemonDoesNotFillReadsAsZeroInADirtySampleToo) {
    SegmentWriter writer(plan());
    writer.publish(0, sample(0));
    const Segment segment = Segment::open(name_);
    tactiled_ring ring = segment.sensor(0).ring;
    ring.record_size = 232;  // without state and peak
    tactiled_sample got;
    std::memset(&got, 0xFF, sizeof got);
    ASSERT_TRUE(tactiled_ring_read(segment.base(), &ring, 0, &got, sizeof got));
    EXPECT_EQ(got.state, 0u);
    EXPECT_EQ(got.peak_N, 0);
}

TEST_F(SegmentTest, ARingOrAHeaderThatIsTooSmallIsRefused) {
    SegmentWriter writer(plan());
    const auto why = [&](std::size_t offset, std::uint32_t value) {
        const int fd = ::open(path_.c_str(), O_RDWR);
        std::uint32_t before = 0;
        EXPECT_EQ(::pread(fd, &before, 4, off_t(offset)), 4);
        EXPECT_EQ(::pwrite(fd, &value, 4, off_t(offset)), 4);
        std::string text;
        EXPECT_FALSE(Segment::try_open(name_, text).is_open());
        EXPECT_EQ(::pwrite(fd, &before, 4, off_t(offset)), 4);
        ::close(fd);
        return text;
    };
    EXPECT_NE(why(offsetof(tactiled_header, header_size), sizeof(tactiled_header) - 4).find("truncated"), std::string::npos);
    EXPECT_NE(why(offsetof(tactiled_header, node) + offsetof(tactiled_ring, slots), 4).find("outside"), std::string::npos);
    EXPECT_TRUE(Segment::open(name_).is_open());
}

TEST_F(SegmentTest, AFollowerBeginsWithTheFirstOfTheSuccessor) {
    auto writer = std::make_unique<SegmentWriter>(plan());
    writer->set_state(TACTILED_RUNNING);
    Reader reader(name_, "s0");
    tactiled_sample s{};
    beat(*writer, 0);
    writer->publish(0, sample(0));
    ASSERT_TRUE(reader.next(s));
    writer.reset();
    ::usleep(20'000);  // no daemon starts faster
    SegmentWriter successor(plan());
    successor.set_state(TACTILED_RUNNING);
    beat(successor, 0);
    for (std::uint64_t n = 0; n < 5; ++n) successor.publish(0, sample(n));
    ASSERT_TRUE(reader.wait(s, 200));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    for (std::uint64_t n = 0; n < 5; ++n) {
        ASSERT_TRUE(reader.wait(s, 200));
        EXPECT_EQ(s.sequence, n);
    }
}

TEST_F(SegmentTest, ASampleOrADaemonOfAnotherClockIsNotBelieved) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    tactiled_sample s = sample(0);
    const std::uint64_t now_ns = s.t_ns;
    s.t_ns += 100'000'001;
    tactiled_judge(&s, 100, now_ns);
    EXPECT_EQ(s.reasons, unsigned(TACTILED_STALE));
    EXPECT_TRUE(std::isnan(s.force_S_N[2]));

    Reader reader(name_, "s0");
    tactiled_node node{};
    node.t_ns = monotonic_ns() + 3600'000'000'000u;
    writer.publish(node);
    writer.publish(0, sample(0));
    ASSERT_TRUE(reader.next(s));
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
}

TEST_F(SegmentTest, BeforeTheFirstSampleThereIsNoDataYet) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    EXPECT_EQ(Reader(name_, "s0").latest().reasons, unsigned(TACTILED_NO_DATA_YET));
}

TEST_F(SegmentTest, ANameThatIsTooLongIsRefusedNotCut) {
    const std::string longest(31, 'a');
    SegmentPlan p = plan();
    longest.copy(p.sensors[0].name, longest.size());
    SegmentWriter writer(p);
    writer.set_state(TACTILED_RUNNING);
    writer.publish(0, sample(0));
    EXPECT_EQ(Reader(name_, longest).latest().quality, unsigned(TACTILED_GOOD));
    for (const auto& [node, sensor] : {std::pair{name_, longest + "_right"}, {name_ + longest, longest}, {name_, ""}}) {
        Reader reader(node, sensor);
        ::usleep(20'000);  // also when it looks again
        tactiled_sample s{};
        EXPECT_FALSE(reader.next(s));
        EXPECT_EQ(reader.latest().reasons, unsigned(TACTILED_DAEMON_STOPPED));
        EXPECT_FALSE(reader.is_attached());
        EXPECT_NE(reader.why_not().find("1 to 31 characters"), std::string::npos) << reader.why_not();
    }
    std::string why;
    EXPECT_FALSE(Segment::try_open(std::string(100, 'a'), why).is_open());
    EXPECT_NE(why.find("1 to 31 characters"), std::string::npos) << why;
}

TEST_F(SegmentTest, APipeUnderItsNameStopsNoReader) {
    ASSERT_EQ(::mkfifo(path_.c_str(), 0640), 0);
    std::string why;
    EXPECT_FALSE(Segment::try_open(name_, why).is_open());
    EXPECT_NE(why.find("not a segment"), std::string::npos) << why;
}

TEST_F(SegmentTest, WhatIsLostAcrossARestartIsCounted) {
    auto writer = std::make_unique<SegmentWriter>(plan());
    writer->set_state(TACTILED_RUNNING);
    beat(*writer, 0);
    writer->publish(0, sample(0));
    Reader reader(name_, "s0");
    tactiled_sample s{};
    ASSERT_TRUE(reader.next(s));
    writer.reset();
    ::usleep(20'000);
    writer = std::make_unique<SegmentWriter>(plan());
    writer->set_state(TACTILED_RUNNING);
    beat(*writer, 0);
    for (std::uint64_t n = 0; n < 1000; ++n) writer->publish(0, sample(n));
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_GT(s.sequence, 900u);
    EXPECT_EQ(reader.lost(), s.sequence);
}

TEST_F(SegmentTest, LatestTakesNoEndFromNextAndWhatItSkipsIsCounted) {
    auto writer = std::make_unique<SegmentWriter>(plan());
    writer->set_state(TACTILED_RUNNING);
    beat(*writer, 0);
    writer->publish(0, sample(0));
    Reader reader(name_, "s0");
    tactiled_sample s{};
    ASSERT_TRUE(reader.next(s));
    for (std::uint64_t n = 1; n < 6; ++n) writer->publish(0, sample(n));
    for (const std::uint64_t lost : {5u, 5u + 3u}) {  // of the first; then of one that came and went unseen by next()
        writer.reset();
        ::usleep(20'000);
        writer = std::make_unique<SegmentWriter>(plan());
        writer->set_state(TACTILED_RUNNING);
        beat(*writer, 0);
        for (std::uint64_t n = 0; n < 3; ++n) writer->publish(0, sample(n));
        EXPECT_EQ(reader.latest().sequence, 2u);
        EXPECT_EQ(reader.lost(), lost);
    }
    reader.rewind();
    ASSERT_TRUE(reader.next(s));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    for (std::uint64_t n = 0; n < 3; ++n) {
        ASSERT_TRUE(reader.next(s));
        EXPECT_EQ(s.sequence, n);
        EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    }
    EXPECT_FALSE(reader.next(s));
    EXPECT_EQ(reader.lost(), 8u);
}

TEST_F(SegmentTest, ASleepingReaderIsWokenWhateverTheCountAndTheOldWish) {
    for (const auto& [first, wish] : {std::pair{std::uint64_t(0), 0u},
                                      {(1ull << 31) + 256, 0u},                   // the wish is that of an empty page
                                      {1000, 1000u + (1u << 30)},                 // of a reader that wrote nonsense
                                      {1000, 1000u + TACTILED_WAKE_RECORDS + 9},  // more than the daemon heeds
                                      {(1ull << 32) - 20, 0u}}) {
        SegmentWriter writer(plan());
        writer.set_state(TACTILED_RUNNING);
        beat(writer, first);
        writer.publish(0, sample(0));
        tactiled_reader reader;
        tactiled_reader_init(&reader, name_.c_str(), "s0");
        reader.wake = static_cast<std::uint32_t*>(
            ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, writer.wake_page(), 0));
        __atomic_store_n(reader.wake, wish, __ATOMIC_RELAXED);
        std::atomic<bool> stop{false};
        std::thread daemon([&, beats = first + 1]() mutable {
            for (std::uint64_t n = 1; !stop; ++n) {
                ::usleep(7'000);  // far from the 20 ms after which a reader wakes by itself
                tactiled_sample s = sample(n);
                s.t_published_ns = s.t_ns;
                writer.publish(0, s);
                beat(writer, beats++);
                writer.wake_readers();
            }
        });
        std::vector<std::uint64_t> late_ns;
        tactiled_sample s{};
        ASSERT_TRUE(tactiled_reader_wait(&reader, &s, 1000, TACTILED_BLOCK));
        while (late_ns.size() < 51) {
            ASSERT_TRUE(tactiled_reader_wait(&reader, &s, 1000, TACTILED_BLOCK));
            late_ns.push_back(monotonic_ns() - s.t_published_ns);
        }
        stop = true;
        daemon.join();
        tactiled_reader_detach(&reader);
        std::nth_element(late_ns.begin(), late_ns.begin() + 25, late_ns.end());
        EXPECT_LT(late_ns[25], 2'000'000u) << first << " " << wish;
    }
}

TEST_F(SegmentTest, AControlSocketThatDoesNotAnswerDelaysNoWaitAndIsAskedAgain) {
    SegmentPlan p = plan();
    p.control = "/tmp/tactiled-" + name_ + ".sock";
    p.watchdog_ms = 10'000;
    SegmentWriter writer(p);
    writer.set_state(TACTILED_RUNNING);
    beat(writer, 0);
    writer.publish(0, sample(0));
    const auto took_ms = [](tactiled_reader& reader, std::uint32_t timeout_ms) {
        tactiled_sample s{};
        while (tactiled_reader_next(&reader, &s) != 0) {}
        const std::uint64_t began_ns = monotonic_ns();
        EXPECT_FALSE(tactiled_reader_wait(&reader, &s, timeout_ms, TACTILED_BLOCK));
        return double(monotonic_ns() - began_ns) / 1e6;
    };
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    p.control.copy(address.sun_path, sizeof address.sun_path - 1);
    const int hung = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::bind(hung, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(::listen(hung, 1), 0);
    std::vector<int> queued;
    for (const bool full : {false, true}) {
        for (int last = 0; full && last == 0;) {
            queued.push_back(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
            last = ::connect(queued.back(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
        }
        tactiled_reader reader;
        tactiled_reader_init(&reader, name_.c_str(), "s0");
        EXPECT_LT(took_ms(reader, 5), 100) << full;   // 6 on an idle machine; it asked for a second
        EXPECT_LT(took_ms(reader, 50), 150) << full;  // and does not ask again
        if (!full) {
            tactiled_reader_detach(&reader);
            continue;
        }
        std::string why;
        const std::uint64_t began_ns = monotonic_ns();
        EXPECT_EQ(ask_daemon(p.control, "?", 50, why), "");  // what tactilectl and a new daemon do
        EXPECT_LT(monotonic_ns() - began_ns, 500'000'000u);
        ::close(hung);
        for (const int s : queued) ::close(s);
        Ring<Command> commands(4);
        const ControlSocket control(p.control, "", name_, writer, commands);
        took_ms(reader, 1200);
        EXPECT_NE(reader.wake, nullptr);
        tactiled_reader_detach(&reader);
    }
}

// Two at once were rare, one of 400 rounds; the wrong pid is not. The test below is certain.
TEST_F(SegmentTest, OfManyStartersOneWinsThoughAReaderHoldsALock) {
    for (int round = 0; round < 20; ++round) {
        const pid_t dead = ::fork();
        if (dead == 0) {
            SegmentWriter writer(plan());
            ::kill(::getpid(), SIGKILL);
        }
        ::waitpid(dead, nullptr, 0);
        const int fd = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
        struct flock whole {};
        whole.l_type = F_RDLCK;
        if (round % 2 == 0) { ASSERT_EQ(::fcntl(fd, F_OFD_SETLK, &whole), 0); }
        int go[2], end[2], result[2];  // the first two are for waiting until they are closed
        ASSERT_TRUE(::pipe(go) == 0 && ::pipe(end) == 0 && ::pipe(result) == 0);
        std::vector<pid_t> starters;
        for (int i = 0; i < 8; ++i) {
            starters.push_back(::fork());
            if (starters.back() != 0) continue;
            char byte = 0;
            ::close(go[1]);
            ::close(end[1]);
            ::close(fd);
            (void)!::read(go[0], &byte, 1);
            try {
                SegmentWriter writer(plan());
                (void)!::write(result[1], "1", 1);
                (void)!::read(end[0], &byte, 1);
            } catch (const SetupError& error) {
                // The dead one's pid would send its reader after nobody.
                const bool right = std::string(error.what()).find("pid " + std::to_string(dead)) == std::string::npos;
                (void)!::write(result[1], right ? "0" : "x", 1);
            }
            ::_exit(0);
        }
        ::close(go[0]);
        ::close(go[1]);
        ::close(end[0]);
        std::string results;
        for (char byte = 0; results.size() < starters.size() && ::read(result[0], &byte, 1) == 1;) results += byte;
        ::close(end[1]);
        for (const pid_t starter : starters) ::waitpid(starter, nullptr, 0);
        ::close(result[0]);
        ::close(result[1]);
        ::close(fd);
        std::sort(results.begin(), results.end());
        ASSERT_EQ(results, "00000001") << round;
    }
}

TEST_F(SegmentTest, WhoStartsIsWaitedForAndWhatAKilledOneLeftIsTakenOver) {
    const std::string turn = "/dev/shm/.tactiled." + name_;
    const int fd = ::open(turn.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    struct flock whole {};
    whole.l_type = F_WRLCK;
    ASSERT_EQ(::fcntl(fd, F_OFD_SETLK, &whole), 0);
    try {
        SegmentWriter writer(plan());
        ADD_FAILURE() << "started beside another";
    } catch (const SetupError& error) {
        EXPECT_NE(std::string(error.what()).find("another daemon of this name is starting"), std::string::npos)
            << error.what();
    }
    ::close(fd);
    EXPECT_EQ(::access(turn.c_str(), F_OK), 0);
    const SegmentWriter writer(plan());
    EXPECT_NE(::access(turn.c_str(), F_OK), 0);
}

}  // namespace
}  // namespace tactiled
