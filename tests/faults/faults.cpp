#include "faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <iterator>
#include <string_view>

#include "clock.hpp"

namespace tactiled::faults {
namespace {

void each(World& world, unsigned link, void (*change)(Device&)) {
    for (unsigned i = 0; i < kSensors; ++i)
        if (World::link_of(i) == link) change(world.device(i));
}

void set(bool& flag, int percent) { flag = percent != 0; }
void set(double& probability, int percent) { probability = percent / 100.0; }

// A flag of each device becomes true, or a probability becomes that many percent; afterwards it is false or zero.
template <auto kMember, int kPercent = 100>
constexpr Fault on_devices(const char* name, int number, Reach reach = Reach::link, std::uint64_t recovers_ms = 30) {
    return {name,
            number,
            reach,
            recovers_ms,
            0,
            [](World& world, unsigned link) { each(world, link, [](Device& d) { set(d.*kMember, kPercent); }); },
            [](World& world, unsigned link) { each(world, link, [](Device& d) { set(d.*kMember, 0); }); }};
}

void nothing(World&, unsigned) {}

// The rates are those of a damaged cable that still works.
constexpr Fault kFaults[] = {
    {"cable pulled", 1, Reach::link, 1100, 0, [](World& w, unsigned l) { w.unplug(l); },
     [](World& w, unsigned l) { w.plug(l); }},
    {"cable pulled, then the port cannot be opened", 4, Reach::link, 1100, 0,
     [](World& w, unsigned l) {
         w.unplug(l);
         w.cable(l).opens = false;
     },
     [](World& w, unsigned l) {
         w.plug(l);
         w.cable(l).opens = true;
     }},
    {"loose plug: gone for 5 ms again and again", 102, Reach::link, 1100, 0,
     [](World& w, unsigned l) {
         w.unplug(l);
         w.run_ms(5);
         w.plug(l);
         w.run_ms(60);
         w.unplug(l);
     },
     [](World& w, unsigned l) { w.plug(l); }},
    on_devices<&Device::garbage>("garbage at line rate", 5),
    on_devices<&Device::flips, 10>("a bit flipped in every tenth frame", 6),
    on_devices<&Device::wrong_length>("a wrong byte in the header", 7),
    on_devices<&Device::cuts, 20>("frames cut in half", 8),
    {"one byte a read", 9, Reach::link, 30, 0, [](World& w, unsigned l) { w.cable(l).chop = 1; },
     [](World& w, unsigned l) { w.cable(l).chop = 0; }},
    {"several frames in one read", 9, Reach::link, 30, 8,
     [](World& w, unsigned l) { w.cable(l).hold_until_ns = world_ns + 8 * kMs; }, nothing},
    on_devices<&Device::drops, 20>("frames lost by the device", 10),
    on_devices<&Device::repeats, 20>("frames sent twice", 10),
    on_devices<&Device::swaps, 20>("frames overtaken", 10),
    {"the counter jumps, then wraps", 93, Reach::link, 30, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.jump_to(d.is_text() ? 0xFFFFFFF0u : 0xFFF0u); }); }, nothing},
    {"the device restarts", 30, Reach::link, 30, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.jump_to(0); }); }, nothing},
    on_devices<&Device::silent>("silent stop", 11),
    {"half the rate", 12, Reach::link, 2100, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = 2 * kPeriodNs; }); },
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = kPeriodNs; }); }},
    {"twice the rate", 12, Reach::link, 2100, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = kPeriodNs / 2; }); },
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.period_ns = kPeriodNs; }); }},
    on_devices<&Device::other_shape>("another device under the name", 3),
    {"a second device under the name", 23, Reach::twin, 1000, 0,
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.doubled = true; }); },
     [](World& w, unsigned l) { each(w, l, [](Device& d) { d.doubled = false; }); }},
    on_devices<&Device::foreign>("frames of a device that nobody reads", 20),
    on_devices<&Device::zeros>("all zeros", 29, Reach::twin),
    on_devices<&Device::frozen>("frozen", 34),
    on_devices<&Device::saturate>("a channel at its rail", 35),
    on_devices<&Device::spikes, 30>("single impossible steps", 36, Reach::twin, 20'000),
    on_devices<&Device::nan>("NaN in the stream", 37),
    on_devices<&Device::missing>("a channel missing", 40),
    {"no sensor has power", 11, Reach::node, 30, 0,
     [](World& w, unsigned) {
         for (unsigned i = 0; i < kSensors; ++i) w.device(i).silent = true;
     },
     [](World& w, unsigned) {
         for (unsigned i = 0; i < kSensors; ++i) w.device(i).silent = false;
     }},
    {"the loop stands for 60 ms", 84, Reach::node, 40, 60, [](World& w, unsigned) { w.stall_pipeline(60); }, nothing},
    {"the loop stands: rings full", 90, Reach::node, 60, 1200, [](World& w, unsigned) { w.stall_pipeline(1200); }, nothing},
    {"the daemon is stopped for 140 ms and continued", 14, Reach::node, 60, 140,
     [](World& w, unsigned) { w.stop_process(140); }, nothing},
    {"the daemon is killed", 96, Reach::node, 200, 100,
     [](World& w, unsigned) {
         if (w.is_running()) w.kill();
     },
     [](World& w, unsigned) { w.restart(); }},
    {"the daemon is stopped and started", 97, Reach::node, 200, 50,
     [](World& w, unsigned) {
         if (w.is_running()) w.stop();
     },
     [](World& w, unsigned) { w.restart(); }},
    // 60 N on the diagonal: the pair differs by 20 N on each axis by its offsets, and may differ by 45 N.
    {"a sensor reads 30 N less than it feels, its twin does not", 43, Reach::pair, 60, 0,
     [](World& w, unsigned) { w.device(0).offset = -30'000; }, [](World& w, unsigned) { w.device(0).offset = 0; }},
    {"reload: a low pass, a time to tare", 46, Reach::nobody, 0, 0, [](World& w, unsigned) { w.retune(); },
     [](World& w, unsigned) { w.retune(); }},
    {"reload: a broken file", 46, Reach::nobody, 0, 0, [](World& w, unsigned) { w.reload_broken(); },
     [](World& w, unsigned) { w.retune(); }},
    {"reload: another calibration of a sensor", 47, Reach::jaw, 30, 0, [](World& w, unsigned) { w.recalibrate(); },
     [](World& w, unsigned) { w.recalibrate(); }},
    {"a reader is stopped", 62, Reach::node, 30, 1000, [](World& w, unsigned) { w.witness().follows = false; },
     [](World& w, unsigned) { w.witness().follows = true; }},
};

struct Act {
    const Fault* fault;
    unsigned link;
    std::uint64_t begin_ms, end_ms;
};

bool is_one_of(const Fault& fault, std::initializer_list<std::string_view> names) {
    return std::find(names.begin(), names.end(), fault.name) != names.end();
}

// A restart with overtaken frames may be taken for a second device, for 224 frames.
bool is_like_a_second_device(const Act& one, const Act& other) {
    return one.link == other.link &&
           (is_one_of(*one.fault, {"frames overtaken"}) || is_one_of(*other.fault, {"frames overtaken"})) &&
           (is_one_of(*one.fault, {"the counter jumps, then wraps", "the device restarts"}) ||
            is_one_of(*other.fault, {"the counter jumps, then wraps", "the device restarts"}));
}

// Returns bit i: sensor i. `compared`: the result of a comparison stays while one of the two sensors has another
// fault.
unsigned sensors_of(const Act& act, bool compared = false) {
    unsigned mask = 0;
    for (unsigned i = 0; i < kSensors; ++i) {
        const bool of_link = World::link_of(i) == act.link;
        const Reach reach = act.fault->reach;
        if (reach == Reach::node || ((reach == Reach::link || reach == Reach::twin) && of_link) ||
            ((reach == Reach::twin || (compared && reach == Reach::link)) && !is_jaw(i) && act.link < 2) ||
            (reach == Reach::pair && !is_jaw(i)) || (reach == Reach::jaw && i == kRecalibrated))
            mask |= 1u << i;
    }
    return mask;
}

}  // namespace

std::span<const Fault> faults() { return kFaults; }

Findings run(std::uint64_t seed, const Fault* first, const Fault* second, const Plant* plant) {
    World world(seed, plant);
    world.tares = true;
    Random& random = world.random();
    std::vector<Act> acts;
    for (const Fault* fault : {first, second}) {
        if (fault == nullptr) continue;
        const std::uint64_t begin_ms = acts.empty() ? 150 : 150 + random() % 150;
        const std::uint64_t lasts_ms = fault->lasts_ms != 0 ? fault->lasts_ms : 30 + random() % 270;
        acts.push_back({fault, unsigned(random() % kLinks), begin_ms, begin_ms + lasts_ms});
    }
    const bool compared = std::any_of(acts.begin(), acts.end(), [](const Act& a) {
        return a.fault->reach == Reach::twin || a.fault->reach == Reach::pair;
    });
    const bool together = acts.size() == 2 && (sensors_of(acts[0], compared) & sensors_of(acts[1], compared)) != 0;
    const std::uint64_t doubted_ms = acts.size() == 2 && is_like_a_second_device(acts[0], acts[1]) ? 1000 : 0;
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
        // With another fault at the same time, the recovery may take as long as both in a row.
        const std::uint64_t back_ms = together ? acts[0].fault->recovers_ms + acts[1].fault->recovers_ms : fault.recovers_ms;
        world.suffer(sensors_of(*event.act, compared),
                     at_ns(std::max(event.act->end_ms, now_ms) + back_ms + doubted_ms + 70));
        (event.begins ? fault.begin : fault.end)(world, event.act->link);
    }
    std::uint64_t rest_ms = 100 + doubted_ms;
    for (const Act& act : acts) rest_ms += act.fault->recovers_ms;
    world.run_ms(rest_ms);
    for (unsigned i = 0; i < kSensors; ++i)
        if (const tactiled_sample s = world.witness().latest(i);
            s.quality != TACTILED_GOOD && !Witness::needs_a_tare(i, world.device(i), s))
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
