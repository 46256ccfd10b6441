// The bound of the age in simulated time: queues that grow, and honest devices. HOURS=1000: a longer run.
#include "age_run.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>

namespace tactiled::faults {
namespace {

double setting(const char* name, double otherwise) {
    const char* text = std::getenv(name);
    return text != nullptr ? std::strtod(text, nullptr) : otherwise;
}

void print(const std::string& name, const AgeTally& t) {
    fmt::print(
        "{:<58} old {:6.1f} s, oldest {:7.3f} s; not GOOD {:7.3f} % in {:6.1f} an hour; openings {:8.1f} a day, lost {:.4f} "
        "%\n",
        name, t.old_s, t.oldest_s, t.young_s > 0 ? 100 * t.doubt_s / t.young_s : 0.0, double(t.doubts) / t.seconds * 3600,
        double(t.openings) / t.seconds * 86400, 100.0 * double(t.lost) / double(t.frames + t.lost));
}

// ---- queues that grow ----------------------------------------------------------------------------------------------------

TEST(Age, NoGoodFrameIsOldBehindAQueueThatGrowsByUpToTwoPercent) {
    const double hours = setting("HOURS", 1);
    for (const double ppm : {1.0, 20.0, 50.0, 100.0, 200.0, 1000.0, 5000.0, 20000.0})
        for (const auto& [name, at_opening, cap, at_once] : {std::tuple{"discards", AtOpening::discards, 1e12, 0},
                                                             {"keeps", AtOpening::keeps, 1e12, 0},
                                                             {"keeps 100 frames", AtOpening::keeps, 100.0, 0},
                                                             {"keeps 1000 frames", AtOpening::keeps, 1000.0, 0},
                                                             {"keeps 60, sends 3 at once", AtOpening::keeps, 60.0, 3},
                                                             {"keeps 60, sends 5 at once", AtOpening::keeps, 60.0, 5}})
            for (const char* path : {"clock, TCP", "clock, pty", "number, TCP"}) {
                const std::string_view on = path;
                // Without a clock, a full queue that drops its oldest frames looks like one that was discarded.
                if (on == "number, TCP" && cap < 1e12) continue;
                AgeScene scene{.clock = on != "number, TCP",
                               .tcp = on != "clock, pty",
                               .ppm = ppm,
                               .declared_ppm = std::max(200.0, ppm),
                               .gateway_s = 0.01,
                               .cap = cap,
                               .at_once = at_once,
                               .at_opening = at_opening};
                AgeRun run(scene, std::uint64_t(setting("SEED", 1)));
                const AgeTally tally = run.run(3600 * hours);
                print(fmt::format("{} ppm, {}, {}", ppm, name, path), tally);
                EXPECT_EQ(tally.old_s, 0);
            }
}

// ---- honest devices ------------------------------------------------------------------------------------------------------

struct Honest {
    const char* name;
    AgeScene scene;
    // Allowed share of the time that is not GOOD over TCP, and at a port of this machine; 100: a device that sends nothing
    // for longer than stale_ms sends the same bytes as a path that holds them.
    double tcp_percent = 0.1;
    double tty_percent = 0.1;
};

TEST(Age, HonestDevicesAreGood) {
    const double hours = setting("HOURS", 2);
    std::mt19937_64 random(std::uint64_t(setting("SEED", 1)));
    const auto uniform = [&](double a, double b) { return a + (b - a) * double(random() >> 11) * 0x1p-53; };
    const auto pausing = [&](double each_s, double from_s, double to_s) {
        return [&, each_s, from_s, to_s, next_s = 0.0](double t_s) mutable {
            if (t_s < next_s) return 0.01;
            next_s = t_s + each_s;
            return 0.01 + uniform(from_s, to_s);
        };
    };
    const auto on_change = [&](double) { return std::min(0.01 + std::pow(uniform(0, 1), 4) * 5, 5.0); };
    const auto two_rates = [&](double t_s) { return std::fmod(t_s, 600) < 300 ? 0.01 : 0.02; };
    const auto oscillator = [&](double t_s) { return 0.01 * (1 + 0.01 * std::sin(t_s * 2 * 3.14159265 / 7200)); };
    const auto bursts = [&](double t_s) {
        const double in_s = std::fmod(t_s, 20);
        return in_s < 0.105 ? t_s - in_s + 0.105 : 0;
    };
    const Honest rows[] = {
        {"crystal of 100 ppm, clock", {.ppm = 100}},
        {"resonator of -3000 ppm, clock", {.ppm = -3000}},
        {"resonator of +3000 ppm, clock", {.ppm = 3000}},
        {"pauses of 80 to 250 ms each 10 s, clock", {.interval = pausing(10, 0.08, 0.25)}},
        {"stalls of 30 to 90 ms twice a second, clock", {.interval = pausing(0.5, 0.03, 0.09)}},
        {"sends on change, clock", {.interval = on_change}, 25},  // few openings fall between frames
        {"WiFi bursts, clock", {.hold = bursts}},
        {"steady, number", {.clock = false}, 0.1},
        {"pauses of 80 to 250 ms each 10 s, number", {.clock = false, .interval = pausing(10, 0.08, 0.25)}, 2, 100},
        {"stalls of 30 to 90 ms twice a second, number", {.clock = false, .interval = pausing(0.5, 0.03, 0.09)}, 2, 100},
        {"sends on change, number", {.clock = false, .interval = on_change}, 100, 100},
        {"100 and 50 Hz in turn, number", {.clock = false, .interval = two_rates}, 2},
        {"oscillator +-1 % in 2 h, number", {.clock = false, .interval = oscillator}, 2},
        {"WiFi bursts, number", {.clock = false, .hold = bursts}, 2, 100},
        {"WiFi bursts, arrival only", {.clock = false, .number = false, .hold = bursts}, 2},
        {"pauses of 80 to 250 ms each 10 s, arrival only",
         {.clock = false, .number = false, .interval = pausing(10, 0.08, 0.25)},
         2},
    };
    for (const auto& row : rows)
        for (const char* path : {"TCP", "pty", "pty, echo", "tty"}) {
            const std::string_view on = path;
            AgeScene scene = row.scene;
            scene.tcp = on == "TCP";
            scene.echo = on == "pty, echo";
            scene.is_cable = on == "tty";
            AgeRun run(scene, random());
            const AgeTally tally = run.run(3600 * hours);
            print(fmt::format("{}, {}", row.name, path), tally);
            EXPECT_EQ(tally.old_s, 0) << row.name << ", " << path;
            const double limit = scene.echo ? 0.1 : scene.is_cable ? row.tty_percent : scene.tcp ? row.tcp_percent : 100;
            EXPECT_LE(100 * tally.doubt_s, limit * tally.young_s) << row.name << ", " << path;
        }
}

// ---- stalls --------------------------------------------------------------------------------------------------------------

// The first 30 s of each minute: about once a second, the device pauses or the path holds its frames, for 30 to 1500 ms.
TEST(Age, GoodWithinTenSecondsAfterStallsOfDeviceAndPath) {
    const int episodes = int(setting("EPISODES", 30));
    for (const char* path : {"clock, TCP", "number, TCP", "clock, pty, echo", "number, pty, echo"}) {
        const std::string_view on = path;
        std::mt19937_64 random(std::uint64_t(setting("SEED", 1)));
        const auto uniform = [&](double a, double b) { return a + (b - a) * double(random() >> 11) * 0x1p-53; };
        double hold_from_s = 0, hold_until_s = 0;
        const auto stalls = [&](double t_s) { return std::fmod(t_s, 60) < 30 && uniform(0, 1) < 0.005; };
        AgeScene scene{.clock = on.starts_with("clock"), .tcp = on.ends_with("TCP"), .echo = on.ends_with("echo")};
        scene.interval = [&](double t_s) { return stalls(t_s) ? uniform(0.03, 1.5) : 0.01; };
        scene.hold = [&](double t_s) {
            if (t_s > hold_until_s && stalls(t_s)) hold_from_s = t_s, hold_until_s = t_s + uniform(0.03, 1.5);
            return t_s >= hold_from_s && t_s < hold_until_s ? hold_until_s : 0.0;
        };
        AgeRun run(scene, random());
        int late = 0;
        double longest_s = 0;
        for (int i = 0; i < episodes; ++i) {
            run.run(30 + 60 - std::fmod(run.now_s() + 60, 60));  // until the stalls have ended
            double s = 0;
            for (; s < 20 && (s == 0 || !run.is_good()); s += 0.1) run.run(0.1);
            longest_s = std::max(longest_s, s);
            late += s > 10;
            run.run(std::max(0.0, 29 - s));
        }
        fmt::print("{}: GOOD within {:.1f} s of the end of {} times 30 s of stalls, {} later than 10 s; old {:.1f} s\n",
                   path, longest_s, episodes, late, run.tally.old_s);
        EXPECT_EQ(late, 0) << path;
        // Numbers count a burst of old frames in intervals that the pauses have made longer: printed only.
        if (scene.clock) { EXPECT_EQ(run.tally.old_s, 0) << path; }
    }
}

}  // namespace
}  // namespace tactiled::faults
