// An array from its driver to the readers of shared memory.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <deque>
#include <vector>

#include "node/pipeline.hpp"
#include "tactiled/reader.hpp"
#include "tests/bench/pressed_array.hpp"

namespace tactiled {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

class ArrayDriver final : public Driver {
public:
    std::string open() override { return ""; }
    Status read(Frame& frame, int) noexcept override {
        if (frames.empty()) return Status::timeout;
        frame = frames.front().first;
        now_ = frames.front().second;
        frames.pop_front();
        return Status::frame;
    }
    void close() noexcept override {}
    bool has_more() const noexcept override { return !frames.empty(); }
    TaxelShape taxel_shape() const noexcept override { return shape; }
    Taxels taxels() const noexcept override { return {now_.empty() ? TaxelShape{} : shape, now_}; }

    TaxelShape shape{12, 3};
    std::deque<std::pair<Frame, std::vector<float>>> frames;

private:
    std::vector<float> now_;
};

class ArrayTest : public testing::Test {
protected:
    ArrayTest() : sensors_(make_sensors()), segment_((fill_plan(), plan_)) {
        auto link = std::make_unique<Link>();
        auto driver = std::make_unique<ArrayDriver>();
        driver_ = driver.get();
        link->driver = std::move(driver);
        link->taxels.make(driver_->shape, Link::kRingFrames);
        link->bindings.push_back({0, 0});
        link->connected = true;
        links_.push_back(std::move(link));
        pipeline_ = std::make_unique<Pipeline>(links_, sensors_, segment_, 0);
        segment_.set_state(TACTILED_RUNNING);
        now_ = monotonic_ns();
        pipeline_->start(now_);
        reader_ = Segment::open(plan_.name);
    }
    static pressed::Array array() {
        pressed::Array a;
        a.rows = 3, a.columns = 4, a.values = 3;
        return a;
    }
    static std::vector<Sensor> make_sensors() {
        Sensor::Setup setup;
        setup.decoupler = make_decoupler(pressed::calibration_of(array()));
        std::vector<Sensor> sensors;
        sensors.emplace_back(std::move(setup));
        return sensors;
    }
    void fill_plan() {
        plan_.name = "array-test-" + std::to_string(::getpid());
        plan_.watchdog_ms = 10'000;
        plan_.array_history = 8;
        plan_.sensors.resize(1);
        plan_.links.resize(1);
        plan_.links[0].taxels.record_size = tactiled_taxels_size(36);
        plan_.sensors[0].stale_ms = 10'000;
        plan_.sensors[0].n_taxels = 12;
        plan_.sensors[0].taxel_components = 7;
        plan_.places.emplace_back(72, 0.5f);
    }
    // Sends a frame with this press on taxel 5, N.
    void send(double press_N, bool has_taxels = true) {
        Frame frame;
        frame.t_ns = now_;
        std::vector<float> raw(has_taxels ? 36 : 0, 0);
        if (has_taxels) raw[24 + 5] = float(1000 * press_N);
        driver_->frames.emplace_back(frame, raw);
    }
    void turn() {
        while (driver_->has_more()) EXPECT_EQ(acquire(*links_[0], segment_, 0), Status::frame);
        now_ += 1'000'000;
        pipeline_->cycle(now_);
    }
    Array look() {
        Array out;
        EXPECT_TRUE(reader_.latest(0, out));
        return out;
    }

    SegmentPlan plan_;
    std::vector<Sensor> sensors_;
    SegmentWriter segment_;
    std::vector<std::unique_ptr<Link>> links_;
    ArrayDriver* driver_ = nullptr;
    std::unique_ptr<Pipeline> pipeline_;
    Segment reader_;
    std::uint64_t now_ = 0;
};

TEST_F(ArrayTest, EachSampleHasTheArrayOfItsNumber) {
    for (int k = 1; k <= 3; ++k) send(k);
    turn();
    tactiled_sample sample;
    ASSERT_TRUE(reader_.latest(0, sample));
    EXPECT_NEAR(sample.force_S_N[2], -3, 1e-5);
    const Array newest = look();
    EXPECT_EQ(newest.head().sample.sequence, sample.sequence);
    EXPECT_EQ(newest.head().sample.force_S_N[2], sample.force_S_N[2]);
    EXPECT_EQ(newest.n_taxels(), 12u);
    EXPECT_NEAR(newest.force_S_N(5)[2], -3, 1e-5);
    EXPECT_EQ(newest.force_span().size(), 36u);
    --sample.sequence;
    Array before;
    ASSERT_TRUE(reader_.array_of(0, sample, before));
    EXPECT_NEAR(before.force_S_N(5)[2], -2, 1e-5);
    EXPECT_EQ(before.states()[5], 0);
}

TEST_F(ArrayTest, TheRawTaxelsOfEachFrameHaveItsNumber) {
    for (int k = 1; k <= 3; ++k) send(k);
    send(0, false);
    turn();
    const tactiled_ring ring = reader_.c()->taxels[0];
    ASSERT_EQ(ring.slots, 8u);
    ASSERT_EQ(ring.record_size, 8u + 36 * 4);
    ASSERT_EQ(tactiled_ring_head(reader_.base(), &ring), 4u);
    struct {
        tactiled_taxels head;
        float value[36];
    } raw;
    for (std::uint32_t number = 0; number < 3; ++number) {
        ASSERT_TRUE(tactiled_ring_read(reader_.base(), &ring, number, &raw, sizeof raw)) << number;
        EXPECT_EQ(std::pair(raw.head.n_taxels, raw.head.n_values), (std::pair<std::uint16_t, std::uint16_t>(12, 3)));
        for (std::uint32_t k = 0; k < 36; ++k) EXPECT_EQ(raw.value[k], k == 24 + 5 ? 1000.f * float(number + 1) : 0.f);
    }
    ASSERT_TRUE(tactiled_ring_read(reader_.base(), &ring, 3, &raw, sizeof raw));
    EXPECT_EQ(raw.head.n_taxels, 0);
}

TEST_F(ArrayTest, TheArrayOfADisconnectedSensorHasNoForces) {
    send(2);
    turn();
    links_[0]->connected = false;
    turn();
    const Array bad = look();
    EXPECT_EQ(bad.head().sample.quality, unsigned(TACTILED_BAD));
    EXPECT_NE(bad.head().sample.reasons & TACTILED_DISCONNECTED, 0u);
    for (const float force : bad.force_span()) EXPECT_TRUE(std::isnan(force));
}

// A frame that fills a slot of the ring again must not bring its old taxels with it.
TEST_F(ArrayTest, AFrameWithoutTaxelsIsAnotherDevices) {
    for (std::size_t k = 0; k < Link::kRingFrames; ++k) {
        send(2);
        turn();
    }
    send(0, false);
    turn();
    const Array bad = look();
    EXPECT_EQ(bad.head().sample.quality, unsigned(TACTILED_BAD));
    EXPECT_EQ(bad.head().sample.reasons & TACTILED_WRONG_DEVICE, unsigned(TACTILED_WRONG_DEVICE));
    EXPECT_TRUE(std::isnan(bad.force_S_N(5)[2]));
}

TEST_F(ArrayTest, AReaderThatIsTooSlowFindsNoWrongArray) {
    send(1);
    turn();
    tactiled_sample old;
    ASSERT_TRUE(reader_.latest(0, old));
    for (int k = 0; k < 8; ++k) send(2);
    turn();
    Array array;
    EXPECT_FALSE(reader_.array_of(0, old, array));
}

TEST_F(ArrayTest, AStaleArrayIsBad) {
    send(2);
    turn();
    Array array;
    ASSERT_TRUE(reader_.latest(0, array, now_ + 11'000'000'000));
    EXPECT_EQ(array.head().sample.quality, unsigned(TACTILED_BAD));
    EXPECT_NE(array.head().sample.reasons & TACTILED_STALE, 0u);
    EXPECT_TRUE(std::isnan(array.force_S_N(5)[2]) && std::isnan(array.head().peak_N));
}

TEST_F(ArrayTest, ATareSetsTheZeroOfTheWrenchAndOfEachTaxel) {
    send(0.2);
    turn();
    sensors_[0].begin_tare(now_);
    for (int k = 0; k < 300 && sensors_[0].last().tare_count == 0; ++k) {
        send(0.2);
        turn();
    }
    EXPECT_EQ(sensors_[0].poll_tare(now_), Sensor::Tare::done);
    send(1.2);
    send(1.2);
    turn();
    const Array array = look();
    EXPECT_NEAR(array.head().sample.force_S_N[2], -1, 1e-5);
    EXPECT_NEAR(array.force_S_N(5)[2], -1, 1e-5);
    EXPECT_EQ(array.head().sample.reasons & TACTILED_ZERO_UNKNOWN, 0u);
}

TEST_F(ArrayTest, AMissingTaxelIsMissingForTheReaders) {
    send(1);
    driver_->frames.front().second[24 + 6] = kNan;
    turn();
    const Array array = look();
    EXPECT_TRUE(std::isnan(array.force_S_N(6)[0]));
    EXPECT_EQ(array.states()[6], TACTILED_TAXEL_MISSING);
    EXPECT_EQ(array.head().n_out, 1u);
}

}  // namespace
}  // namespace tactiled
