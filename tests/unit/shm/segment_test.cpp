// The segment between writer and reader, in real shared memory: reads and refusals.
#include <cmath>

#include "segment_fixture.hpp"

namespace tactiled {
namespace {

TEST_F(SegmentTest, GivesTheNewestAndThenNothingNew) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    Reader reader(name_, "s0");
    ASSERT_TRUE(reader.is_attached()) << reader.why_not();
    EXPECT_EQ(reader.latest().quality, unsigned(TACTILED_BAD));  // none yet: never zeros that seem good
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
        if (s.quality != TACTILED_GOOD) continue;  // overwritten in each of its attempts: reported, not guessed
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

TEST_F(SegmentTest, AReaderRefusesAnArrayThatLiesOutside) {
    SegmentPlan with_array = plan(2);
    with_array.sensors[1].n_taxels = 6;
    with_array.sensors[1].taxel_components = 7;
    with_array.places = {{}, std::vector<float>(36, 0)};
    SegmentWriter writer(with_array);
    ASSERT_TRUE(Segment::open(name_).has_array(1));
    EXPECT_FALSE(Segment::open(name_).has_array(0));
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    const std::size_t entry = Segment::open(name_).header().sensor_offset + sizeof(tactiled_sensor);
    const auto refuses = [&](std::size_t field, std::uint32_t value) {
        std::uint32_t before = 0;
        std::string why;
        file.seekg(long(entry + field)).read(reinterpret_cast<char*>(&before), 4);
        file.seekp(long(entry + field)).write(reinterpret_cast<const char*>(&value), 4).flush();
        const bool refused = !Segment::try_open(name_, why).is_open() && why.find("array lies outside") != std::string::npos;
        file.seekp(long(entry + field)).write(reinterpret_cast<const char*>(&before), 4).flush();
        return refused;
    };
    EXPECT_TRUE(refuses(offsetof(tactiled_sensor, n_taxels), TACTILED_MAX_TAXELS + 1));
    EXPECT_TRUE(refuses(offsetof(tactiled_sensor, n_taxels), 1000));  // more than a record has
    EXPECT_TRUE(refuses(offsetof(tactiled_sensor, n_taxels), 0));
    EXPECT_TRUE(refuses(offsetof(tactiled_sensor, taxel_place_offset), 1u << 30));
    EXPECT_TRUE(refuses(offsetof(tactiled_sensor, taxel_rows), 1u << 31));
    EXPECT_TRUE(refuses(offsetof(tactiled_sensor, arrays) + offsetof(tactiled_ring, offset), 1u << 30));
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
        EXPECT_NE(patched(offsetof(tactiled_header, major), 2, 2).find("version 2.10, this reader knows 1.10"),
                  std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, byte_order), 0x04030201, 4).find("byte order"), std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, total_size), 1u << 30, 4).find("truncated"), std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, n_sensors), TACTILED_MAX_SENSORS + 1, 4).find("more sensors"),
                  std::string::npos);
        EXPECT_NE(patched(offsetof(tactiled_header, n_links), TACTILED_MAX_LINKS + 1, 4).find("more sensors"),
                  std::string::npos);
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
    writer.count_reasons(0, TACTILED_STALE | TACTILED_DRIFTED);
    writer.count_reasons(0, TACTILED_STALE);
    const Segment counted = Segment::open(name_);
    EXPECT_EQ(tactiled_reason_count(counted.c(), 0, 1), 2u);   // stale
    EXPECT_EQ(tactiled_reason_count(counted.c(), 0, 18), 1u);  // drifted
    EXPECT_EQ(tactiled_reason_count(counted.c(), 0, 0), 0u);
    patch(offsetof(tactiled_header, sensor_size), TACTILED_SENSOR_SIZE_1_0);  // a directory without the methods of "auto"
    const Segment old = Segment::open(name_);
    ASSERT_TRUE(old.latest(0, got));
    EXPECT_STREQ(tactiled_methods_of(old.c(), 0), "");
    EXPECT_EQ(tactiled_reason_count(old.c(), 0, 1), 0u);  // there are no counts, either
    patch(offsetof(tactiled_header, major), std::uint16_t(2));
    std::string why;
    EXPECT_FALSE(Segment::try_open(name_, why).is_open());
    EXPECT_NE(why.find("version 2.7, this reader knows 1.10"), std::string::npos) << why;
}

TEST_F(SegmentTest, TheBoundOfAnAgeIsRoundedUpSaturatesAndIsNotKnownFromAnOlderDaemon) {
    SegmentWriter writer(plan(2));
    writer.set_state(TACTILED_RUNNING);
    const Segment segment = Segment::open(name_);
    EXPECT_EQ(tactiled_age_bound_us_of(segment.c(), 1), TACTILED_AGE_UNBOUNDED) << "no frame yet";
    const auto published = [&](double bound_ns, std::uint32_t freshness = TACTILED_BY_CLOCK) {
        writer.set_age(1, freshness, bound_ns);
        return tactiled_age_bound_us_of(segment.c(), 1);
    };
    EXPECT_EQ(published(12'345'001), 12'346u);
    EXPECT_EQ(published(0), 0u);
    EXPECT_EQ(published(4294967293001.0), TACTILED_AGE_UNBOUNDED - 1);
    EXPECT_EQ(published(1e300), TACTILED_AGE_UNBOUNDED);
    EXPECT_EQ(published(std::nan("")), TACTILED_AGE_UNBOUNDED);
    EXPECT_EQ(published(5e6, TACTILED_FRESHNESS_UNKNOWN), TACTILED_AGE_UNBOUNDED);
    EXPECT_EQ(published(5e6), 5'000u);
    EXPECT_EQ(tactiled_age_bound_us_of(segment.c(), 0), TACTILED_AGE_UNBOUNDED) << "another sensor";
    writer.begin_reload();
    writer.set_sensor(1, plan(2).sensors[1]);
    writer.end_reload(1);
    EXPECT_EQ(tactiled_age_bound_us_of(segment.c(), 1), 5'000u) << "a reload changes no age";
    writer.set_age(0, TACTILED_BY_CABLE, 5e6);
    const std::uint32_t older[] = {1, segment.header().sensor_offset, TACTILED_SENSOR_SIZE_1_5};
    const int fd = ::open(path_.c_str(), O_RDWR);
    ASSERT_EQ(::pwrite(fd, older, sizeof older, offsetof(tactiled_header, n_sensors)), ssize_t(sizeof older));
    ::close(fd);
    const Segment old = Segment::open(name_);
    EXPECT_EQ(tactiled_freshness_of(old.c(), 0), unsigned(TACTILED_BY_CABLE));
    EXPECT_EQ(tactiled_age_bound_us_of(old.c(), 0), TACTILED_AGE_UNBOUNDED);
    EXPECT_TRUE(std::isnan(tactiled_undetected_of(old.c(), 0).mean)) << "not 0, which would be the best";
}

TEST_F(SegmentTest, AFileThatOthersMayWriteIsNoDaemons) {
    SegmentWriter writer(plan());
    ASSERT_EQ(::chmod(path_.c_str(), 0660), 0);
    std::string why;
    EXPECT_FALSE(Segment::try_open(name_, why).is_open());
    EXPECT_NE(why.find("others than its owner may write it"), std::string::npos);
}

TEST_F(SegmentTest, CountsHowLateTheLoopWoke) {
    for (std::uint32_t i = 0; i < TACTILED_LATENESS_BUCKETS; ++i) {  // no gap, no overlap, 1/8 octave or 128 ns wide
        const std::uint64_t from = tactiled_lateness_ns(i), to = tactiled_lateness_ns(i + 1);
        EXPECT_EQ(tactiled_lateness_bucket(from), i);
        EXPECT_EQ(tactiled_lateness_bucket(to - 1), i);
        EXPECT_LE(to - from, std::max<std::uint64_t>(128, from / 8));
    }
    EXPECT_EQ(tactiled_lateness_bucket(UINT64_MAX), TACTILED_LATENESS_BUCKETS - 1u);
    SegmentWriter writer(plan());
    const Segment segment = Segment::open(name_);
    EXPECT_TRUE(std::isnan(lateness_quantile_ns(segment.lateness(), 0.5)));
    for (int i = 0; i < 99; ++i) writer.count_lateness(10'000);
    writer.count_lateness(5'000'000);
    EXPECT_NEAR(lateness_quantile_ns(segment.lateness(), 0.5), 10'000, 10'000 / 8);
    EXPECT_NEAR(lateness_quantile_ns(segment.lateness(), 0.99), 10'000, 10'000 / 8);
    EXPECT_NEAR(lateness_quantile_ns(segment.lateness(), 1), 5'000'000, 5'000'000 / 8);
}

TEST_F(SegmentTest, SixteenSensorsFitTwoMegabytes) {
    SegmentPlan p = plan(16);
    p.history = 0;
    const SegmentWriter writer(p);
    const Segment segment = Segment::open(name_);
    EXPECT_LE(segment.header().total_size, 2'000'000u);
    EXPECT_GE(segment.sensor(15).ring.slots, 128u);
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

TEST_F(SegmentTest, ALinkWhoseRingLiesOutsideAndANameWithoutAnEndAreRefused) {
    SegmentPlan p = plan();
    p.links.resize(1);
    SegmentWriter writer(p);
    const auto header = Segment::open(name_).header();
    const auto why = [&](std::size_t offset, const std::string& bytes) {
        const int fd = ::open(path_.c_str(), O_RDWR);
        std::string before(bytes.size(), 0), text;
        EXPECT_EQ(::pread(fd, before.data(), before.size(), off_t(offset)), ssize_t(before.size()));
        EXPECT_EQ(::pwrite(fd, bytes.data(), bytes.size(), off_t(offset)), ssize_t(bytes.size()));
        EXPECT_FALSE(Segment::try_open(name_, text).is_open());
        EXPECT_EQ(::pwrite(fd, before.data(), before.size(), off_t(offset)), ssize_t(before.size()));
        ::close(fd);
        return text;
    };
    const std::string name(TACTILED_NAME_SIZE, 'x');
    EXPECT_NE(why(header.link_offset + offsetof(tactiled_link, frames), "\x80\xFF\xFF\x7F").find("a link's ring"),
              std::string::npos);
    EXPECT_NE(why(header.link_offset + offsetof(tactiled_link, taxels) + 8, "\x10").find("a link's taxels"),
              std::string::npos);
    EXPECT_NE(why(header.link_offset, name).find("a name of a link"), std::string::npos);
    EXPECT_NE(why(header.sensor_offset + offsetof(tactiled_sensor, link), name).find("a name of a sensor"),
              std::string::npos);
    EXPECT_NE(why(offsetof(tactiled_header, name), name).find("a name has no end"), std::string::npos);
    EXPECT_TRUE(Segment::open(name_).is_open());
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

TEST_F(SegmentTest, TheClockAfterTheCopyJudgesARecord) {
    constexpr std::uint64_t kHour_ns = 3600'000'000'000u;
    SegmentPlan p = plan();
    p.sensors[0].stale_ms = 10'000;
    SegmentWriter writer(p);
    writer.set_state(TACTILED_RUNNING);
    const Segment segment = Segment::open(name_);
    const auto quality_of = [&](std::uint64_t t_ns, std::uint64_t now_ns) {
        tactiled_sample s = sample(0);
        s.t_ns = t_ns;
        tactiled_node node{};
        node.t_ns = t_ns;
        node.grasp.weight_kg = 1;
        writer.publish(0, s);
        writer.publish(node);
        EXPECT_TRUE(segment.latest(0, s, now_ns));
        EXPECT_TRUE(segment.latest_node(node, now_ns));
        EXPECT_EQ(std::isnan(node.grasp.weight_kg), s.quality == TACTILED_BAD);
        return s.quality;
    };
    const std::uint64_t now_ns = monotonic_ns(), old_ns = now_ns - 20'000'000'000u;
    EXPECT_EQ(quality_of(now_ns, old_ns), unsigned(TACTILED_GOOD)) << "interrupted before the copy";
    EXPECT_EQ(quality_of(old_ns, old_ns), unsigned(TACTILED_BAD)) << "interrupted before or after the copy";
    EXPECT_EQ(quality_of(now_ns, now_ns + kHour_ns), unsigned(TACTILED_BAD)) << "a later time that is given";
    EXPECT_EQ(quality_of(now_ns + kHour_ns, now_ns), unsigned(TACTILED_BAD)) << "another clock";
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
        ::usleep(20'000);  // also at the next attempt
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

}  // namespace
}  // namespace tactiled
