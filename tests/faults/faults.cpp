#include "faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <iterator>

#include "clock.hpp"

namespace tactiled::faults {
namespace {

void each(World& world, unsigned link, void (*change)(Device&)) {
    for (unsigned i = 0; i < kSensors; ++i)
        if (World::link_of(i) == link) change(world.device(i));
}

template <auto kMember, auto kOn, auto kOff>
constexpr Fault on_devices(const char* name, int number, std::uint64_t recovers_ms = 30) {
    return {name,
            number,
            false,
            recovers_ms,
            0,
            [](World& world, unsigned link) { each(world, link, [](Device& d) { d.*kMember = kOn; }); },
            [](World& world, unsigned link) { each(world, link, [](Device& d) { d.*kMember = kOff; }); }};
}

void nothing(World&, unsigned) {}

// The rates are those of a bad cable, not of a dead one.
constexpr Fault kFaults[] = {
    {"cable pulled", 1, false, 1100, 0, [](World& w, unsigned l) { w.unplug(l); }, [](World& w, unsigned l) { w.plug(l); }},
    {"cable pulled, then the port cannot be opened", 4, false, 1100, 0,
     [](World& w, unsigned l) {
         w.unplug(l);
         w.cable(l).opens = false;
     },
     [](World& w, unsigned l) {
         w.plug(l);
         w.cable(l).opens = true;
     }},
    {"loose plug: gone for 5 ms again and again", 102, false, 1100, 0,
     [](World& w, unsigned l) {
         w.unplug(l);
         w.run_ms(5);
         w.plug(l);
         w.run_ms(60);
         w.unplug(l);
     },
     [](World& w, unsigned l) { w.plug(l); }},
    on_devices<&Device::garbage, true, false>("garbage at line rate", 5),
    on_devices<&Device::flips, 0.1, 0.0>("a bit flipped in every tenth frame", 6),
    on_devices<&Device::wrong_length, true, false>("a wrong byte in the header", 7),
    on_devices<&Device::cuts, 0.2, 0.0>("frames cut in half", 8),
    {"one byte a read", 9, false, 30, 0, [](World& w, unsigned l) { w.cable(l).chop = 1; },
     [](World& w, unsigned l) { w.cable(l).chop = 0; }},
    {"several frames in one read", 9, false, 30, 8,
     [](World& w, unsigned l) { w.cable(l).hold_until_ns = world_ns + 8 * kMs; }, nothing},
    on_devices<&Device::drops, 0.2, 0.0>("frames lost by the device", 10),
    on_devices<&Device::repeats, 0.2, 0.0>("frames sent twice", 10),
    on_devices<&Device::swaps, 0.2, 0.0>("frames overtaken", 10),
    {"the counter wraps", 93, false, 30, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.jump_to(d.is_text() ? 0xFFFFFFF0u : 0xFFF0u); }); }, nothing},
    {"the device restarts", 30, false, 30, 0, [](World& w, unsigned l) { each(w, l, [](Device& d) { d.jump_to(0); }); },
     nothing},
    on_devices<&Device::silent, true, false>("silent stop", 11),
    {"half the rate", 12, false, 2100, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = 2 * kPeriodNs; }); },
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = kPeriodNs; }); }},
    {"twice the rate", 12, false, 2100, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = kPeriodNs / 2; }); },
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = kPeriodNs; }); }},
    on_devices<&Device::other_shape, true, false>("another device under the name", 3),
    on_devices<&Device::foreign, true, false>("frames of a device that nobody reads", 20),
    on_devices<&Device::zeros, true, false>("all zeros", 29),
    on_devices<&Device::frozen, true, false>("frozen", 34),
    on_devices<&Device::rail, true, false>("a channel at its rail", 35),
    on_devices<&Device::spikes, 0.3, 0.0>("single impossible steps", 36),
    on_devices<&Device::nan, true, false>("NaN in the stream", 37),
    on_devices<&Device::missing, true, false>("a channel missing", 40),
    {"no sensor has power", 11, true, 30, 0,
     [](World& w, unsigned) {
         for (unsigned i = 0; i < kSensors; ++i) w.device(i).silent = true;
     },
     [](World& w, unsigned) {
         for (unsigned i = 0; i < kSensors; ++i) w.device(i).silent = false;
     }},
    {"the loop stands for 60 ms", 84, true, 40, 60, [](World& w, unsigned) { w.stall_pipeline(60); }, nothing},
    {"the loop stands: rings full", 90, true, 60, 1200, [](World& w, unsigned) { w.stall_pipeline(1200); }, nothing},
    {"the daemon is killed", 96, true, 200, 100,
     [](World& w, unsigned) {
         if (w.is_running()) w.kill();
     },
     [](World& w, unsigned) { w.restart(); }},
    {"the daemon is stopped and started", 97, true, 200, 50,
     [](World& w, unsigned) {
         if (w.is_running()) w.stop();
     },
     [](World& w, unsigned) { w.restart(); }},
    {"a reader is stopped", 62, true, 30, 1000, [](World& w, unsigned) { w.witness().follows = false; },
     [](World& w, unsigned) { w.witness().follows = true; }},
};

struct Act {
    const Fault* fault;
    unsigned link;
    std::uint64_t begin_ms, end_ms;
};

}  // namespace

std::span<const Fault> faults() { return kFaults; }

Findings run(std::uint64_t seed, const Fault* first, const Fault* second, const Plant* plant) {
    World world(seed, plant);
    Random& random = world.random();
    std::vector<Act> acts;
    for (const Fault* fault : {first, second}) {
        if (fault == nullptr) continue;
        const std::uint64_t begin_ms = acts.empty() ? 150 : 150 + random() % 150;
        const std::uint64_t lasts_ms = fault->lasts_ms != 0 ? fault->lasts_ms : 30 + random() % 270;
        acts.push_back({fault, unsigned(random() % kLinks), begin_ms, begin_ms + lasts_ms});
    }
    const bool alone = acts.size() == 1;
    for (unsigned i = 0; i < kSensors; ++i) world.device(i).alone = alone;
    struct Event {
        std::uint64_t at_ms;
        const Act* act;
        bool begins;
    };
    std::vector<Event> events;
    for (const Act& act : acts) {
        events.push_back({act.begin_ms, &act, true});
        events.push_back({act.end_ms, &act, false});
    }
    std::sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.at_ms < b.at_ms; });
    const std::uint64_t zero_ns = world_ns;
    const auto at_ns = [&](std::uint64_t ms) { return zero_ns + ms * kMs; };
    for (const Event& event : events) {
        const std::uint64_t now_ms = (world_ns - zero_ns) / kMs;
        if (event.at_ms > now_ms) world.run_ms(event.at_ms - now_ms);
        const Fault& fault = *event.act->fault;
        const unsigned suffers = fault.is_of_node ? UINT_MAX : event.act->link;
        // A fault on top of another can make the way back longer than either.
        const std::uint64_t back_ms = alone ? fault.recovers_ms : 1200;
        world.suffer(suffers, at_ns(std::max(event.act->end_ms, now_ms) + back_ms + 70));
        (event.begins ? fault.begin : fault.end)(world, event.act->link);
    }
    std::uint64_t rest_ms = 100;
    for (const Act& act : acts) rest_ms = std::max(rest_ms, alone ? act.fault->recovers_ms + 100 : std::uint64_t(1400));
    world.run_ms(rest_ms);
    for (unsigned i = 0; i < kSensors; ++i)
        if (const tactiled_sample s = world.witness().latest(i); s.quality != TACTILED_GOOD)
            world.findings().add(kNotRecovered, i, fmt::format("quality {}, reasons {:x}", s.quality, s.reasons));
    return world.findings();
}

std::uint64_t combinations() {
    const std::uint64_t n = std::size(kFaults);
    return n + n * (n - 1) / 2;
}

namespace {

std::pair<const Fault*, const Fault*> of_seed(std::uint64_t seed) {
    std::uint64_t index = seed % combinations();
    constexpr std::uint64_t n = std::size(kFaults);
    if (index < n) return {&kFaults[index], nullptr};
    index -= n;
    for (std::uint64_t a = 0; a < n; ++a) {
        if (index < n - 1 - a) return {&kFaults[a], &kFaults[a + 1 + index]};
        index -= n - 1 - a;
    }
    return {nullptr, nullptr};
}

}  // namespace

std::string name_of_seed(std::uint64_t seed) {
    const auto [first, second] = of_seed(seed);
    return fmt::format("seed {}: {}{}{}", seed, first->name, second != nullptr ? " + " : "",
                       second != nullptr ? second->name : "");
}

Findings run_seed(std::uint64_t seed, const Plant* plant) {
    const auto [first, second] = of_seed(seed);
    return run(seed, first, second, plant);
}

}  // namespace tactiled::faults
