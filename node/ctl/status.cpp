// tactilectl status: every sensor once, with the counters of the links; tactilectl top: the same, live.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>
#include <vector>

#include "node/ctl/verb.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

constexpr const char* kCountName[TACTILED_LINK_COUNTS] = {
    "bytes",     "frames",  "skipped_bytes", "bad_checksum", "bad_length", "bad_value", "lost",  "repeated",
    "ring_full", "unbound", "opened",        "open_failed",  "gone",       "overrun",   nullptr, nullptr};

double age_ms(const tactiled_sample& s, std::uint64_t now_ns) {
    return now_ns > s.t_ns ? double(now_ns - s.t_ns) / 1e6 : 0.0;
}

std::string number(double value, int width, int digits) {
    return std::isfinite(value) ? fmt::format("{:{}.{}f}", value, width, digits) : fmt::format("{:>{}}", "-", width);
}

nlohmann::json json_number(double value) { return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr); }

// Method "auto" of a sensor: its front, what runs and why.
struct Front {
    std::vector<std::string> methods;  // most accurate first; none where the sensor is not "auto"
    int now = -1;                      // -1: not known, the sample is BAD
    unsigned down = 0, up = 0;
    std::string why, state;
};

Front front_of(const Segment& segment, std::uint32_t index, const tactiled_sample& s) {
    Front front;
    std::istringstream names(tactiled_methods_of(segment.c(), index));
    for (std::string name; names >> name && front.methods.size() < TACTILED_MAX_METHODS;) front.methods.push_back(name);
    if (front.methods.empty()) return front;
    const tactiled_sensor& sensor = segment.sensor(index);
    const std::uint32_t first = std::min<std::uint32_t>(sensor.first_method, std::uint32_t(front.methods.size() - 1));
    front.why = fmt::format("{}: {} of {} within {:g} us", front.methods[first],
                            sensor.method_us[first] <= sensor.budget_us ? "the most accurate" : "the fastest, for none is",
                            front.methods.size(), sensor.budget_us);
    const std::uint32_t now = TACTILED_METHOD(s.state), steps = TACTILED_STEPS(s.state);
    if (now == 0 || now > front.methods.size()) return front;
    front.now = int(now - 1);
    front.down = unsigned(std::max(0, int(steps) + front.now - int(first))) / 2;
    front.up = steps - std::min(front.down, steps);
    front.state = (s.state & TACTILED_OVER_BUDGET) != 0    ? "over-budget"
                  : (s.state & TACTILED_STEPPED_DOWN) != 0 ? "stepped-down"
                                                           : "within-budget";
    return front;
}

nlohmann::json as_json(const Front& front, const tactiled_sensor& sensor) {
    nlohmann::json out{{"budget_us", sensor.budget_us}, {"began_with", front.why}};
    if (front.now >= 0) {
        out["now"] = front.methods[std::size_t(front.now)];
        out["state"] = front.state;
        out["steps_down"] = front.down;
        out["steps_up"] = front.up;
    }
    for (std::size_t i = 0; i < front.methods.size(); ++i)
        out["front"].push_back({{"method", front.methods[i]},
                                {"measured_us", json_number(double(sensor.method_us[i]))},
                                {"sd_of_full_scale", json_number(double(sensor.method_error[i]))}});
    return out;
}

std::string as_text(const Front& front, const tactiled_sensor& sensor) {
    std::string out = fmt::format("{}: method auto, ", sensor.name);
    out += front.now < 0 ? "no sample\n"
                         : fmt::format("{} runs, {}, {} steps down, {} up; began with {}\n",
                                       front.methods[std::size_t(front.now)], front.state, front.down, front.up, front.why);
    for (std::size_t i = 0; i < front.methods.size(); ++i)
        out += fmt::format("    {:<10} {:>8.3f} us measured  {:>6.2f} % of full scale\n", front.methods[i],
                           double(sensor.method_us[i]), 100 * double(sensor.method_error[i]));
    return out;
}

nlohmann::json as_json(const Segment& segment, const Snapshot& snapshot) {
    const auto& h = segment.header();
    nlohmann::json out{{"schema", 1},
                       {"node", h.name},
                       {"version", h.version},
                       {"pid", h.pid},
                       {"epoch", h.epoch},
                       {"heartbeat", snapshot.node.heartbeat},
                       {"sequence", snapshot.node.sequence},
                       {"cycles", snapshot.node.cycles},
                       {"missed_cycles", snapshot.node.missed_cycles},
                       {"worst_cycle_us", snapshot.node.worst_cycle_us},
                       {"rt_degraded", (snapshot.node.status & TACTILED_RT_DEGRADED) != 0},
                       {"simulated", (snapshot.node.status & TACTILED_SIMULATED) != 0}};
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        const auto& s = snapshot.sensor[i];
        nlohmann::json sensor{{"name", segment.sensor(i).name},
                              {"model", segment.sensor(i).model},
                              {"method", segment.sensor(i).method},
                              {"link", segment.sensor(i).link},
                              {"quality", quality_text(s.quality, s.reasons)},
                              {"age_ms", age_ms(s, snapshot.taken_ns)},
                              {"rate_Hz", json_number(double(s.rate_Hz))},
                              {"lost", s.lost},
                              {"tare_count", s.tare_count}};
        for (const auto& [key, values] : {std::pair{"force_S_N", s.force_S_N},
                                          {"torque_S_Nm", s.torque_S_Nm},
                                          {"sd_force_N", s.sd_force_N},
                                          {"raw_force_S_N", s.raw_force_S_N}})
            sensor[key] = {json_number(values[0]), json_number(values[1]), json_number(values[2])};
        if (const Front front = front_of(segment, i, s); !front.methods.empty())
            sensor["auto"] = as_json(front, segment.sensor(i));
        out["sensors"].push_back(std::move(sensor));
    }
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
        const auto& link = segment.link(i);
        nlohmann::json l{{"name", link.name}, {"driver", link.driver}, {"open", link.state == TACTILED_LINK_OPEN}};
        for (int kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
            if (kCountName[kind] != nullptr) l[kCountName[kind]] = __atomic_load_n(&link.count[kind], __ATOMIC_RELAXED);
        out["links"].push_back(std::move(l));
    }
    return out;
}

std::string as_text(const Segment& segment, const Snapshot& snapshot) {
    const auto& h = segment.header();
    const auto& node = snapshot.node;
    std::string out = fmt::format("{}  tactiled {}  pid {}  epoch {}  heartbeat {}  worst cycle {} us  missed {}{}{}\n",
                                  h.name, h.version, h.pid, h.epoch, node.heartbeat, node.worst_cycle_us, node.missed_cycles,
                                  (node.status & TACTILED_RT_DEGRADED) != 0 ? "  RT_DEGRADED" : "",
                                  (node.status & TACTILED_SIMULATED) != 0 ? "  simulated" : "");
    out += fmt::format("{:<12} {:>10} {:>10} {:>10} {:>8} {:>8} {:>8} {:>6}  {}\n", "sensor", "fx/N", "fy/N", "fz/N",
                       "sd fz/N", "Hz", "age/ms", "lost", "quality");
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i) {
        const auto& s = snapshot.sensor[i];
        out += fmt::format("{:<12} {} {} {} {} {} {} {:>6}  {}\n", segment.sensor(i).name, number(s.force_S_N[0], 10, 3),
                           number(s.force_S_N[1], 10, 3), number(s.force_S_N[2], 10, 3), number(s.sd_force_N[2], 8, 3),
                           number(double(s.rate_Hz), 8, 1), number(age_ms(s, snapshot.taken_ns), 8, 1), s.lost,
                           quality_text(s.quality, s.reasons));
    }
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (const Front front = front_of(segment, i, snapshot.sensor[i]); !front.methods.empty())
            out += as_text(front, segment.sensor(i));
    for (std::uint32_t i = 0; i < segment.n_links(); ++i) {
        const auto& link = segment.link(i);
        out += fmt::format("link {} ({}, {})", link.name, link.driver, link.state == TACTILED_LINK_OPEN ? "open" : "closed");
        for (int kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
            if (const auto count = __atomic_load_n(&link.count[kind], __ATOMIC_RELAXED);
                kCountName[kind] != nullptr && count != 0)
                out += fmt::format("  {} {}", kCountName[kind], count);
        out += '\n';
    }
    return out;
}

bool is_healthy(const Segment& segment, const Snapshot& snapshot) {
    if (snapshot.taken_ns - snapshot.node.t_ns > std::uint64_t(segment.header().watchdog_ms) * 1'000'000u) return false;
    for (std::uint32_t i = 0; i < segment.n_sensors(); ++i)
        if (snapshot.sensor[i].quality == TACTILED_BAD || snapshot.sensor[i].quality == TACTILED_NO_VALUE) return false;
    return true;
}

struct Wish {
    std::string node = "gripper";
    bool json = false;
    long count = 0;  // 0: until interrupted
    double interval_s = 0.5;
};

int show(const Wish& wish, bool live) {
    catch_interrupt();
    const bool redraw = live && !wish.json && ::isatty(STDOUT_FILENO) != 0;
    int exit_status = kGood;
    for (long n = 0; interrupted == 0; ++n) {
        std::string why;
        const Segment segment = Segment::try_open(wish.node, why);  // anew each time: the daemon may have been restarted
        Snapshot snapshot;
        if (segment.is_open() && segment.snapshot(snapshot)) {
            if (redraw) fmt::print("\x1b[H\x1b[J");
            fmt::print("{}{}", wish.json ? as_json(segment, snapshot).dump() : as_text(segment, snapshot),
                       wish.json ? "\n" : "");
            exit_status = is_healthy(segment, snapshot) ? kGood : kUnhealthy;
        } else {
            fmt::print(stderr, "tactilectl: {}\n", why.empty() ? "the daemon is starting" : why);
            exit_status = kNotReachable;
            if (!live) return exit_status;
        }
        std::fflush(stdout);
        if (!live || n + 1 == wish.count) break;
        std::this_thread::sleep_for(std::chrono::duration<double>(wish.interval_s));
    }
    return exit_status;
}

}  // namespace

void add_status(CLI::App& app, Run& run) {
    auto wish = std::make_shared<Wish>();
    auto* verb = app.add_subcommand("status", "All sensors and links once; exit status 1 when a sensor has no value");
    add_node_option(verb, wish->node);
    verb->add_flag("--json", wish->json, "one JSON object");
    verb->callback([wish, &run] { run = [wish] { return show(*wish, false); }; });
}

void add_top(CLI::App& app, Run& run) {
    auto wish = std::make_shared<Wish>();
    auto* verb = app.add_subcommand("top", "All sensors and links, live");
    add_node_option(verb, wish->node);
    verb->add_flag("--json", wish->json, "one JSON object a line");
    verb->add_option("--count", wish->count, "end after so many")->check(CLI::PositiveNumber);
    verb->add_option("--interval", wish->interval_s, "seconds between two")
        ->check(CLI::Range(0.01, 3600.0))
        ->capture_default_str();
    verb->callback([wish, &run] { run = [wish] { return show(*wish, true); }; });
}

}  // namespace tactiled::ctl
