// A pipeline of two links and two sensors on a clock controlled by the test; the drivers follow a script.
#pragma once
#include <gtest/gtest.h>
#include <unistd.h>

#include <deque>

#include "node/pipeline.hpp"
#include "tactiled/reader.hpp"
#include "tests/unit/node/through.hpp"

namespace tactiled {

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
            setup.decoupler = std::make_unique<FirstChannel>();
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

}  // namespace tactiled
