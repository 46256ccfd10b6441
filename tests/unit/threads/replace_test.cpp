// The exchange by a reload in the running loop: sensors and the grasp, between two cycles.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "node/pipeline.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

class Never final : public Driver {
public:
    std::string open() override { return ""; }
    Status read(Frame&, int) noexcept override { return Status::timeout; }
    void close() noexcept override {}
};

class Times final : public Decoupler {
public:
    explicit Times(double factor) : factor_(factor) {}
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        e.wrench_S = {factor_ * r.channel[0], 0, 0, 0, 0, 0};
        e.has_value = true;
        return e;
    }
    std::string_view method() const noexcept override { return "times"; }

private:
    double factor_;
};

Sensor sensor_times(double factor, double contact_on_N = 0.5) {
    Sensor::Setup setup;
    setup.channel_of_frame = {0};
    setup.frame_channels = 1;
    setup.tuning.contact_on_N = contact_on_N;
    setup.tuning.tare_ms = 1000;
    setup.decoupler = std::make_unique<Times>(factor);
    return Sensor(std::move(setup));
}

class ReplaceTest : public testing::Test {
protected:
    ReplaceTest() : segment_((fill_plan(), plan_)) {
        links_.push_back(std::make_unique<Link>());
        links_[0]->driver = std::make_unique<Never>();
        links_[0]->bindings = {{0, 0}, {0, 1}};
        links_[0]->connected = true;
        for (int i = 0; i < 2; ++i) sensors_.push_back(sensor_times(1));
        pipeline_ = std::make_unique<Pipeline>(links_, sensors_, segment_, 0);
        segment_.set_state(TACTILED_RUNNING);
        pipeline_->start(monotonic_ns());
    }
    void fill_plan() {
        plan_.name = "replace-test-" + std::to_string(::getpid());
        plan_.sensors.resize(2);
        plan_.links.resize(1);
        plan_.calibration_id = 1;
        for (auto& s : plan_.sensors) s.stale_ms = 10'000;
    }
    tactiled_sample turn(double value) {
        Frame f;
        f.t_ns = monotonic_ns();
        f.n_channels = 1;
        f.channel[0] = value;
        if (Frame* slot = links_[0]->ring.claim()) *slot = f;
        links_[0]->ring.push();
        links_[0]->ring.commit();
        pipeline_->cycle(f.t_ns);
        return sensors_[0].last();
    }
    Replacement::Part part(double factor, bool alike, double contact_on_N = 0.5) {
        Replacement::Part p{0, alike, std::make_unique<Sensor>(sensor_times(factor, contact_on_N)), plan_.sensors[0]};
        std::snprintf(p.entry.serial, sizeof p.entry.serial, "times %g", factor);
        return p;
    }
    // With the loop in another thread, as in the daemon.
    bool replace(Replacement& replacement) {
        std::atomic<bool> end{false};
        std::thread loop([&] {
            while (!end) pipeline_->cycle(monotonic_ns());
        });
        const bool done = pipeline_->replace(replacement, 10'000);
        end = true;
        loop.join();
        return done;
    }

    SegmentPlan plan_;
    SegmentWriter segment_;
    std::vector<std::unique_ptr<Link>> links_;
    std::vector<Sensor> sensors_;
    std::unique_ptr<Pipeline> pipeline_;
};

TEST_F(ReplaceTest, ASuccessorGoesOnInANewEpochAfterOneBadSample) {
    const tactiled_sample before = turn(3);
    const tactiled_sample other = sensors_[1].last();
    Replacement replacement;
    replacement.sensors.push_back(part(2, false));
    replacement.calibration_id = 7;
    ASSERT_TRUE(replace(replacement));
    const Segment segment = Segment::open(plan_.name);
    EXPECT_STREQ(segment.sensor(0).serial, "times 2");
    EXPECT_STREQ(segment.sensor(1).serial, "");
    EXPECT_EQ(segment.calibration_id(), 7u);
    EXPECT_EQ(segment.header().reloads, 2u);
    EXPECT_EQ(sensors_[0].last().quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(sensors_[0].last().sequence, before.sequence + 1);

    const tactiled_sample after = turn(3);
    EXPECT_EQ(after.force_S_N[0], 6);
    EXPECT_EQ(after.sequence, before.sequence + 2);
    EXPECT_EQ(after.epoch, before.epoch + 1);
    EXPECT_EQ(sensors_[1].last().epoch, other.epoch);
    EXPECT_EQ(sensors_[1].last().sequence, other.sequence + 1);
    tactiled_sample read;
    ASSERT_TRUE(segment.latest(0, read));
    EXPECT_EQ(read.force_S_N[0], 6);
}

TEST_F(ReplaceTest, ARetunedSensorKeepsEpochTareAndWhatThePlcHasSet) {
    turn(3);
    sensors_[0].begin_tare(monotonic_ns());
    sensors_[0].set({kNaN, kNaN, kNaN, 5});  // overload
    const tactiled_sample before = turn(3);
    Replacement replacement;
    replacement.sensors.push_back(part(2, true, 0.2));
    ASSERT_TRUE(replace(replacement));
    const tactiled_sample after = turn(9);
    EXPECT_EQ(after.raw_force_S_N[0], 9);  // the model is the old one
    EXPECT_EQ(after.epoch, before.epoch);
    EXPECT_EQ(after.sequence, before.sequence + 1);
    EXPECT_NE(after.state & TACTILED_OVERLOAD, 0u);
    EXPECT_NE(after.reasons & TACTILED_TARING, 0u);
    sensors_[0].begin_untare();
    EXPECT_NE(turn(0.3).state & TACTILED_CONTACT, 0u);
}

TEST_F(ReplaceTest, ATareThatRunsOnTheOldOneFails) {
    turn(3);
    Command* const slot = pipeline_->commands[TACTILED_FROM_SOCKET].claim();
    *slot = {.kind = Command::Kind::tare, .mask = 1, .number = 4};
    pipeline_->commands[TACTILED_FROM_SOCKET].push();
    pipeline_->commands[TACTILED_FROM_SOCKET].commit();
    turn(3);
    Replacement replacement;
    replacement.sensors.push_back(part(2, false));
    ASSERT_TRUE(replace(replacement));
    EXPECT_EQ(turn(3).tare_count, 0u);
    tactiled_node node;
    ASSERT_TRUE(Segment::open(plan_.name).latest_node(node));
    EXPECT_EQ(node.command[TACTILED_FROM_SOCKET].acknowledged, 4u);
    EXPECT_EQ(node.command[TACTILED_FROM_SOCKET].result, unsigned(TACTILED_COMMAND_FAILED));
}

TEST_F(ReplaceTest, WhatALoopThatHangsDidNotTakeIsTakenBack) {
    turn(3);
    Replacement replacement;
    replacement.sensors.push_back(part(2, false));
    EXPECT_FALSE(pipeline_->replace(replacement, 5));
    replacement.sensors.clear();  // the state after the return, when it does not exist any more
    EXPECT_EQ(turn(3).force_S_N[0], 3);
    EXPECT_EQ(Segment::open(plan_.name).header().reloads, 0u);
}

TEST_F(ReplaceTest, ARefusedReloadIsAWarningUntilTheNext) {
    tactiled_node node;
    pipeline_->reload_refused(true);
    turn(1);
    ASSERT_TRUE(Segment::open(plan_.name).latest_node(node));
    EXPECT_EQ(node.warning, unsigned(TACTILED_WARN_RELOAD));
    pipeline_->reload_refused(false);
    turn(1);
    ASSERT_TRUE(Segment::open(plan_.name).latest_node(node));
    EXPECT_EQ(node.warning, 0u);
}

}  // namespace
}  // namespace tactiled
