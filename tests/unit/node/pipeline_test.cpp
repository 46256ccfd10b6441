// Links, rings, sensors and segment together: frames, discontinuities, the heartbeat and the end.
#include "pipeline_fixture.hpp"

#include <cmath>

namespace tactiled {
namespace {

TEST_F(PipelineTest, CarriesAFrameToItsSensorAndNoOther) {
    send(0, 5);
    acquire_all(0);
    turn();
    const auto s = look();
    EXPECT_EQ(s.sensor[0].force_S_N[0], 5);
    EXPECT_EQ(s.sensor[0].quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.sensor[1].quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(s.sensor[1].reasons & TACTILED_NO_DATA_YET, unsigned(TACTILED_NO_DATA_YET));
    EXPECT_EQ(s.node.status & TACTILED_READY, 0u);  // not all sensors are
}

TEST_F(PipelineTest, RefusesTheNewestWhenTheLoopIsLateAndTellsHowMany) {
    constexpr int kSent = int(Link::kRingFrames) + 40;
    for (int i = 0; i < kSent; ++i) send(0, i);
    acquire_all(0);
    turn();
    auto s = look();
    EXPECT_EQ(s.sensor[0].force_S_N[0], double(Link::kRingFrames) - 1);  // the oldest were kept
    EXPECT_EQ(s.node.fault & TACTILED_FAULT_OVERRUN, unsigned(TACTILED_FAULT_OVERRUN));
    EXPECT_EQ(links_[0]->driver->counts[TACTILED_LINK_RING_FULL], 40u);
    send(0, 99);
    acquire_all(0);
    turn();
    s = look();
    EXPECT_EQ(s.sensor[0].force_S_N[0], 99);
    EXPECT_EQ(s.sensor[0].lost, 40u);
    EXPECT_EQ(s.node.warning & TACTILED_WARN_LOST, unsigned(TACTILED_WARN_LOST));
    turn(2000);
    EXPECT_EQ(look().node.warning, 0u);
}

TEST_F(PipelineTest, ALinkWhoseAgeIsNotProvedIsOpenedAgainOnceAndThenLessOften) {
    const std::uint64_t ms = 1'000'000;
    links_[0]->age.add(0, 100 * ms);
    driver_[0]->way = {.path = Route::Path::network, .reopening_discards = true};
    std::uint64_t t_ns = monotonic_ns() - 30'000 * ms;
    std::uint32_t sequence = 0;
    const auto send_counted = [&](int frames) {
        for (int i = 0; i < frames; ++i, t_ns += 10 * ms) {
            Frame f;
            f.t_ns = t_ns;
            f.n_channels = 1;
            f.has_sequence = true;
            f.sequence = sequence++;
            driver_[0]->frames.push_back(f);
        }
    };
    const auto last_of_all = [&] {
        bool stays_open = true;
        while (driver_[0]->has_more()) {
            now_ = driver_[0]->frames.front().t_ns;
            stays_open = acquire(*links_[0], segment_, 0) != Status::disconnected && stays_open;
            turn(0);
        }
        return std::pair(sensors_[0].last(), stays_open);
    };
    send_counted(10);
    auto [sample, stays_open] = last_of_all();
    EXPECT_EQ(sample.reasons, unsigned(TACTILED_UNPROVED_AGE)) << "they may have waited before the start";
    EXPECT_FALSE(stays_open) << "the link is to be opened again";
    links_[0]->opened(t_ns + 190 * ms, true);
    t_ns += 195 * ms;
    sequence += 19;  // the frames of the time in which the link was closed are missing
    send_counted(150);
    std::tie(sample, stays_open) = last_of_all();
    EXPECT_EQ(sample.reasons, 0u);
    EXPECT_TRUE(stays_open);
    turn(20);
    EXPECT_EQ(tactiled_freshness_of(Segment::open(plan_.name).c(), 0), unsigned(TACTILED_BY_SEQUENCE));
    t_ns += 2'000 * ms;  // the device pauses, or a link was down: its next number comes 2 s later
    send_counted(100);
    std::tie(sample, stays_open) = last_of_all();
    EXPECT_EQ(sample.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(sample.reasons, unsigned(TACTILED_UNPROVED_AGE));
    EXPECT_TRUE(stays_open) << "it was opened less than a second ago";
}

TEST_F(PipelineTest, PublishesTheBoundOfTheAgeWithItsProof) {
    links_[0]->age.add(0, 100'000'000);
    driver_[0]->way = {.path = Route::Path::network, .device_clock = true};
    const Segment segment = Segment::open(plan_.name);
    const auto bound_us = [&](std::uint32_t sensor) { return tactiled_age_bound_us_of(segment.c(), sensor); };
    const auto arrive = [&](int frames, std::uint64_t delay_ms) {
        for (int i = 0; i < frames; ++i) {
            send(0, i);
            driver_[0]->frames.back().device_time_us = 1'000'000'000 + now_ / 1000 - 1000 * delay_ms;
            acquire_all(0);
            turn(10);
        }
    };
    EXPECT_EQ(bound_us(0), TACTILED_AGE_UNBOUNDED) << "no frame yet";
    arrive(100, 0);
    EXPECT_EQ(tactiled_freshness_of(segment.c(), 0), unsigned(TACTILED_BY_CLOCK));
    EXPECT_LT(bound_us(0), 25'000u);
    arrive(1, 20);
    EXPECT_GE(bound_us(0), 30'000u) << "20 ms on the way and 10 ms here";
    turn(500);
    EXPECT_GE(bound_us(0), 530'000u) << "no frame since then";
    EXPECT_EQ(bound_us(1), TACTILED_AGE_UNBOUNDED);
}

TEST_F(PipelineTest, CountsFramesOfADeviceThatNobodyReads) {
    send(0, 1, 9);
    acquire_all(0);
    turn();
    EXPECT_EQ(Segment::open(plan_.name).link(0).count[TACTILED_LINK_UNBOUND], 1u);
    EXPECT_EQ(look().sensor[0].quality, unsigned(TACTILED_BAD));
}

TEST_F(PipelineTest, ShowsEveryFrameOfALinkBesideItsSamples) {
    send(0, 5);
    send(0, 6, 9);  // from a device that no sensor reads
    acquire_all(0);
    turn();
    const Segment segment = Segment::open(plan_.name);
    const tactiled_ring& ring = segment.link(0).frames;
    ASSERT_EQ(tactiled_ring_head(segment.base(), &ring), 2u);
    for (const std::uint32_t n : {0u, 1u}) {
        tactiled_frame frame;
        ASSERT_EQ(tactiled_ring_read(segment.base(), &ring, n, &frame, sizeof frame), 1);
        EXPECT_EQ(frame.channel[0], 5.0 + n);
        EXPECT_EQ(frame.device, n == 0 ? 0 : 9);
        EXPECT_GE(frame.n_channels, 1);
    }
    EXPECT_EQ(tactiled_ring_head(segment.base(), &segment.link(1).frames), 0u);
}

TEST_F(PipelineTest, TheHeartbeatBeatsWithDataAndStopsWithThem) {
    send(0, 1);
    acquire_all(0);
    turn();
    const auto before = look().node.heartbeat;
    for (int i = 0; i < 90; ++i) turn(1);
    turn(9);  // 100 ms after the start and the frame
    EXPECT_EQ(look().node.heartbeat, before + 1);
    turn(1);  // now it is stale
    const auto stopped = look().node.heartbeat;
    for (int i = 0; i < 10; ++i) turn(100);
    EXPECT_EQ(look().node.heartbeat, stopped);
    EXPECT_NE(look().node.status & TACTILED_ANY_STALE, 0u);
    EXPECT_NE(look().node.fault & TACTILED_FAULT_SENSOR_LOST, 0u);
    send(0, 2);
    acquire_all(0);
    turn(1);
    turn(99);
    EXPECT_GT(look().node.heartbeat, stopped);
}

TEST_F(PipelineTest, WhatArrivedBeforeTheDiscontinuityIsDeliveredBeforeIt) {
    send(0, 1);
    acquire_all(0);
    links_[0]->connected = false;
    turn();
    tactiled_sample last{};
    const auto segment = Segment::open(plan_.name);
    Snapshot s = look();
    EXPECT_EQ(s.sensor[0].quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(s.sensor[0].reasons, unsigned(TACTILED_DISCONNECTED));
    ASSERT_TRUE(
        tactiled_ring_read(segment.base(), &segment.sensor(0).ring, std::uint32_t(s.node.count[0]) - 2, &last, sizeof last));
    EXPECT_EQ(last.force_S_N[0], 1);
    EXPECT_EQ(last.quality, unsigned(TACTILED_GOOD));
}

TEST_F(PipelineTest, PublishesANodeRecordEvenWithoutNews) {
    for (int i = 0; i < 100; ++i) turn(1);
    auto before = look().node.sequence;
    for (int i = 0; i < 400; ++i) turn(1);
    EXPECT_EQ(look().node.sequence, before + 4);  // each 100 ms while no sensor delivers
    send(0, 1);
    acquire_all(0);
    turn(1);
    before = look().node.sequence;
    for (int i = 0; i < 40; ++i) turn(1);
    EXPECT_EQ(look().node.sequence, before + 4);  // each 10 ms
}

TEST_F(PipelineTest, TheLastWordIsBad) {
    send(0, 1);
    acquire_all(0);
    turn();
    pipeline_->stop(now_);
    const auto s = look();
    EXPECT_EQ(s.sensor[0].quality, unsigned(TACTILED_BAD));
    EXPECT_NE(s.sensor[0].reasons & TACTILED_DAEMON_STOPPED, 0u);
    EXPECT_EQ(s.node.status & TACTILED_READY, 0u);
}

}  // namespace
}  // namespace tactiled
