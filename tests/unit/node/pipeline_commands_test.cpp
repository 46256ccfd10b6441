// Tares, faults, agreement and the grasp in the pipeline.
#include "pipeline_fixture.hpp"

#include <cmath>
#include <filesystem>

namespace tactiled {
namespace {

// One channel as fx, with a standard deviation.
class Certain final : public Decoupler {
public:
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        e.wrench_S = {r.channel[0], 0, 0, kNaN, kNaN, kNaN};
        e.sd = {0.01, 0.01, 0.01, kNaN, kNaN, kNaN};
        e.has_value = true;
        return e;
    }
    std::string_view method() const noexcept override { return "certain"; }
};

Sensor certain(double tare_limit_N, const PairSettings& pair = {}) {
    Sensor::Setup setup;
    setup.tuning.tare_limit_of_magnitude_N = tare_limit_N;
    setup.tuning.pair = pair;
    setup.channel_of_frame = {0};
    setup.frame_channels = 1;
    setup.decoupler = std::make_unique<Certain>();
    return Sensor(std::move(setup));
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
    ZeroStore store({path, path}, {{"a", "", 0, {"constant"}, true}, {"b", "", 0, {"constant"}, true}});
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
        send(0, 3);
        acquire_all(0);
        turn();
        said = look().node.command[TACTILED_FROM_SOCKET];
    }
    EXPECT_EQ(said.state, unsigned(TACTILED_COMMAND_DONE));
    EXPECT_EQ(said.result, unsigned(TACTILED_COMMAND_OK));
    EXPECT_GT(bytes(), before);
    EXPECT_EQ(look().node.fault & TACTILED_FAULT_STORAGE, 0u);

    ZeroStore nowhere({}, {});
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
        sensors_[std::size_t(i)] = certain(0, {1 - i, 1, 20});
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
    // The first sample after a step is not compared.
    EXPECT_EQ(both(5, 6.1, 20), unsigned(TACTILED_GOOD));
    EXPECT_EQ(both(5, 6.1, 3), unsigned(TACTILED_UNCERTAIN));
    EXPECT_GT(tactiled_reason_count(Segment::open(plan_.name).c(), 0, 19), 0u);
    EXPECT_GT(tactiled_reason_count(Segment::open(plan_.name).c(), 1, 19), 0u);
    EXPECT_EQ(both(5, 5.1, 20), unsigned(TACTILED_UNCERTAIN));
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
    EXPECT_FALSE(sensors_[0].may_hold());
    for (int i = 0; i < 101; ++i) {  // longer than stale_ns
        send(0, 0.01);
        acquire_all(0);
        turn();
    }
    s = look();
    EXPECT_EQ(s.sensor[0].quality, unsigned(TACTILED_GOOD));
    EXPECT_EQ(s.node.grasp.state, unsigned(TACTILED_GRIP_UNKNOWN));
    EXPECT_TRUE(sensors_[0].may_hold()) << "no reading is a free rest now";
}

}  // namespace
}  // namespace tactiled
