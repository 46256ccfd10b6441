// StreamAge: old frames that come again with their own numbers and times, once or in a ring.
#include <deque>

#include "delayed_device.hpp"

namespace tactiled {
namespace {

// A device of 100 Hz behind a path that may send its last frames again, as new ones.
struct Repeater {
    Repeater(Route path, bool clock, bool counter, std::uint8_t counter_bits = 32)
        : route(path), age(100, 0.2, 100 * kMs), has_clock(clock), has_counter(counter), bits(counter_bits) {
        age.open(route, now_ns);
    }
    struct Sent {
        std::uint64_t measured_ns;
        std::uint32_t number;
    };
    [[nodiscard]] Sent measured() { return {now_ns, number++}; }
    // A frame arrives, or is discarded while the link is closed. Returns true if it is proved.
    bool arrives(const Sent& sent) {
        if (now_ns < opens_ns) return false;
        if (opens_ns != 0) {
            age.open(route, opens_ns);
            reopens_ns = now_ns + kS;
            opens_ns = 0;
        }
        const std::uint32_t mask = bits >= 32 ? ~0u : (1u << bits) - 1;
        Frame frame;
        frame.t_ns = frame.taken_ns = now_ns + kMs;
        frame.has_sequence = has_counter;
        frame.sequence = sent.number & mask;
        frame.sequence_bits = bits;
        // A step ahead by less than half the range is a gap, as SequenceTracker counts.
        const std::uint32_t step = (sent.number - last_number - 1) & mask;
        frame.lost = has_counter && step <= mask / 2 ? step : 0;
        last_number = sent.number;
        if (has_clock) frame.device_time_us = sent.measured_ns / 1000;
        age.judge(frame, frame.taken_ns);
        if (age.asks_for_reopening(frame.taken_ns) && frame.taken_ns > reopens_ns) opens_ns = now_ns + age.closed_ns();
        return frame.age == Age::proved && frame.late_ns < 100 * kMs;
    }
    bool next() {
        kept.push_back(measured());
        const bool proved = arrives(kept.back());
        now_ns += 10 * kMs;
        return proved;
    }
    void run_s(double s) {
        for (int i = 0; i < int(s * 100); ++i) (void)next();
    }
    // The last `frames` frames come again, while the device goes on if it is `alive`. Returns how many of them are proved.
    int again(int frames, bool alive) {
        int proved = 0;
        const std::deque<Sent> old(kept.end() - frames, kept.end());
        for (const Sent& sent : old) {
            if (alive) (void)measured();
            proved += arrives(sent);
            now_ns += 10 * kMs;
        }
        return proved;
    }

    Route route;
    StreamAge age;
    bool has_clock, has_counter;
    std::uint8_t bits;
    std::uint64_t now_ns = 1000 * kS, reopens_ns = 0;
    std::uint64_t opens_ns = 0;  // 0: the link is open
    std::uint32_t number = 5000, last_number = 4999;
    std::deque<Sent> kept;
};

struct Stream {
    const char* name;
    Route route;
    bool clock, counter;
    std::uint8_t bits = 32;
};
const std::vector<Stream> kStreams = {
    {"clock, pty", network(), true, false},        {"clock, TCP", connection(), true, false},
    {"both, pty", network(), true, true},          {"both, TCP", connection(), true, true},
    {"counter, pty", network(), false, true},      {"counter, TCP", connection(), false, true},
    {"8 bits, TCP", connection(), false, true, 8}, {"16 bits, pty", network(), false, true, 16},
    {"counter, cable", cable(), false, true},      {"both, cable", cable(), true, true}};

// The first frame of those that come again is dropped by its decoder; here all pass.
TEST(StreamAge, OldFramesThatComeAgainAreNotProved) {
    for (const Stream& stream : kStreams)
        for (const int frames : {12, 20, 50, 100, 500, 1999}) {
            if (stream.bits == 8 && frames > 128) continue;  // The number says nothing then.
            SCOPED_TRACE(testing::Message() << stream.name << ", " << frames);
            Repeater sends(stream.route, stream.clock, stream.counter, stream.bits);
            sends.run_s(30);
            ASSERT_TRUE(sends.next());
            EXPECT_LE(sends.again(frames, true), frames == 12 ? 10 : 0);  // the first 10 are at most 120 ms old
            sends.run_s(5 + frames / 50.0);
            EXPECT_TRUE(sends.next());
        }
}

// The ring goes on while the link is closed. It begins before the rate of a counter is known, and after it.
TEST(StreamAge, ARingOfOldFramesIsNeverProved) {
    for (const Stream& stream : kStreams)
        for (const double before_s : {0.6, 40.0})
            for (const int frames : {20, 30, 50, 250, 400, 3000}) {
                if (stream.bits == 8 && frames > 128) continue;  // The number says nothing then.
                if (frames > before_s * 100) continue;
                SCOPED_TRACE(testing::Message() << stream.name << ", " << frames << " after " << before_s << " s");
                Repeater sends(stream.route, stream.clock, stream.counter, stream.bits);
                sends.run_s(before_s);
                ASSERT_TRUE(sends.next());
                int proved = 0;
                for (double s = 0; s < 120; s += frames / 100.0) proved += sends.again(frames, false);
                EXPECT_EQ(proved, 0);
            }
}

TEST(StreamAge, ALagAfterOldFramesThatCameAgainIsSeen) {
    for (const Stream& stream : kStreams) {
        if (!stream.counter || stream.route.path == Path::direct) continue;  // a clock that was set back looks the same
        SCOPED_TRACE(stream.name);
        Repeater sends(stream.route, stream.clock, stream.counter, stream.bits);
        sends.route.reopening_discards = false;
        sends.age.open(sends.route);
        sends.run_s(30);
        std::deque<Repeater::Sent> late;
        int proved = 0;
        const std::deque<Repeater::Sent> old(sends.kept.end() - 150, sends.kept.end());
        for (const auto& sent : old)
            late.push_back(sends.measured()), proved += sends.arrives(sent), sends.now_ns += 10 * kMs;
        for (int i = 0; i < 3000; ++i) {
            late.push_back(sends.measured());
            proved += sends.arrives(late.front());
            late.pop_front();
            sends.now_ns += 10 * kMs;
        }
        EXPECT_LE(proved, 10);
    }
}

TEST(StreamAge, ADeviceThatRestartsIsProvedAgain) {
    for (const Stream& stream : kStreams)
        for (const int silent_ms : {10, 500, 8000}) {
            SCOPED_TRACE(testing::Message() << stream.name << ", " << silent_ms);
            Repeater sends(stream.route, false, stream.counter, stream.bits);
            if (stream.clock || (silent_ms > 50 && stream.route.path == Path::network && !stream.route.reopening_discards))
                continue;
            sends.run_s(30);
            sends.now_ns += std::uint64_t(silent_ms) * kMs;
            sends.number = std::uint32_t(silent_ms / 20);
            sends.run_s(8);
            EXPECT_TRUE(sends.next());
        }
}

}  // namespace
}  // namespace tactiled
