// The taxels of an array as registers: one connection, one snapshot.
#include "node/modbus/taxels.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "node/shm/writer.hpp"

namespace tactiled::modbus {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr unsigned kTaxels = 300, kValues = 3 * kTaxels, kLastPage = kValues / kPageValues;
constexpr std::uint64_t kMs = 1'000'000;
constexpr std::uint16_t kHeadFault = 3, kHeadAge = 4, kHeadScale = 5, kHeadTaxels = 6, kHeadComponents = 7, kHeadOut = 8;

std::uint16_t page(unsigned n) { return std::uint16_t(kPagesAt + kPageSize * n); }
std::uint16_t head(unsigned sensor) { return std::uint16_t(kHeadsAt + kHeadSize * sensor); }

// Sensors 0 and 2 have arrays, sensor 1 has none.
class TaxelsTest : public testing::Test {
protected:
    TaxelsTest() : writer_((fill_plan(), plan_)) {
        writer_.set_state(TACTILED_RUNNING);
        publish(1);
        segment_ = Segment::open(plan_.name);
    }
    ~TaxelsTest() override {
        stop_ = true;
        if (flood_.joinable()) flood_.join();
    }
    void fill_plan() {
        plan_.name = "taxels-test-" + std::to_string(::getpid());
        plan_.watchdog_ms = 10'000;
        plan_.history = plan_.array_history = 8;
        plan_.sensors.resize(3);
        plan_.places.resize(3);
        for (const unsigned n : {0u, 2u}) {
            plan_.sensors[n].n_taxels = kTaxels;
            plan_.sensors[n].taxel_components = 7;
            plan_.places[n].assign(6 * kTaxels, 0);
        }
        for (auto& s : plan_.sensors) s.stale_ms = 10'000;
    }
    // Publishes an array in which every force is `count` steps of 0.01 N, but that of `without`.
    void publish(std::int16_t count, tactiled_quality quality = TACTILED_GOOD, unsigned without = kValues) {
        std::vector<std::uint64_t> record(tactiled_array_size(kTaxels, 7) / 8);
        tactiled_array array{};
        array.sample.sequence = sequence_;
        array.sample.t_ns = array.sample.t_published_ns = monotonic_ns();
        array.sample.quality = quality;
        if (quality == TACTILED_BAD) array.sample.reasons = TACTILED_DISCONNECTED;
        array.n_out = without < kValues;
        std::vector<float> forces(kValues, quality == TACTILED_BAD ? kNan : 0.01f * float(count));
        if (without < kValues) forces[without] = kNan;
        std::memcpy(record.data(), &array, sizeof array);
        std::memcpy(reinterpret_cast<char*>(record.data()) + sizeof array, forces.data(), forces.size() * sizeof(float));
        tactiled_node node{};
        for (std::uint32_t n = 0; n < 3; ++n) {
            if (n != 1) writer_.publish_array(n, sequence_, record.data());
            writer_.publish(n, array.sample);
            node.count[n] = sequence_ + 1;
        }
        node.sequence = sequence_++;
        node.t_ns = monotonic_ns();
        writer_.publish(node);
    }
    Exception read(std::uint16_t at, unsigned count, LatchedTaxels& client, std::uint64_t later_ns = 0) {
        out_.assign(count, 0xAAAA);
        return taxels_.read({at, std::uint16_t(count)}, view_of(segment_), client, monotonic_ns() + later_ns, out_);
    }
    // Returns the token.
    std::uint16_t latch(unsigned sensor, LatchedTaxels& client) {
        EXPECT_EQ(read(head(sensor), kHeadSize, client), kNone);
        return out_[kToken];
    }

    SegmentPlan plan_;
    SegmentWriter writer_;
    std::uint64_t sequence_ = 0;
    Segment segment_;
    Taxels taxels_;
    LatchedTaxels client_;
    std::vector<std::uint16_t> out_;
    std::thread flood_;
    std::atomic<bool> stop_{false};
};

TEST_F(TaxelsTest, AllPagesAreOfTheSnapshotThatTheHeadHasLatched) {
    publish(-7, TACTILED_GOOD, 130);
    const std::uint16_t token = latch(2, client_);
    EXPECT_NE(token, 0);
    EXPECT_EQ(out_[1], 1);  // SEQ
    EXPECT_EQ(out_[kArrayStatus] & 0x8001, 1);
    EXPECT_EQ(out_[kHeadFault], 0);
    EXPECT_LT(out_[kHeadAge], 5000);
    EXPECT_EQ(out_[kHeadScale], std::uint16_t(-2));
    EXPECT_EQ(out_[kHeadTaxels], kTaxels);
    EXPECT_EQ(out_[kHeadComponents], 7);
    EXPECT_EQ(out_[kHeadOut], 1);
    EXPECT_EQ(out_[kArrayPages], kLastPage + 1);
    publish(5);
    for (unsigned n = 0; n <= kLastPage; ++n) {
        ASSERT_EQ(read(page(n), kPageSize, client_), kNone);
        EXPECT_EQ(out_[0], token);
        for (unsigned i = 0; i < kPageValues; ++i) {
            const unsigned value = n * kPageValues + i;
            EXPECT_EQ(out_[i + 1], value >= kValues || value == 130 ? kNoI16 : std::uint16_t(-7)) << value;
        }
    }
    ASSERT_EQ(read(page(1) + 7, 1, client_), kNone);  // a part of a page
    EXPECT_EQ(out_[0], kNoI16);
    ASSERT_EQ(read(head(2) + 1, 1, client_), kNone);  // and one of the head, which latches nothing
    EXPECT_EQ(out_[0], 1);
}

TEST_F(TaxelsTest, EachLatchHasAnotherTokenThatIsNever0) {
    LatchedTaxels other;
    std::uint16_t before = latch(0, client_);
    for (int i = 0; i < 70'000; ++i) {
        const std::uint16_t now = latch(0, i % 2 == 0 ? other : client_);
        ASSERT_NE(now, before);
        ASSERT_NE(now, 0);
        before = now;
    }
}

TEST_F(TaxelsTest, ASecondClientHasItsOwnSnapshot) {
    LatchedTaxels other;
    const std::uint16_t first = latch(0, client_);
    EXPECT_EQ(read(page(0), 2, other), kDeviceFailure);
    publish(2);
    const std::uint16_t second = latch(0, other);
    EXPECT_NE(first, second);
    ASSERT_EQ(read(page(0), 2, client_), kNone);
    EXPECT_EQ(out_, (std::vector<std::uint16_t>{first, 1}));
    ASSERT_EQ(read(page(0), 2, other), kNone);
    EXPECT_EQ(out_, (std::vector<std::uint16_t>{second, 2}));
}

TEST_F(TaxelsTest, ASnapshotExpires) {
    EXPECT_EQ(read(page(0), 2, client_), kDeviceFailure);
    EXPECT_EQ(read(head(0) + 1, 2, client_), kDeviceFailure);
    (void)latch(0, client_);
    EXPECT_EQ(read(page(0), 2, client_, Taxels::kExpiresNs - 1000 * kMs), kNone);
    EXPECT_EQ(read(page(0), 2, client_, Taxels::kExpiresNs), kDeviceFailure);
    EXPECT_EQ(read(head(0) + 1, 2, client_, Taxels::kExpiresNs), kDeviceFailure);
}

TEST_F(TaxelsTest, ASnapshotEndsWithTheValueOfItsSensor) {
    (void)latch(0, client_);
    publish(1, TACTILED_UNCERTAIN);
    EXPECT_EQ(read(page(0), 2, client_), kNone);
    publish(1, TACTILED_BAD);
    EXPECT_EQ(read(page(0), 2, client_), kDeviceFailure);
    (void)latch(0, client_);
    publish(1);
    EXPECT_EQ(read(page(0), 2, client_), kNone);
    EXPECT_EQ(out_[1], kNoI16);
    (void)latch(0, client_);
    writer_.set_state(TACTILED_STOPPED);
    EXPECT_EQ(read(page(0), 2, client_), kDeviceFailure);
}

TEST_F(TaxelsTest, ABadArrayLatchesNoValues) {
    publish(1, TACTILED_BAD);
    EXPECT_NE(latch(0, client_), 0);
    EXPECT_EQ(out_[kArrayStatus] & 0x8001, 0x8000);
    EXPECT_EQ(out_[kHeadFault], fault_of(TACTILED_DISCONNECTED));
    for (unsigned n = 0; n <= kLastPage; ++n) {
        ASSERT_EQ(read(page(n), kPageSize, client_), kNone);
        EXPECT_EQ(std::count(out_.begin() + 1, out_.end(), kNoI16), kPageValues);
    }
}

TEST_F(TaxelsTest, AValueBeyondItsRegisterIsReported) {
    (void)latch(0, client_);
    EXPECT_EQ(out_[kArrayStatus] & 1 << 4, 0);
    View view = view_of(segment_);
    std::array<int, kSensorBlocks> scales;
    scales.fill(-6);
    view.force_scales = &scales;
    out_.resize(kHeadSize);
    EXPECT_EQ(taxels_.read({head(0), kHeadSize}, view, client_, monotonic_ns(), out_), kNone);
    EXPECT_EQ(out_[kHeadScale], std::uint16_t(-6));
    EXPECT_EQ(out_[kArrayStatus] & 1 << 4, 0);
    publish(20);
    view = view_of(segment_);
    view.force_scales = &scales;
    EXPECT_EQ(taxels_.read({head(0), kHeadSize}, view, client_, monotonic_ns(), out_), kNone);
    EXPECT_NE(out_[kArrayStatus] & 1 << 4, 0);
    ASSERT_EQ(read(page(0), 2, client_), kNone);
    EXPECT_EQ(out_[1], kMaxI16);
}

TEST_F(TaxelsTest, ASensorWithoutAnArrayLatchesNothing) {
    for (const unsigned sensor : {1u, 3u, 15u}) {
        (void)latch(0, client_);
        EXPECT_EQ(latch(sensor, client_), 0) << sensor;
        EXPECT_EQ(out_[kHeadTaxels], 0);
        EXPECT_EQ(out_[kArrayPages], 0);
        EXPECT_EQ(read(page(0), 2, client_), kIllegalAddress) << sensor;
    }
    EXPECT_EQ(latch(3, client_), 0);
    EXPECT_EQ(out_[kHeadFault], kFaultNoSensor);
}

TEST_F(TaxelsTest, AReadStaysInOnePageOfTheArray) {
    const auto checked = [](unsigned at, std::uint8_t count) {
        const std::uint8_t pdu[] = {kReadInputRegisters, std::uint8_t(at >> 8), std::uint8_t(at), 0, count};
        return check_pdu(pdu, false).exception;
    };
    for (const unsigned at : {head(0), head(15), page(0), page(kPages - 1)}) EXPECT_EQ(checked(at, kHeadSize), kNone) << at;
    EXPECT_EQ(checked(head(0), kHeadSize + 1), kIllegalAddress);
    EXPECT_EQ(checked(head(1) - 1u, 2), kIllegalAddress);
    EXPECT_EQ(checked(head(15) + kHeadSize, 1), kIllegalAddress);
    EXPECT_EQ(checked(page(0), kPageSize), kNone);
    EXPECT_EQ(checked(page(0) + 1u, kPageSize), kIllegalAddress);
    EXPECT_EQ(checked(page(1) - 1u, 2), kIllegalAddress);
    EXPECT_EQ(checked(page(kPages - 1) + kPageSize, 1), kIllegalAddress);
    (void)latch(0, client_);
    EXPECT_EQ(read(page(kLastPage), 1, client_), kNone);
    EXPECT_EQ(read(page(kLastPage + 1), 1, client_), kIllegalAddress);
    EXPECT_EQ(read(page(kPages - 1), 1, client_), kIllegalAddress);
    EXPECT_EQ(read(head(2) + 1, 1, client_), kDeviceFailure) << "sensor 2 is not latched";
}

TEST_F(TaxelsTest, NoSnapshotIsMixedWhileThePipelineRuns) {
    flood_ = std::thread([this] {
        for (std::int16_t k = 1; !stop_; k = std::int16_t(k % 30'000 + 1)) publish(k);
    });
    std::uint16_t last = 0;
    int changes = 0;
    for (int i = 0; i < 2000; ++i) {
        const std::uint16_t token = latch(0, client_);
        if ((out_[kArrayStatus] & 1) == 0) continue;  // the writer overran the reader, and there is no value
        std::uint16_t one = kNoI16;
        for (unsigned n = 0; n <= kLastPage; ++n) {
            ASSERT_EQ(read(page(n), kPageSize, client_), kNone);
            ASSERT_EQ(out_[0], token);
            if (n == 0) one = out_[1];
            for (unsigned k = 0; k < std::min<unsigned>(kPageValues, kValues - n * kPageValues); ++k)
                ASSERT_EQ(out_[k + 1], one) << n;
        }
        changes += one != last;
        last = one;
    }
    EXPECT_GT(changes, 20);  // otherwise the writer was stopped and the test shows nothing
}

}  // namespace
}  // namespace tactiled::modbus
