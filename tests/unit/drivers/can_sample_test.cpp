// CAN messages to frames: whole or not at all, and every loss counted once.
#include "drivers/wire/can_sample.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/drivers/can_encode.hpp"

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

CanSignal field(unsigned start, unsigned length, CanSignal::Type type = CanSignal::Type::is_unsigned) {
    CanSignal s;
    s.start = start;
    s.length = length;
    s.type = type;
    return s;
}

CanPart part(std::uint32_t id, std::uint8_t channel, bool counts) {
    CanPart p;
    p.id = id;
    p.channels.push_back({channel, field(0, 16)});
    p.bytes = 2;
    if (counts) {
        p.sequence = field(16, 8);
        p.bytes = 3;
    }
    return p;
}

// A device of three messages, 0x10 0x11 0x12, 16 bits and a counter in each.
CanDevice three(bool counts) {
    return {5, 3, {part(0x10, 0, counts), part(0x11, 1, counts), part(0x12, 2, counts)}, 2 * kMs};
}

class Bus {
public:
    explicit Bus(std::vector<CanDevice> devices) : samples(std::move(devices), counts) {}

    // Sends message `id` with `value`, followed by `count`.
    void send(std::uint32_t id, std::uint16_t value, std::uint8_t count = 0, std::size_t size = 3) {
        const std::uint8_t bytes[3] = {std::uint8_t(value), std::uint8_t(value >> 8), count};
        send_bytes(id, {bytes, size});
    }
    void send_bytes(std::uint32_t id, std::span<const std::uint8_t> bytes) {
        samples.take({id, bytes, now_ns});
        for (Frame frame; samples.next(frame);) frames.push_back(frame);
    }
    // Sends the three messages of a sample, except those whose letter is "-".
    void sample(std::uint16_t value, const char* which = "abc") {
        now_ns += 10 * kMs;
        for (std::uint32_t n = 0; n < 3; ++n)
            if (which[n] != '-') send(0x10 + std::uint32_t(which[n] - 'a'), std::uint16_t(value + n), std::uint8_t(value));
    }

    LinkCounts counts;
    CanSamples samples;
    std::vector<Frame> frames;
    std::uint64_t now_ns = 100 * kMs;
};

std::uint32_t lost_in(const std::vector<Frame>& frames) {
    std::uint32_t lost = 0;
    for (const auto& frame : frames) lost += frame.lost;
    return lost;
}

TEST(CanSamples, AMessageThatHoldsAllIsAFrame) {
    Bus bus({{7, 1, {part(0x10, 0, false)}, 0}});
    bus.send(0x10, 1234);
    ASSERT_EQ(bus.frames.size(), 1u);
    EXPECT_EQ(bus.frames[0].device, 7);
    EXPECT_EQ(bus.frames[0].n_channels, 1);
    EXPECT_EQ(bus.frames[0].channel[0], 1234);
    EXPECT_EQ(bus.frames[0].t_ns, bus.now_ns);
    EXPECT_FALSE(bus.frames[0].has_sequence);
    EXPECT_EQ(bus.counts[TACTILED_LINK_FRAMES], 1u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_BYTES], 3u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_SKIPPED], 0u);
}

TEST(CanSamples, AShortMessageAndAForeignOneAreDroppedAndCounted) {
    Bus bus({{7, 1, {part(0x10, 0, false)}, 0}});
    bus.send(0x10, 1, 0, 1);
    bus.send(0x10 | kCanExtended, 1);
    bus.send(0x11, 1);
    EXPECT_TRUE(bus.frames.empty());
    EXPECT_EQ(bus.counts[TACTILED_LINK_BAD_LENGTH], 1u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_SKIPPED], 7u);
}

TEST(CanSamples, ANumberThatIsNoneIsMissingAndAnInfiniteOneDropped) {
    CanPart p = part(0x10, 0, false);
    p.channels = {{0, field(0, 32, CanSignal::Type::is_float)}, {1, field(32, 8)}};
    p.bytes = 5;
    Bus bus({{0, 2, {p}, 0}});
    bus.send_bytes(0x10, std::array<std::uint8_t, 5>{0, 0, 0xC0, 0x7F, 9});
    bus.send_bytes(0x10, std::array<std::uint8_t, 5>{0, 0, 0x80, 0x7F, 9});
    ASSERT_EQ(bus.frames.size(), 1u);
    EXPECT_TRUE(std::isnan(bus.frames[0].channel[0]));
    EXPECT_EQ(bus.frames[0].missing, 1u);
    EXPECT_EQ(bus.frames[0].channel[1], 9);
    EXPECT_EQ(bus.counts[TACTILED_LINK_BAD_VALUE], 1u);
}

TEST(CanSamples, OneMessageServesSeveralDevices) {
    Bus bus({{1, 1, {part(0x10, 0, false)}, 0}, {2, 1, {part(0x10, 0, true)}, 0}});
    bus.send(0x10, 77, 3);
    ASSERT_EQ(bus.frames.size(), 2u);
    EXPECT_EQ(bus.frames[0].device, 1);
    EXPECT_EQ(bus.frames[1].device, 2);
    EXPECT_EQ(bus.frames[1].sequence, 3u);
    bus.send(0x10, 77, 4, 2);  // too short for the second only
    EXPECT_EQ(bus.frames.size(), 3u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_BAD_LENGTH], 1u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_SKIPPED], 0u);
}

TEST(CanSamples, ACounterShowsGapsRepeatsAndItsWrap) {
    Bus bus({{0, 1, {part(0x10, 0, true)}, 0}});
    for (const int count : {250, 251, 251, 254, 255, 0, 3}) bus.send(0x10, 1, std::uint8_t(count));
    ASSERT_EQ(bus.frames.size(), 6u);
    EXPECT_EQ(bus.frames[2].lost, 2u);
    EXPECT_EQ(bus.frames[4].lost, 0u);
    EXPECT_EQ(bus.frames[5].lost, 2u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 4u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_REPEATED], 1u);
}

TEST(CanSamples, SeveralMessagesMakeOneFrameWithTheTimeOfTheFirst) {
    for (const bool counts : {false, true}) {
        Bus bus({three(counts)});
        bus.send(0x10, 1, 9);
        bus.now_ns += kMs;
        bus.send(0x12, 3, 9);
        EXPECT_TRUE(bus.frames.empty());
        bus.send(0x11, 2, 9);
        ASSERT_EQ(bus.frames.size(), 1u);
        EXPECT_EQ(bus.frames[0].t_ns, bus.now_ns - kMs);
        for (unsigned k = 0; k < 3; ++k) EXPECT_EQ(bus.frames[0].channel[k], k + 1);
    }
}

// Every way to lose messages of three samples in a row: each result is of one sample, and each missing sample is
// counted.
TEST(CanSamples, NeverMixesSamplesAndCountsEachThatIsLostOnce) {
    for (const bool counts : {false, true})
        for (unsigned lost = 0; lost < 512; ++lost) {
            Bus bus({three(counts)});
            bus.sample(100);
            for (unsigned n = 0; n < 3; ++n) {
                char which[4] = "abc";
                for (unsigned k = 0; k < 3; ++k)
                    if ((lost >> (3 * n + k) & 1u) != 0) which[k] = '-';
                bus.sample(std::uint16_t(110 + 10 * n), which);
            }
            bus.sample(140);
            std::uint32_t whole = 2, absent_entirely = 0;
            for (unsigned n = 0; n < 3; ++n) {
                whole += (lost >> 3 * n & 7u) == 0;
                absent_entirely += (lost >> 3 * n & 7u) == 7;
            }
            ASSERT_EQ(bus.frames.size(), whole) << counts << ' ' << lost;
            for (const auto& frame : bus.frames) {
                ASSERT_EQ(frame.channel[1], frame.channel[0] + 1) << lost;
                ASSERT_EQ(frame.channel[2], frame.channel[0] + 2) << lost;
            }
            if (counts) continue;  // the sample's number counts by tens there: see the next test
            // Without a counter a sample that is completely lost cannot be detected.
            ASSERT_EQ(bus.counts[TACTILED_LINK_LOST], 5 - whole - absent_entirely) << lost;
            ASSERT_EQ(lost_in(bus.frames), bus.counts[TACTILED_LINK_LOST]) << lost;
        }
}

TEST(CanSamples, CountsByTheCounterWhereThereIsOne) {
    for (unsigned lost = 0; lost < 512; ++lost) {
        Bus bus({three(true)});
        bus.sample(254);
        for (unsigned n = 0; n < 3; ++n) {
            char which[4] = "abc";
            for (unsigned k = 0; k < 3; ++k)
                if ((lost >> (3 * n + k) & 1u) != 0) which[k] = '-';
            bus.sample(std::uint16_t(255 + n), which);
        }
        bus.sample(258);
        ASSERT_EQ(bus.counts[TACTILED_LINK_LOST], 5 - bus.frames.size()) << lost;
        ASSERT_EQ(lost_in(bus.frames), bus.counts[TACTILED_LINK_LOST]) << lost;
    }
}

TEST(CanSamples, ByACounterTheMessagesComeInAnyOrder) {
    Bus bus({three(true)});
    std::uint16_t value = 10;
    for (const char* order : {"abc", "acb", "bac", "bca", "cab", "cba"}) bus.sample(value++, order);
    EXPECT_EQ(bus.frames.size(), 6u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 0u);
}

TEST(CanSamples, WithoutACounterALateMessageCostsItsOwnSampleOnly) {
    Bus bus({three(false)});
    bus.sample(10, "ab-");
    bus.now_ns += 3 * kMs;  // the window is 2
    bus.send(0x12, 12);
    bus.sample(20);
    ASSERT_EQ(bus.frames.size(), 1u);
    EXPECT_EQ(bus.frames[0].channel[2], bus.frames[0].channel[0] + 2);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 1u);
    EXPECT_EQ(bus.frames[0].lost, 1u);
}

TEST(CanSamples, WithoutACounterAMessageThatComesTwiceIsOfTwoSamples) {
    Bus bus({three(false)});
    bus.sample(10);
    bus.now_ns += 10 * kMs;
    // The second 0x10 was lost, and the first 0x12.
    for (const std::uint32_t id : {0x10u, 0x11u, 0x11u, 0x12u}) bus.send(id, 0);
    bus.sample(30);
    EXPECT_EQ(bus.frames.size(), 2u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 2u);
}

TEST(CanSamples, ByACounterSamplesMayFollowAtOnce) {
    Bus bus({three(true)});
    for (std::uint8_t count = 1; count < 5; ++count)
        for (std::uint32_t id = 0x10; id < 0x13; ++id)
            if (count != 2 || id != 0x12) bus.send(id, count, count);
    ASSERT_EQ(bus.frames.size(), 3u);
    EXPECT_EQ(bus.frames[1].channel[0], 3);
    EXPECT_EQ(bus.frames[1].channel[2], 3);
    EXPECT_EQ(bus.frames[1].lost, 1u);
}

TEST(CanSamples, ACounterThatHasComeRoundDoesNotJoinOldAndNew) {
    Bus bus({three(true)});
    bus.sample(10, "ab-");
    bus.now_ns += 256 * 10 * kMs;
    bus.sample(10, "--c");
    EXPECT_TRUE(bus.frames.empty());
}

TEST(CanSamples, WhatCameBeforeItsFirstPartAtTheStartIsNobodysFault) {
    Bus bus({three(false)});
    bus.sample(10, "-bc");
    bus.sample(20);
    bus.samples.reset();
    bus.sample(30, "--c");
    bus.sample(40);
    EXPECT_EQ(bus.frames.size(), 2u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 0u);
}

// Two nodes with one identifier: number of frames that seem to be the first node's and are not, of 100 samples of
// each after the first.
int mixed_or_foreign(Bus& bus, std::size_t first_frame) {
    int wrong = 0;
    for (std::size_t i = first_frame; i < bus.frames.size(); ++i)
        for (unsigned k = 0; k < bus.frames[i].n_channels; ++k) wrong += bus.frames[i].channel[k] >= 30'000 ? 1 : 0;
    return wrong;
}

TEST(CanSamples, TwoNodesOfOneIdentifierAreReportedByTheirCounters) {
    for (const int ahead : {0, 7, 100}) {
        Bus bus({{5, 1, {part(0x10, 0, true)}, 0}});
        for (int n = 0; n < 300; ++n) {
            bus.now_ns += 10 * kMs;
            bus.send(0x10, std::uint16_t(n), std::uint8_t(n));
            bus.send(0x10, std::uint16_t(30'000 + n), std::uint8_t(n + ahead));
        }
        EXPECT_LE(mixed_or_foreign(bus, 0), 19) << ahead;
        EXPECT_EQ(bus.frames.back().n_channels, 0) << ahead;
    }
}

TEST(CanSamples, TwoNodesAreReportedWhereTheirMessagesInterleaveWithinASample) {
    for (const int ahead : {0, 7, 100}) {
        Bus bus({three(true)});
        for (int n = 0; n < 300; ++n) {
            bus.now_ns += 10 * kMs;
            for (std::uint32_t id = 0x10; id < 0x13; ++id) {
                bus.send(id, std::uint16_t(n), std::uint8_t(n));
                bus.send(id, std::uint16_t(30'000 + n), std::uint8_t(n + ahead));
            }
        }
        EXPECT_LE(mixed_or_foreign(bus, 0), 3 * 19) << ahead;
        if (ahead == 0) { EXPECT_EQ(bus.frames.back().n_channels, 0); }  // otherwise no sample of either is ever complete
    }
}

TEST(CanSamples, TwoNodesAreReportedWhereOneMessageAloneCounts) {
    Bus bus({{5, 2, {part(0x10, 0, true), part(0x11, 1, false)}, 2 * kMs}});
    for (int n = 0; n < 300; ++n) {
        bus.now_ns += 10 * kMs;
        for (std::uint32_t id = 0x10; id < 0x12; ++id) {
            bus.send(id, std::uint16_t(n), std::uint8_t(n));
            bus.send(id, std::uint16_t(30'000 + n), std::uint8_t(n + 7));
        }
    }
    EXPECT_LE(mixed_or_foreign(bus, 0), 19);
    EXPECT_EQ(bus.frames.back().n_channels, 0);
}

TEST(CanSamples, ANodeWhoseMessagesComeTwiceIsOne) {
    for (const bool counts : {true, false}) {
        Bus bus({{5, 2, {part(0x10, 0, true), part(0x11, 1, counts)}, 2 * kMs}});
        for (int n = 0; n < 300; ++n) {
            bus.now_ns += 10 * kMs;
            for (const std::uint32_t id : {0x10u, 0x10u, 0x11u, 0x11u}) bus.send(id, std::uint16_t(n), std::uint8_t(n));
        }
        ASSERT_GE(bus.frames.size(), 290u) << counts;
        for (const Frame& frame : bus.frames) ASSERT_EQ(frame.n_channels, 2) << counts << ' ' << frame.sequence;
    }
}

TEST(CanSamples, MultiplexedMessagesOfOneIdAreParts) {
    CanPart a, b;
    a.id = b.id = 0x20;
    a.multiplexed = b.multiplexed = true;
    a.selector = b.selector = field(0, 4);
    b.selected = 1;
    a.channels = {{0, field(8, 8)}};
    b.channels = {{1, field(8, 8)}};
    a.bytes = b.bytes = 2;
    Bus bus({{0, 2, {a, b}, 2 * kMs}});
    const auto send = [&](std::uint8_t which, std::uint8_t value) {
        bus.send_bytes(0x20, std::array<std::uint8_t, 2>{which, value});
    };
    send(0, 10);
    send(7, 99);  // a value of the selector that no part uses
    send(1, 11);
    send(0, 20);
    send(0, 30);
    send(1, 31);
    bus.send_bytes(0x20, {});
    ASSERT_EQ(bus.frames.size(), 2u);
    EXPECT_EQ(bus.frames[0].channel[1], 11);
    EXPECT_EQ(bus.frames[1].channel[0], 30);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 1u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_SKIPPED], 2u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_BAD_LENGTH], 1u);
}

TEST(CanSamples, SamplesThatNeverBecameMessagesAreOfOneDevice) {
    Bus bus({three(false), {6, 1, {part(0x10, 0, false)}, 0}});  // both begin with 0x10
    bus.samples.lost(0x10, 2);
    bus.samples.lost(0x10, 0);
    bus.samples.lost(0x99, 5);  // an id of no device
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 2u);
    bus.sample(100);
    std::uint32_t reported = 0;
    for (const Frame& frame : bus.frames) reported += frame.lost;
    EXPECT_EQ(reported, 2u);
}

TEST(CanSamples, ByACounterAPartThatComesTwiceIsCountedAndTheSampleWhole) {
    Bus bus({three(true)});
    bus.sample(100, "aab");
    EXPECT_EQ(bus.counts[TACTILED_LINK_REPEATED], 1u);
    EXPECT_TRUE(bus.frames.empty());
    bus.send(0x12, 102, 100);
    EXPECT_EQ(bus.frames.size(), 1u);
    EXPECT_EQ(bus.counts[TACTILED_LINK_LOST], 0u);
}

}  // namespace
}  // namespace tactiled
