// The end of a daemon, and its successor.
#include "segment_fixture.hpp"

namespace tactiled {
namespace {

TEST_F(SegmentTest, ASecondDaemonLearnsThePidOfTheFirst) {
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
    ::usleep(20'000);  // a reader searches for a successor each 10 ms
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

TEST_F(SegmentTest, AFollowerLearnsOnceThatTheDaemonIsDead) {
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
    EXPECT_EQ(s.sequence, 1u);                     // first the remaining samples
    EXPECT_EQ(s.quality, unsigned(TACTILED_BAD));  // and old
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    EXPECT_TRUE(std::isnan(s.force_S_N[2]));
    EXPECT_FALSE(reader.wait(s, 100));  // once
    beat(writer, 1);                    // the daemon had only hung
    writer.publish(0, sample(2));
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_EQ(s.sequence, 2u);
    EXPECT_EQ(s.quality, unsigned(TACTILED_GOOD));
    ::usleep(300'000);
    ASSERT_TRUE(reader.wait(s, 100));  // and hangs again
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
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

TEST_F(SegmentTest, AWriterRemovesOnlyItsOwnFile) {
    auto first = std::make_unique<SegmentWriter>(plan());
    ::unlink(path_.c_str());  // by hand
    const SegmentWriter second(plan());
    first.reset();
    EXPECT_EQ(Segment::open(name_).header().epoch, second.epoch());
}

TEST_F(SegmentTest, AReaderOfADeadDaemonsFileLearnsOfTheSuccessor) {
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

TEST_F(SegmentTest, WhatIsLostAcrossARestartIsCounted) {
    auto writer = alive();
    writer->publish(0, sample(0));
    Reader reader(name_, "s0");
    tactiled_sample s{};
    ASSERT_TRUE(reader.next(s));
    writer.reset();
    ::usleep(20'000);
    writer = alive();
    for (std::uint64_t n = 0; n < 1000; ++n) writer->publish(0, sample(n));
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_NE(s.reasons & TACTILED_DAEMON_STOPPED, 0u);
    ASSERT_TRUE(reader.wait(s, 100));
    EXPECT_GT(s.sequence, 900u);
    EXPECT_EQ(reader.lost(), s.sequence);
}

TEST_F(SegmentTest, LatestTakesNoEndFromNextAndWhatItSkipsIsCounted) {
    auto writer = alive();
    writer->publish(0, sample(0));
    Reader reader(name_, "s0");
    tactiled_sample s{};
    ASSERT_TRUE(reader.next(s));
    for (std::uint64_t n = 1; n < 6; ++n) writer->publish(0, sample(n));
    // of the first one; then of one that started and ended unseen by next()
    for (const std::uint64_t lost : {5u, 5u + 3u}) {
        writer.reset();
        ::usleep(20'000);
        writer = alive();
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

// Two winners at once were rare, one in 400 rounds; a wrong pid is not. The test below is certain.
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
        int go[2], end[2], result[2];  // the first two are closed to end a wait
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
                // With the dead one's pid, a reader would look for a missing process.
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
    const std::string turn = runtime_folder() + "/.tactiled." + name_;
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
