// Effects of the link: the arrival of frames.
#include <map>

#include "drivers/sim/arrivals.hpp"
#include "one_effect.hpp"

namespace tactiled::sim {
namespace {

struct Arrived {
    std::uint64_t at, sample;  // sample of the arrival, and sample of the frame
    std::uint32_t missing;
    double channel;
};

std::vector<Arrived> arrivals(const Scene& scene, const std::string& effects) {
    std::vector<Arrived> all;
    Simulation simulation(scene, effects);
    Arrivals link(scene.sensors[0]);
    for (const Block* b = &simulation.advance(0); b->n > 0; b = &simulation.advance(0))
        for (std::size_t n = 0; n < b->n; ++n)
            for (const SentFrame& frame : link.take(*b, n))
                all.push_back({b->first + n, frame.sample, frame.missing, frame.channel[0]});
    return all;
}

Scene with(const std::string& effects, const std::string& keys = "") {
    return scene_with("table", keys + effects + press(1, 10));
}

TEST(Link, WithoutEffectsDeliversEachFrameAtItsTurn) {
    const auto all = arrivals(with("", "every = 2\n"), "none");
    ASSERT_EQ(all.size(), 5000u);
    for (std::size_t i = 0; i < all.size(); ++i) {
        EXPECT_EQ(all[i].sample, 2 * i);
        EXPECT_EQ(all[i].at, 2 * i);
    }
}

// A stop of 7 frames: each arrives once, in order and with its own value; the first of a stop is 7 samples late, and
// as many samples later the link has caught up.
TEST(LateFrames, ComeOnceInOrderAndCatchUpTwoAtATime) {
    for (const std::size_t every : {1u, 3u}) {
        const Scene scene = with("[effects.late_frames]\nbegins = 0.01\nframes = 7\n", fmt::format("every = {}\n", every));
        const auto all = arrivals(scene, "late_frames"), ideal = arrivals(scene, "none");
        std::size_t latest = 0, stops = 0;
        ASSERT_LE(all.size(), ideal.size());
        EXPECT_GE(all.size() + 7, ideal.size()) << "the end of the scene ends a stop";
        for (std::size_t i = 0; i < all.size(); ++i) {
            ASSERT_EQ(all[i].sample, ideal[i].sample) << i;
            ASSERT_EQ(all[i].channel, ideal[i].channel) << i;
            const std::size_t late = (all[i].at - all[i].sample) / every;
            stops += late == 7 && (i == 0 || all[i - 1].at == all[i - 1].sample);
            latest = std::max(latest, late);
        }
        EXPECT_EQ(latest, 7u);
        EXPECT_NEAR(double(stops), double(ideal.size()) * 0.01 / 1.14, 30 / double(every))
            << "a stop and its end take 14 turns";
    }
}

TEST(RepeatedFrames, ComeTwiceAtOnce) {
    const auto all = arrivals(with("[effects.repeated_frames]\nshare = 0.1\n"), "repeated_frames");
    std::map<std::uint64_t, int> times;
    for (std::size_t i = 0; i < all.size(); ++i) {
        ++times[all[i].sample];
        EXPECT_EQ(all[i].at, all[i].sample);
        if (i > 0) { EXPECT_LE(all[i - 1].sample, all[i].sample); }
    }
    EXPECT_EQ(times.size(), 10000u);
    EXPECT_NEAR(double(all.size()), 11000, 100);
    for (const auto& [sample, count] : times) EXPECT_LE(count, 2) << sample;
}

TEST(OvertakenFrames, ComeRightAfterTheNext) {
    const auto all = arrivals(with("[effects.overtaken_frames]\nshare = 0.05\n"), "overtaken_frames");
    std::size_t overtaken = 0;
    std::map<std::uint64_t, int> times;
    for (std::size_t i = 0; i < all.size(); ++i) {
        ++times[all[i].sample];
        if (all[i].at == all[i].sample) continue;
        ++overtaken;
        ASSERT_GT(i, 0u);
        EXPECT_EQ(all[i].at, all[i].sample + 1);
        EXPECT_EQ(all[i - 1].sample, all[i].sample + 1);
    }
    EXPECT_GE(times.size(), 9999u);  // the last may wait for one that never arrives
    for (const auto& [sample, count] : times) EXPECT_EQ(count, 1) << sample;
    EXPECT_NEAR(double(overtaken), 10000 * 0.05 / 1.05, 80);
}

TEST(CutFrames, HaveNoLastChannels) {
    const auto all = arrivals(with("[effects.cut_frames]\nshare = 0.2\n"), "cut_frames");
    std::array<int, 9> kept{};
    for (const Arrived& frame : all) {
        if (frame.missing == 0) continue;
        std::size_t k = 0;
        while ((frame.missing >> k & 1u) == 0) ++k;
        EXPECT_EQ(frame.missing, 0xFFu - ((1u << k) - 1)) << "from channel " << k << " on none has a value";
        ++kept[k];
    }
    for (std::size_t k = 0; k < 8; ++k) EXPECT_NEAR(kept[k], 10000 * 0.2 / 8, 60) << k;
}

// With all of them active no frame arrives early, or more than twice, or after it was lost.
TEST(Link, WithAllEffectsInventsNothing) {
    const Scene scene = with(
        "[effects.late_frames]\nbegins = 0.02\nframes = 40\n[effects.repeated_frames]\nshare = 0.1\n"
        "[effects.overtaken_frames]\nshare = 0.1\n[effects.cut_frames]\nshare = 0.1\n[effects.lost_frames]\nbegins = "
        "0.05\n");
    const std::string effects = "late_frames,repeated_frames,overtaken_frames,cut_frames,lost_frames";
    const Recording sent = run(scene, effects);
    std::map<std::uint64_t, int> times;
    for (const Arrived& frame : arrivals(scene, effects)) {
        EXPECT_LE(frame.sample, frame.at);
        EXPECT_FALSE(sent.dropped[frame.sample]) << frame.sample;
        EXPECT_EQ(frame.channel, sent.channel[0][frame.sample]);
        EXPECT_LE(++times[frame.sample], 2);
    }
    std::size_t due = 0;
    for (const bool dropped : sent.dropped) due += !dropped;
    EXPECT_GE(times.size() + 45, due);
}

}  // namespace
}  // namespace tactiled::sim
