// Links, rings, sensors and segment together, on a clock controlled by the test; the driver follows a script.
#include "node/pipeline.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <deque>
#include <filesystem>

#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

class Scripted final : public Driver {
public:
    std::string open() override { return ""; }
    Status read(Frame& frame, int) noexcept override {
        if (frames.empty()) return Status::timeout;
        frame = frames.front();
        frames.pop_front();
        return Status::frame;
    }
    void close() noexcept override {}
    bool has_more() const noexcept override { return !frames.empty(); }
    Route route() const noexcept override { return way; }
    std::deque<Frame> frames;
    Route way;
};

class Constant final : public Decoupler {
public:
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        e.wrench_S = {r.channel[0], 0, 0, kNaN, kNaN, kNaN};
        e.quality = TACTILED_GOOD;
        return e;
    }
    std::string_view method() const noexcept override { return "constant"; }
};

// One channel as fx, with a standard deviation.
class Certain final : public Decoupler {
public:
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        e.wrench_S = {r.channel[0], 0, 0, kNaN, kNaN, kNaN};
        e.sd = {0.01, 0.01, 0.01, kNaN, kNaN, kNaN};
        e.quality = TACTILED_GOOD;
        return e;
    }
    std::string_view method() const noexcept override { return "certain"; }
};

Sensor certain(double tare_limit_N, const Agreement::Limits& agreement = {}) {
    Sensor::Setup setup;
    setup.tare_limit_N = tare_limit_N;
    setup.agreement = agreement;
    setup.channel_of_frame = {0};
    setup.frame_channels = 1;
    setup.decoupler = std::make_unique<Certain>();
    return Sensor(std::move(setup));
}

class PipelineTest : public testing::Test {
protected:
    PipelineTest() : segment_((fill_plan(), plan_)) {
        for (int i = 0; i < 2; ++i) {
            auto link = std::make_unique<Link>();
            link->index = unsigned(i);
            auto driver = std::make_unique<Scripted>();
            driver_[i] = driver.get();
            link->driver = std::move(driver);
            link->bindings.push_back({0, std::uint16_t(i)});
            links_.push_back(std::move(link));
            Sensor::Setup setup;
            setup.channel_of_frame = {0};
            setup.frame_channels = 1;
            setup.decoupler = std::make_unique<Constant>();
            sensors_.emplace_back(std::move(setup));
        }
        pipeline_ = std::make_unique<Pipeline>(links_, sensors_, segment_, 0);
        segment_.set_state(TACTILED_RUNNING);
        now_ = monotonic_ns();
        pipeline_->start(now_);
        for (auto& link : links_) link->connected = true;
    }
    void fill_plan() {
        plan_.name = "pipeline-test-" + std::to_string(::getpid());
        plan_.history = 1024;
        plan_.sensors.resize(2);
        plan_.links.resize(2);
        plan_.watchdog_ms = 10'000;  // for look(), whose clock is behind the cycles'
        for (auto& s : plan_.sensors) s.stale_ms = 10'000;
    }
    void send(int link, double value, std::uint16_t device = 0) {
        Frame f;
        f.t_ns = now_;
        f.device = device;
        f.n_channels = 1;
        f.channel[0] = value;
        driver_[link]->frames.push_back(f);
    }
    void acquire_all(int link) {
        while (driver_[link]->has_more()) EXPECT_EQ(acquire(*links_[std::size_t(link)], segment_, 0), Status::frame);
    }
    void turn(std::uint64_t ms = 1) {
        now_ += ms * 1'000'000;
        pipeline_->cycle(now_);
    }
    Snapshot look() {
        Snapshot s;
        EXPECT_TRUE(Segment::open(plan_.name).snapshot(s));
        return s;
    }

    SegmentPlan plan_;
    SegmentWriter segment_;
    std::vector<std::unique_ptr<Link>> links_;
    Scripted* driver_[2] = {};
    std::vector<Sensor> sensors_;
    std::unique_ptr<Pipeline> pipeline_;
    std::uint64_t now_ = 0;
};

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
    links_[0]->age.add(0, 100, 0.2, 100 * ms);
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
    send_counted(500);
    auto [sample, stays_open] = last_of_all();
    EXPECT_EQ(sample.reasons, 0u);
    EXPECT_TRUE(stays_open);
    turn(20);
    EXPECT_EQ(tactiled_freshness_of(Segment::open(plan_.name).c(), 0), unsigned(TACTILED_BY_SEQUENCE));
    t_ns += 2'000 * ms;  // the device pauses, or a link was down: its next number comes 2 s later
    send_counted(100);
    std::tie(sample, stays_open) = last_of_all();
    EXPECT_EQ(sample.quality, unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(sample.reasons, unsigned(TACTILED_UNPROVED_AGE));
    EXPECT_FALSE(stays_open) << "the link is to be opened again";
    ++driver_[0]->counts[TACTILED_LINK_OPENED];
    send_counted(10);
    std::tie(sample, stays_open) = last_of_all();
    EXPECT_EQ(sample.quality, unsigned(TACTILED_GOOD));
    EXPECT_TRUE(stays_open);
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
    const auto before = look().node.sequence;
    for (int i = 0; i < 50; ++i) turn(1);
    EXPECT_GE(look().node.sequence, before + 4);
}

TEST_F(PipelineTest, ATareIsAcknowledgedWhenItIsDone) {
    const auto tell = [&](Command::Kind kind, std::uint32_t mask, std::uint32_t number) {
        auto& ring = pipeline_->commands[TACTILED_FROM_SOCKET];
        *ring.claim() = {kind, mask, number, {}};
        ring.push();
        ring.commit();
        turn();
    };
    tell(Command::Kind::tare, 1, 1);
    EXPECT_EQ(look().node.command[TACTILED_FROM_SOCKET].result, unsigned(TACTILED_COMMAND_NOT_NOW));  // no data yet
    send(0, 3);
    acquire_all(0);
    tell(Command::Kind::tare, 4, 2);
    EXPECT_EQ(look().node.command[TACTILED_FROM_SOCKET].result, unsigned(TACTILED_COMMAND_BAD_MASK));
    turn();
    tell(Command::Kind::tare, 1, 3);
    EXPECT_EQ(look().node.command[TACTILED_FROM_SOCKET].state, unsigned(TACTILED_COMMAND_RUNNING));
    for (int i = 0; i < 110; ++i) {
        send(0, 3);
        acquire_all(0);
        turn();
    }
    const auto s = look();
    EXPECT_EQ(s.node.command[TACTILED_FROM_SOCKET].acknowledged, 3u);
    EXPECT_EQ(s.node.command[TACTILED_FROM_SOCKET].state, unsigned(TACTILED_COMMAND_DONE));
    EXPECT_EQ(s.node.command[TACTILED_FROM_SOCKET].result, unsigned(TACTILED_COMMAND_OK));
    EXPECT_EQ(s.sensor[0].force_S_N[0], 0);
    EXPECT_EQ(s.sensor[0].raw_force_S_N[0], 3);
    tell(Command::Kind::clear_latches, 0, 4);
    EXPECT_EQ(look().node.fault, 0u);
}

TEST_F(PipelineTest, ARefusedTareSaysWhyAndWarnsUntilTheNextOne) {
    sensors_[0] = certain(4);
    sensors_[0].start(segment_.epoch(), now_);
    std::uint32_t number = 0;
    const auto tare = [&](Command::Kind kind, auto force_N) {
        auto& ring = pipeline_->commands[TACTILED_FROM_MODBUS];
        send(0, force_N(0));
        acquire_all(0);
        turn();
        *ring.claim() = {kind, 1, ++number, {}};
        ring.push();
        ring.commit();
        for (int i = 0; i < 110; ++i) {
            send(0, force_N(i));
            acquire_all(0);
            turn();
        }
        const tactiled_node node = look().node;
        EXPECT_EQ(node.command[TACTILED_FROM_MODBUS].acknowledged, number);
        EXPECT_EQ((node.warning & TACTILED_WARN_TARE) != 0,
                  node.command[TACTILED_FROM_MODBUS].result != TACTILED_COMMAND_OK);
        return node.command[TACTILED_FROM_MODBUS];
    };
    auto said = tare(Command::Kind::tare, [](int i) { return 0.01 * i; });
    EXPECT_EQ(said.state, unsigned(TACTILED_COMMAND_REJECTED));
    EXPECT_EQ(said.result, unsigned(TACTILED_COMMAND_MOVING));
    said = tare(Command::Kind::tare, [](int) { return 5.0; });
    EXPECT_EQ(said.state, unsigned(TACTILED_COMMAND_REJECTED));
    EXPECT_EQ(said.result, unsigned(TACTILED_COMMAND_UNDER_LOAD));
    EXPECT_EQ(look().sensor[0].force_S_N[0], 5);
    EXPECT_EQ(tare(Command::Kind::untare, [](int) { return 5.0; }).result, unsigned(TACTILED_COMMAND_OK));
    EXPECT_EQ(tare(Command::Kind::tare, [](int) { return 3.0; }).result, unsigned(TACTILED_COMMAND_OK));
    EXPECT_EQ(look().sensor[0].force_S_N[0], 0);
}

TEST_F(PipelineTest, ATareIsDoneWhenItsZeroIsInTheFileAndRefusedWhereItCannotBe) {
    const std::string path = "/tmp/pipeline-test-" + std::to_string(::getpid()) + ".zeros.toml";
    ::unlink(path.c_str());
    ZeroStore store(path, {{"a", "", 0, {"constant"}, true}, {"b", "", 0, {"constant"}, true}});
    pipeline_->commands.keep_zeros_in(store);
    const auto begin = [&](Command::Kind kind, std::uint32_t number) {
        auto& ring = pipeline_->commands[TACTILED_FROM_SOCKET];
        *ring.claim() = {kind, 1, number, {}};
        ring.push();
        ring.commit();
        for (int i = 0; i < 110; ++i) {
            send(0, 3);
            acquire_all(0);
            turn();
        }
        return look().node.command[TACTILED_FROM_SOCKET];
    };
    const auto bytes = [&] { return std::filesystem::file_size(path); };
    send(0, 3);
    acquire_all(0);
    turn();
    const auto before = bytes();
    tactiled_command said = begin(Command::Kind::tare, 1);
    for (int i = 0; i < 1000 && said.state == TACTILED_COMMAND_RUNNING; ++i) {
        EXPECT_NE(look().node.status & TACTILED_ANY_TARING, 0u);
        ::usleep(1000);
        now_ -= 1'000'000;  // the time of the test's frames, not of the loop
        turn();
        said = look().node.command[TACTILED_FROM_SOCKET];
    }
    EXPECT_EQ(said.state, unsigned(TACTILED_COMMAND_DONE));
    EXPECT_EQ(said.result, unsigned(TACTILED_COMMAND_OK));
    EXPECT_GT(bytes(), before);
    EXPECT_EQ(look().node.fault & TACTILED_FAULT_STORAGE, 0u);

    ZeroStore nowhere("", {});
    pipeline_->commands.keep_zeros_in(nowhere);
    for (const auto kind : {Command::Kind::tare, Command::Kind::untare}) {
        said = begin(kind, 2 + std::uint32_t(kind));
        EXPECT_EQ(said.state, unsigned(TACTILED_COMMAND_REJECTED));
        EXPECT_EQ(said.result, unsigned(TACTILED_COMMAND_NOT_STORED));
    }
    EXPECT_EQ(look().sensor[0].force_S_N[0], 0);
    EXPECT_NE(look().node.fault & TACTILED_FAULT_STORAGE, 0u);
    pipeline_.reset();
    ::unlink(path.c_str());
}

TEST_F(PipelineTest, ALatchedFaultClearsItselfOnceItsCauseHasBeenAbsentForLongEnough) {
    pipeline_->clear_faults_after(1'000'000'000);
    const auto stream = [&](int ms) {
        for (; ms > 0; ms -= 10) {
            send(0, 1);
            acquire_all(0);
            turn(10);
        }
        return look().node.fault;
    };
    (void)stream(100);
    turn(150);  // stale
    EXPECT_EQ(look().node.fault, unsigned(TACTILED_FAULT_SENSOR_LOST));
    for (int i = 0; i < 30; ++i) turn(100);
    EXPECT_EQ(look().node.fault, unsigned(TACTILED_FAULT_SENSOR_LOST)) << "the cause lasts";
    EXPECT_EQ(stream(970), unsigned(TACTILED_FAULT_SENSOR_LOST));
    EXPECT_EQ(stream(40), 0u) << "the other sensor has never delivered, which is no fault";
    EXPECT_EQ(look().node.status & TACTILED_FAULT, 0u);
    links_[0]->connected = false;
    turn();
    EXPECT_EQ(look().node.fault, unsigned(TACTILED_FAULT_SENSOR_LOST | TACTILED_FAULT_BUS));
    for (int i = 0; i < 30; ++i) turn(100);
    EXPECT_EQ(look().node.fault, unsigned(TACTILED_FAULT_SENSOR_LOST | TACTILED_FAULT_BUS));
    pipeline_->clear_faults_after(0);
    links_[0]->connected = true;
    EXPECT_EQ(stream(5000), unsigned(TACTILED_FAULT_SENSOR_LOST | TACTILED_FAULT_BUS)) << "0: never";
}

TEST_F(PipelineTest, TwoSensorsOfOneForceThatDifferAreBothUncertainUntilTheyAgree) {
    for (const int i : {0, 1}) {
        sensors_[std::size_t(i)] = certain(0, {1 - i, 1, 20'000'000});
        sensors_[std::size_t(i)].start(segment_.epoch(), now_);
    }
    const auto both = [&](double a, double b, int ms) {
        for (; ms > 0; --ms) {
            send(0, a);
            send(1, b);
            for (const int link : {0, 1}) acquire_all(link);
            turn();
        }
        const Snapshot s = look();
        for (const auto& sensor : {s.sensor[0], s.sensor[1]})
            EXPECT_EQ(sensor.reasons, sensor.quality == TACTILED_GOOD ? 0u : unsigned(TACTILED_SENSORS_DIFFER));
        EXPECT_EQ(s.sensor[0].force_S_N[0], a);  // the value is published
        return s.sensor[0].quality == s.sensor[1].quality ? s.sensor[0].quality : 0u;
    };
    EXPECT_EQ(both(5, 5.9, 100), unsigned(TACTILED_GOOD));
    EXPECT_EQ(both(5, 6.1, 19), unsigned(TACTILED_GOOD));
    EXPECT_EQ(both(5, 6.1, 3), unsigned(TACTILED_UNCERTAIN));
    EXPECT_GT(tactiled_reason_count(Segment::open(plan_.name).c(), 0, 19), 0u);
    EXPECT_GT(tactiled_reason_count(Segment::open(plan_.name).c(), 1, 19), 0u);
    EXPECT_EQ(both(5, 5.1, 19), unsigned(TACTILED_UNCERTAIN));
    EXPECT_EQ(both(5, 5.1, 3), unsigned(TACTILED_GOOD));
}

TEST_F(PipelineTest, WithoutAGraspNothingOfItIsKnownAndNoWeighingBegins) {
    turn();
    EXPECT_EQ(look().node.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));
    EXPECT_TRUE(std::isnan(look().node.grasp.weight_kg));
    auto& ring = pipeline_->commands[TACTILED_FROM_MODBUS];
    ring.claim()->kind = Command::Kind::start_weighing;
    ring.push();
    ring.commit();
    turn();
    EXPECT_EQ(look().node.command[TACTILED_FROM_MODBUS].state, unsigned(TACTILED_COMMAND_REJECTED));
    EXPECT_EQ(look().node.command[TACTILED_FROM_MODBUS].result, unsigned(TACTILED_COMMAND_NOT_NOW));
}

TEST_F(PipelineTest, TheGraspIsPublishedWithTheFrameAndUnknownOnceAJawIsSilent) {
    Grasping::Setup setup;
    setup.estimator.jaws.resize(2);
    setup.estimator.jaws[1].sensor = 1;
    pipeline_ = std::make_unique<Pipeline>(links_, sensors_, segment_, 0, setup);
    pipeline_->start(now_);
    for (int i = 0; i < 5; ++i) {
        for (const int link : {0, 1}) {
            send(link, 0.01);
            acquire_all(link);
        }
        turn();
    }
    auto s = look();
    EXPECT_EQ(s.node.grasp.state, unsigned(TACTILED_GRIP_OPEN));
    EXPECT_EQ(s.node.grasp.t_ns, s.sensor[0].t_ns);
    for (int i = 0; i < 101; ++i) {  // longer than stale_ns
        send(0, 0.01);
        acquire_all(0);
        turn();
    }
    s = look();
    EXPECT_EQ(s.sensor[0].quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.node.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));
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
