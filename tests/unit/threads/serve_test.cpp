// The thread that has a frame delivers it; several links' threads deliver for each other; one thread reads several
// links.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <thread>

#include "node/shared_links.hpp"
#include "node/threads.hpp"
#include "tactiled/reader.hpp"
#include "tests/unit/milliseconds.hpp"
#include "tests/unit/node/through.hpp"
#include "tests/unit/stopwatch.hpp"

namespace tactiled {
namespace {

// Sends frames at a rate, numbered from 0, until there are enough; then the device is silent, or disconnects.
class Paced final : public Driver {
public:
    Paced(std::uint64_t period_ns, std::uint32_t total, std::uint32_t burst, bool pollable, bool ends)
        : period_ns_(period_ns), total_(total), burst_(burst), pollable_(pollable), ends_(ends) {}
    std::string open() override {
        next_ns_ = monotonic_ns() + 200 * kMs;  // the set-up is over
        return "";
    }
    Status read(Frame& frame, int timeout_ms) noexcept override {
        readers_ |= 1u << (timeout_ms == 0);
        if (left_ == 0) {
            const std::uint64_t until_ns = monotonic_ns() + std::uint64_t(timeout_ms) * kMs;
            if (number_ == total_) {
                if (ends_) return Status::disconnected;
                sleep_until(until_ns);
                return Status::timeout;
            }
            if (next_ns_ > until_ns || (timeout_ms == 0 && next_ns_ > monotonic_ns())) {
                if (timeout_ms > 0) sleep_until(until_ns);
                return Status::timeout;
            }
            sleep_until(next_ns_);
            next_ns_ += period_ns_;
            left_ = burst_;
        }
        --left_;
        frame = Frame{};
        frame.t_ns = monotonic_ns();
        frame.n_channels = 1;
        frame.channel[0] = number_++;
        ++counts[TACTILED_LINK_FRAMES];
        return Status::frame;
    }
    void close() noexcept override {}
    bool has_more() const noexcept override { return left_ != 0; }
    bool can_poll() const noexcept override { return pollable_; }
    // Bit 0: the link's own thread has read; bit 1: the shared thread.
    unsigned readers() const noexcept { return readers_; }

private:
    std::uint64_t period_ns_, next_ns_ = 0;
    std::uint32_t total_, burst_, number_ = 0, left_ = 0;
    bool pollable_, ends_;
    std::atomic<unsigned> readers_{0};
};

class ServeTest : public testing::Test {
protected:
    void add_link(std::unique_ptr<Paced> driver) {
        auto link = std::make_unique<Link>();
        link->index = unsigned(node_.links.size());
        link->name = "l" + std::to_string(link->index);
        paced_.push_back(driver.get());
        link->driver = std::move(driver);
        link->bindings.push_back({0, std::uint16_t(link->index)});
        node_.links.push_back(std::move(link));
        Sensor::Setup setup;
        setup.channel_of_frame = {0};
        setup.frame_channels = 1;
        setup.tuning.stale_ns = stale_ms_ * kMs;
        setup.decoupler = std::make_unique<FirstChannel>();
        node_.sensors.emplace_back(std::move(setup));
        tactiled_sensor entry{};
        ("s" + std::to_string(node_.plan.sensors.size())).copy(entry.name, sizeof entry.name - 1);
        entry.stale_ms = 10'000;
        node_.plan.sensors.push_back(entry);
        node_.plan.links.emplace_back();
    }
    void make_pipeline() {
        node_.plan.name = "serve-test-" + std::to_string(::getpid());
        node_.plan.history = 16384;
        node_.plan.watchdog_ms = 60'000;  // the values are read after the threads have ended
        segment_ = std::make_unique<SegmentWriter>(node_.plan);
        pipeline_ = std::make_unique<Pipeline>(node_.links, node_.sensors, *segment_, 0u);
        pipeline_->start(monotonic_ns());
        segment_->set_state(TACTILED_RUNNING);
    }
    void start() {
        make_pipeline();
        node_.config.realtime.priority = 50;
        node_.config.realtime.cpu = -1;
        node_.config.realtime.lock_memory = false;
        node_.config.realtime.period_us = 10'000;
        threads_ = std::make_unique<Threads>(node_, *segment_, *pipeline_);
        threads_->start();
    }
    void wait_for(std::uint32_t frames, std::size_t link) {
        const Segment segment = Segment::open(node_.plan.name);
        const std::uint32_t& count = segment.link(std::uint32_t(link)).count[TACTILED_LINK_FRAMES];
        for (int i = 0; i < 3000 && __atomic_load_n(&count, __ATOMIC_RELAXED) < frames; ++i) ::usleep(10'000);
        ::usleep(60'000);
    }
    // The values of all samples of a sensor that are not BAD, in order. Without a clock or a counter they are UNCERTAIN
    // after a silence, which a busy machine makes.
    std::vector<double> values(std::size_t sensor) {
        Reader reader(node_.plan.name, "s" + std::to_string(sensor));
        reader.rewind();
        std::vector<double> all;
        tactiled_sample s;
        while (reader.next(s))
            if (s.quality != TACTILED_BAD) all.push_back(s.raw_force_S_N[0]);
        EXPECT_EQ(reader.lost(), 0u);
        return all;
    }
    // Each frame was delivered once, in order, or the ring refused and counted it: on a busy machine the runner may
    // be slow.
    void expect_all(std::uint32_t frames) {
        for (std::size_t link = 0; link < node_.links.size(); ++link) {
            const std::vector<double> got = values(link);
            EXPECT_EQ(got.size() + node_.links[link]->ring_full, frames) << link;
            EXPECT_TRUE(std::is_sorted(got.begin(), got.end(), std::less_equal<>())) << link;
        }
    }

    std::uint64_t stale_ms_ = 10'000;  // a busy machine delivers late
    Node node_;
    std::vector<Paced*> paced_;

    std::unique_ptr<SegmentWriter> segment_;
    std::unique_ptr<Pipeline> pipeline_;
    std::unique_ptr<Threads> threads_;
};

TEST_F(ServeTest, FramesOfSeveralLinksAllArriveInOrder) {
    for (int i = 0; i < 4; ++i) add_link(std::make_unique<Paced>(kMs + 7'000u * unsigned(i), 1000, 1, false, false));
    start();
    for (std::size_t i = 0; i < 4; ++i) wait_for(1000, i);
    threads_.reset();
    expect_all(1000);
    for (const Paced* driver : paced_) EXPECT_EQ(driver->readers(), 1u);
}

TEST_F(ServeTest, ABurstThatIsLongerThanTheRingIsDeliveredByItsOwnThread) {
    constexpr std::uint32_t kFrames = 6 * Link::kRingFrames;
    add_link(std::make_unique<Paced>(kMs, kFrames, kFrames, false, false));
    make_pipeline();
    pipeline_->open();
    node_.links[0]->connected = true;
    ASSERT_EQ(node_.links[0]->driver->open(), "");
    while (read_link(*node_.links[0], *segment_, *pipeline_, 1000) != Status::frame || paced_[0]->has_more()) {}
    pipeline_->serve();
    EXPECT_EQ(values(0).size(), kFrames);
    expect_all(kFrames);
    EXPECT_EQ(node_.links[0]->ring_full, 0u);
}

// 8 x 1.5 kHz exceed the limit for one thread per link. The shared thread takes the links, and gives them back when
// they have ended.
TEST_F(ServeTest, ManyFastLinksAreReadByOneThreadAndNoFrameIsLost) {
    for (int i = 0; i < 8; ++i) add_link(std::make_unique<Paced>(kMs * 2 / 3, 3000, 1, i != 7, i == 3));
    start();
    for (std::size_t i = 0; i < 8; ++i) wait_for(3000, i);
    for (int i = 0; i < 300 && !node_.links[0]->lending.is_returned(); ++i) ::usleep(10'000);
    for (const auto& link : node_.links) EXPECT_TRUE(link->lending.is_returned());
    EXPECT_FALSE(node_.links[3]->connected);
    threads_.reset();
    expect_all(3000);
    for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(paced_[i]->readers(), i == 7 ? 1u : 3u) << i;
}

TEST_F(ServeTest, ThreadsEndWhileLinksAreShared) {
    for (int i = 0; i < 8; ++i) add_link(std::make_unique<Paced>(kMs * 2 / 3, 1'000'000, 1, true, false));
    start();
    for (int i = 0; i < 500 && node_.links[0]->lending.is_returned(); ++i) ::usleep(10'000);
    EXPECT_FALSE(node_.links[0]->lending.is_returned());
    const Stopwatch watch;
    threads_.reset();
    EXPECT_LT(watch.ns(), 1000 * kMs);
}

TEST_F(ServeTest, TheNextDeadlineIsTheEarliestTimeLimit) {
    stale_ms_ = 20;
    add_link(std::make_unique<Paced>(kMs, 0, 1, false, false));
    make_pipeline();
    node_.links[0]->connected = true;
    const auto send = [&] {
        Frame* const slot = node_.links[0]->ring.claim();
        *slot = Frame{};
        slot->t_ns = monotonic_ns() - 15 * kMs;  // it arrived unnoticed: its limit is before the next record
        slot->n_channels = 1;
        node_.links[0]->ring.push();
        node_.links[0]->ring.commit();
        return slot->t_ns;
    };
    const std::uint64_t first_ns = send();
    EXPECT_FALSE(pipeline_->serve());  // the set-up is not over
    EXPECT_FALSE(node_.sensors[0].is_delivering());
    pipeline_->open();
    EXPECT_TRUE(node_.sensors[0].is_delivering());
    EXPECT_EQ(pipeline_->deadline_ns(), first_ns + 20 * kMs + 1);
    const std::uint64_t second_ns = send();
    EXPECT_TRUE(pipeline_->serve());
    EXPECT_EQ(pipeline_->deadline_ns(), second_ns + 20 * kMs + 1);
    ::usleep(6'000);
    EXPECT_TRUE(pipeline_->serve());  // the limit is over, so that the next record is the earliest
    EXPECT_FALSE(node_.sensors[0].is_delivering());
    EXPECT_GT(pipeline_->deadline_ns(), second_ns + 20 * kMs + 1);
}

TEST_F(ServeTest, ACommandWakesThePipelinesThread) {
    add_link(std::make_unique<Paced>(kMs, 0, 1, false, false));
    start();
    const std::uint32_t before = pipeline_->wake_word().value();
    auto& ring = pipeline_->commands[TACTILED_FROM_SOCKET];
    ring.claim()->kind = Command::Kind::clear_latches;
    ring.push();
    ring.commit();
    EXPECT_NE(pipeline_->wake_word().value(), before);
}

}  // namespace
}  // namespace tactiled
