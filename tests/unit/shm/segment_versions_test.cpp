// A reader of 1.0 with a daemon of 1.1, and the reverse: minor versions append, and fields that are not written are
// unknown.
#include "segment_fixture.hpp"

namespace tactiled {
namespace {

constexpr std::uint32_t kNodeOf10 = offsetof(tactiled_node, grasp);  // 1.0 ended here

class SegmentVersions : public SegmentTest {
protected:
    // Publishes a node record with a grasp that holds an object.
    void publish(SegmentWriter& writer, std::uint64_t age_ns = 0) {
        tactiled_node node{};
        node.t_ns = monotonic_ns() - age_ns;
        node.heartbeat = 7;
        node.count[15] = 9;
        node.grasp.state = TACTILED_GRIP_HOLDING;
        node.grasp.weight_state = TACTILED_WEIGHT_STABLE;
        node.grasp.weight_kg = 0.25;
        node.grasp.slips = 3;
        node.grasp.object_id = 2;
        writer.publish(node);
    }
    // Makes the segment one of an older daemon: its header states the size of its node records.
    void as_written_by_10() const {
        const int fd = ::open(path_.c_str(), O_RDWR);
        tactiled_header header{};
        ASSERT_EQ(::pread(fd, &header, sizeof header, 0), ssize_t(sizeof header));
        header.minor = 0;
        header.node.record_size = kNodeOf10;
        ASSERT_EQ(::pwrite(fd, &header, sizeof header, 0), ssize_t(sizeof header));
        ::close(fd);
    }
};

TEST_F(SegmentVersions, AReaderOf10ReadsTheFirstPartOfARecordOf11) {
    const auto writer = alive();
    publish(*writer);
    const Segment segment = Segment::open(name_);
    EXPECT_EQ(segment.header().minor, TACTILED_MINOR);
    EXPECT_EQ(kNodeOf10, 208u);
    alignas(tactiled_node) unsigned char record[kNodeOf10];
    ASSERT_TRUE(tactiled_ring_latest(segment.base(), &segment.header().node, record, sizeof record));
    tactiled_node old{};
    std::memcpy(&old, record, sizeof record);
    EXPECT_EQ(old.heartbeat, 7u);
    EXPECT_EQ(old.count[15], 9u);
}

TEST_F(SegmentVersions, AReaderOf11KnowsNoGraspOfADaemonOf10) {
    const auto writer = alive();
    publish(*writer);
    as_written_by_10();
    tactiled_node node{};
    ASSERT_TRUE(Segment::open(name_).latest_node(node));
    EXPECT_EQ(node.heartbeat, 7u);
    EXPECT_EQ(node.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));  // not open, which is 0
    EXPECT_TRUE(std::isnan(node.grasp.weight_kg));                 // not 0 kg
    EXPECT_EQ(node.grasp.slip_state[0], TACTILED_SLIP_UNKNOWN);
}

TEST_F(SegmentVersions, ThePlaceOfASampleHasAnSdAndNoneFromAnOlderDaemon) {
    const auto writer = alive();
    tactiled_placed placed{};
    placed.sample.t_ns = placed.sample.t_published_ns = monotonic_ns();
    placed.sample.quality = TACTILED_GOOD;
    placed.sample.cop_S_m[0] = 0.003;
    placed.cop_sd_m[0] = 1e-4f;
    placed.budget.sd_part[TACTILED_OF_ZERO][2] = 0.25f;
    placed.budget.model = 7;
    writer->publish(0, placed);
    tactiled_placed seen{};
    ASSERT_TRUE(Segment::open(name_).latest(0, seen));
    EXPECT_EQ(seen.sample.cop_S_m[0], 0.003);
    EXPECT_EQ(seen.cop_sd_m[0], 1e-4f);
    EXPECT_EQ(seen.budget.sd_part[TACTILED_OF_ZERO][2], 0.25f);
    EXPECT_EQ(seen.budget.model, 7u);
    ASSERT_TRUE(Segment::open(name_).latest(0, seen, monotonic_ns() + 200'000'000));
    EXPECT_EQ(seen.sample.quality, unsigned(TACTILED_BAD));
    EXPECT_TRUE(std::isnan(seen.cop_sd_m[0]) && std::isnan(seen.cop_sd_m[1]));
    EXPECT_TRUE(std::isnan(seen.budget.sd_part[TACTILED_OF_ZERO][2]) && std::isnan(seen.budget.alike_within));
    EXPECT_EQ(seen.budget.model, 0u);

    const auto write_record_size = [&](std::uint32_t size) {
        const int fd = ::open(path_.c_str(), O_RDWR);
        const auto at = off_t(Segment::open(name_).header().sensor_offset + offsetof(tactiled_sensor, ring) +
                              offsetof(tactiled_ring, record_size));
        EXPECT_EQ(::pwrite(fd, &size, sizeof size, at), ssize_t(sizeof size));
        ::close(fd);
    };
    write_record_size(offsetof(tactiled_placed, budget));  // 1.9
    ASSERT_TRUE(Segment::open(name_).latest(0, seen));
    EXPECT_EQ(seen.cop_sd_m[0], 1e-4f);
    EXPECT_TRUE(std::isnan(seen.budget.sd_part[TACTILED_OF_ZERO][2]));
    EXPECT_EQ(seen.budget.model, 0u);
    write_record_size(sizeof(tactiled_sample));  // 1.8
    ASSERT_TRUE(Segment::open(name_).latest(0, seen));
    EXPECT_EQ(seen.sample.cop_S_m[0], 0.003);
    EXPECT_TRUE(std::isnan(seen.cop_sd_m[0]) && std::isnan(seen.budget.sd_part[TACTILED_OF_ZERO][2]));
}

TEST_F(SegmentVersions, ADaemonBefore19HasNoRawTaxels) {
    SegmentPlan with_taxels = plan();
    with_taxels.links.resize(1);
    with_taxels.links[0].taxels.record_size = tactiled_taxels_size(12);
    SegmentWriter writer(with_taxels);
    EXPECT_EQ(Segment::open(name_).c()->taxels[0].slots, 128u);
    const int fd = ::open(path_.c_str(), O_RDWR);
    const std::uint16_t minor = 8;
    ASSERT_EQ(::pwrite(fd, &minor, sizeof minor, offsetof(tactiled_header, minor)), ssize_t(sizeof minor));
    ::close(fd);
    EXPECT_EQ(Segment::open(name_).c()->taxels[0].slots, 0u);
}

TEST_F(SegmentVersions, AGraspIsReadAsItWasWritten) {
    const auto writer = alive();
    publish(*writer);
    tactiled_node node{};
    ASSERT_TRUE(Segment::open(name_).latest_node(node));
    EXPECT_EQ(node.grasp.state, unsigned(TACTILED_GRIP_HOLDING));
    EXPECT_EQ(node.grasp.weight_kg, 0.25);
}

TEST_F(SegmentVersions, AnOldGraspIsNotKnownButWhatWasCountedStays) {
    const auto writer = alive();
    publish(*writer,
            101'000'000);  // longer than stale_ms, less than watchdog_ms: the loop is slow, the sensors may be silent
    tactiled_node node{};
    ASSERT_TRUE(Segment::open(name_).latest_node(node));
    EXPECT_EQ(node.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));
    EXPECT_TRUE(std::isnan(node.grasp.weight_kg));
    EXPECT_EQ(node.grasp.weight_state, unsigned(TACTILED_WEIGHT_NONE));
    EXPECT_EQ(node.grasp.object_id, 0u);
    EXPECT_EQ(node.grasp.slips, 3u);
}

TEST_F(SegmentVersions, TheGraspOfADaemonThatEndedIsNotKnown) {
    const auto writer = alive();
    publish(*writer);
    const Segment segment = Segment::open(name_);
    writer->set_state(TACTILED_STOPPED);
    tactiled_node node{};
    ASSERT_TRUE(segment.latest_node(node));
    EXPECT_EQ(node.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));
}

}  // namespace
}  // namespace tactiled
