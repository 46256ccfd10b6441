// Reads the [[motion]] tables of a scene, which follow each other in time. README.md has the list.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/sim/motion.hpp"
#include "drivers/sim/random.hpp"

namespace tactiled::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180, kGravity_m_s2 = 9.80665;
constexpr std::size_t kMaxSegments = 200'000;

// Builds the list of segments: each motion begins at the end of the previous one.
struct Builder {
    Options& scene;
    const Body& body;
    double rate_Hz;
    std::vector<Segment> segments{};
    std::vector<std::size_t> begins{};  // first segment of each motion
    State state{};

    Segment& add(const std::string& kind, double length_s, const State& to, Course course = Course::linear) {
        Segment s;
        s.begin_s = segments.empty() ? 0 : segments.back().end_s;
        s.end_s = s.begin_s + std::max(length_s, 1 / rate_Hz);
        s.from = state;
        s.to = state = to;
        s.course = course;
        s.kind = kind;
        return segments.emplace_back(std::move(s));
    }
};

Course read_course(Options& m) {
    const auto name = m.one_of("course", {"linear", "smooth", "at_once"}, "linear");
    return name == "smooth" ? Course::smooth : name == "at_once" ? Course::at_once : Course::linear;
}

constexpr Range kForce_N{0, 1e4}, kSeconds{0, 1e7}, kDegrees{-36000, 36000};

void press(Builder& b, Options& m) {
    State to = b.state;
    to.press_N = m.number("to_N", kForce_N);
    b.add("press", m.number("in_s", kSeconds, 0.1), to, read_course(m));
}

// Reads the direction of a shear. Without a shear before, the direction changes immediately.
void take_direction(Builder& b, Options& m, State& to) {
    to.direction_rad = m.number("direction_deg", kDegrees, b.state.direction_rad / kDegree) * kDegree;
    if (b.state.shear_N == 0) b.state.direction_rad = to.direction_rad;
}

void shear(Builder& b, Options& m) {
    State to = b.state;
    to.shear_N = m.number("to_N", {-1e4, 1e4});
    take_direction(b, m, to);
    b.add("shear", m.number("in_s", kSeconds, 0.1), to, read_course(m));
}

void rotate(Builder& b, Options& m) {
    State to = b.state;
    to.direction_rad += m.number("by_deg", kDegrees) * kDegree;
    b.add("rotate", m.number("in_s", kSeconds, 0.1), to, read_course(m));
}

// Adds `count` equal steps, each reached in `in_s` and held for `hold_s`.
void steps(Builder& b, Options& m) {
    const std::string on = m.one_of("on", {"press", "shear", "direction"}, "press");
    const auto count = std::size_t(m.integer("count", {1, 1000}));
    const double in_s = m.number("in_s", kSeconds, 0.05), hold_s = m.number("hold_s", kSeconds, 0.2);
    double State::*const quantity = on == "press"   ? &State::press_N
                                    : on == "shear" ? &State::shear_N
                                                    : &State::direction_rad;
    State to = b.state;
    if (on == "direction") {
        to.direction_rad += m.number("by_deg", kDegrees) * kDegree;
    } else {
        to.*quantity = m.number("to_N", on == "press" ? kForce_N : Range{-1e4, 1e4});
    }
    if (on == "shear") take_direction(b, m, to);
    const double from = b.state.*quantity, end = to.*quantity;
    const Course course = read_course(m);
    for (std::size_t i = 1; i <= count; ++i) {
        to.*quantity = i == count ? end : from + (end - from) * double(i) / double(count);
        b.add("steps", in_s, to, course);
        b.add("steps", hold_s, to);
    }
}

// Moves from one random load to the next and holds each, as a calibration needs it. The loads are uniformly
// distributed: the press, the shear in any direction up to a share of its maximum, the place on a disc. Mirrored: all
// of them again in the same order, with shear and place rotated by 180 degrees. The memory of the skin for a shear is
// then the opposite at the same press, so that a fit does not attribute it to the press. With `rest_s`: in groups
// of 1 to 8 loads, which are multiplied by one random factor of 0.1 to 1, and the load is released after each group.
void wander(Builder& b, Options& m) {
    const auto count = std::size_t(m.integer("count", {1, 10'000}));
    const Stream random(std::uint64_t(m.integer("seed", {0, 9e15}, 1)), "wander");
    const double min_N = m.number("press_from_N", kForce_N, 0), max_N = m.number("press_to_N", kForce_N);
    const double shear_N = m.number("shear_to_N", kForce_N, 0), within_m = m.number("within_m", {0, 1}, 0);
    const double in_s = m.number("in_s", kSeconds, 0.05), hold_s = m.number("hold_s", kSeconds, 0.2);
    if (min_N > max_N) m.problem("press_from_N", "press_from_N is more than press_to_N");
    const double rest_s = m.number("rest_s", kSeconds, 0);
    const bool mirrored = m.flag("mirrored", false);
    const Course course = read_course(m);
    State to = b.state;
    double share = 1;
    std::size_t left = 0;  // loads of this group
    for (std::size_t k = 0; k < (mirrored ? 2 * count : count); ++k) {
        const std::size_t i = k % count;
        const double turned_rad = k < count ? 0 : std::numbers::pi;
        if (rest_s > 0 && left == 0) {
            left = std::min(1 + std::size_t(8 * random.uniform(i, 5)), count - i);
            share = 0.1 + 0.9 * random.uniform(i, 6);
        }
        to.press_N = share * (min_N + (max_N - min_N) * random.uniform(i, 0));
        to.shear_N = share * shear_N * std::sqrt(random.uniform(i, 1));
        to.direction_rad = 2 * std::numbers::pi * random.uniform(i, 2) + turned_rad;
        if (within_m > 0) {
            const double away_m = within_m * std::sqrt(random.uniform(i, 3)),
                         angle = 2 * std::numbers::pi * random.uniform(i, 4) + turned_rad;
            to.x_m = away_m * std::cos(angle);
            to.y_m = away_m * std::sin(angle);
        }
        if (b.state.shear_N == 0) b.state.direction_rad = to.direction_rad;
        b.add("wander", in_s, to, course);
        b.add("wander", hold_s, to);
        if (rest_s > 0 && --left == 0) {
            to.press_N = to.shear_N = 0;
            b.add("wander", in_s, to, course);
            b.add("wander", rest_s, to);
        }
    }
}

void hold(Builder& b, Options& m) { b.add("hold", m.number("for_s", kSeconds), b.state); }

void move(Builder& b, Options& m) {
    State to = b.state;
    to.x_m = m.number("x_m", {-1, 1}, to.x_m);
    to.y_m = m.number("y_m", {-1, 1}, to.y_m);
    b.add("move", m.number("in_s", kSeconds, 0.1), to, read_course(m));
}

void slide(Builder& b, Options& m) {
    State to = b.state;
    to.speed_m_s = m.number("speed_m_s", {0, 100});
    b.add("slide", m.number("in_s", kSeconds, 0.1), to, read_course(m));
}

void slip(Builder& b, Options& m) {
    State to = b.state;
    to.speed_m_s = m.number("speed_m_s", {0, 100}, 0.02);
    to.shear_N = b.body.kinetic_friction * b.state.press_N;
    const double length_s = m.number("for_s", kSeconds, 0.2);
    b.add("slip", 0.005, to, Course::smooth);
    b.add("slip", length_s, to);
    to.speed_m_s = 0;
    b.add("slip", 0.005, to, Course::smooth);
}

void tap(Builder& b, Options& m) {
    const double peak_N = m.number("peak_N", kForce_N);
    Segment& s = b.add("tap", m.number("for_s", kSeconds, 0.02), b.state);
    s.wave = Wave::pulse;
    s.amplitude_N = peak_N;
}

void wave(Builder& b, Options& m, const std::string& kind, Wave form) {
    const double amplitude_N = m.number("amplitude_N", kForce_N), from_Hz = m.number("from_Hz", {0.001, 1e4});
    const double to_Hz = form == Wave::sine ? m.number("to_Hz", {0.001, 1e4}, from_Hz) : from_Hz;
    const bool on_press = m.one_of("on", {"press", "shear"}, "press") == "press";
    Segment& s = b.add(kind, m.number("for_s", kSeconds), b.state);
    s.wave = form;
    s.amplitude_N = amplitude_N;
    s.from_Hz = from_Hz;
    s.to_Hz = to_Hz;
    s.wave_on_press = on_press;
}

void warm(Builder& b, Options& m) {
    State to = b.state;
    to.ambient_K += m.number("ambient_by_K", {-200, 200}, 0);
    to.body_K += m.number("body_by_K", {-200, 200}, 0);
    b.add("warm", m.number("in_s", kSeconds), to, read_course(m));
}

// The sensors take the body's weight, then the body is lifted: accelerated, moved, decelerated, at rest. If the
// weight has a component into the skin, its sine presses.
void lift(Builder& b, Options& m) {
    const double mass_kg = m.number("mass_kg", {0, 1000}, b.body.mass_kg);
    if (mass_kg <= 0) m.problem("do", "lift needs [body] mass_kg or its own");
    State to = b.state;
    const double up_m_s2 = m.number("acceleration_m_s2", {0, 100}, 1), length_s = m.number("for_s", kSeconds, 0.8);
    const double travel_s = m.number("travel_s", kSeconds, 0), lean = m.number("lean_deg", {-90, 90}, 0) * kDegree;
    const double amplitude_N = m.number("vibration_N", kForce_N, 0), from_Hz = m.number("vibration_Hz", {0.001, 1e4}, 30);
    take_direction(b, m, to);
    const double press_N = b.state.press_N;
    const auto goes = [&](double seconds, double acceleration) {
        to.acceleration_m_s2 = acceleration;
        to.shear_N = mass_kg * (kGravity_m_s2 + acceleration) * std::cos(lean);
        to.press_N = std::max(0.0, press_N + mass_kg * (kGravity_m_s2 + acceleration) * std::sin(lean));
        Segment& s = b.add("lift", seconds, to, Course::smooth);
        if (amplitude_N <= 0) return;
        s.wave = Wave::sine;
        s.wave_on_press = false;
        s.amplitude_N = amplitude_N;
        s.from_Hz = s.to_Hz = from_Hz;
    };
    goes(m.number("in_s", kSeconds, 0.2), 0);
    goes(length_s / 4, up_m_s2);
    goes(length_s / 4, 0);
    if (travel_s > 0) goes(travel_s, 0);
    goes(length_s / 4, -up_m_s2);
    goes(length_s / 4, 0);
}

void release(Builder& b, Options& m) {
    State to = b.state;
    to.press_N = to.shear_N = 0;
    b.add("release", m.number("in_s", kSeconds, 0.1), to, read_course(m));
}

void drop(Builder& b, Options& m) {
    State to = b.state;
    to.press_N = to.shear_N = to.speed_m_s = 0;
    b.add("drop", m.number("for_s", kSeconds, 0.1), to, Course::at_once);
}

void repeat(Builder& b, Options& m) {
    const auto last = std::size_t(m.integer("last", {1, 1000}, 1)), times = std::size_t(m.integer("times", {2, 1'000'000}));
    if (last > b.begins.size())
        return m.problem("last", fmt::format("there are only {} motions before it", b.begins.size()));
    const std::size_t begin = b.begins[b.begins.size() - last], count = b.segments.size() - begin;
    if (count * times > kMaxSegments)
        return m.problem("times", fmt::format("{} steps in all, at most {} are possible", count * times, kMaxSegments));
    const State& from = b.segments[begin].from;
    // Whole rotations make no difference; neither does a rotation without shear.
    const double turns = (b.state.direction_rad - from.direction_rad) / (2 * std::numbers::pi);
    const bool same_direction = (from.shear_N == 0 && b.state.shear_N == 0) || std::abs(turns - std::round(turns)) < 1e-9;
    if (from.press_N != b.state.press_N || from.shear_N != b.state.shear_N || from.x_m != b.state.x_m ||
        from.y_m != b.state.y_m || from.speed_m_s != b.state.speed_m_s || from.ambient_K != b.state.ambient_K ||
        from.body_K != b.state.body_K || from.acceleration_m_s2 != b.state.acceleration_m_s2 || !same_direction)
        return m.problem("do", "what is repeated must end where it began");
    const double begun_s = b.segments[begin].begin_s, period_s = b.segments.back().end_s - begun_s;
    for (std::size_t k = 1; k < times; ++k)
        for (std::size_t i = 0; i < count; ++i) {
            Segment s = b.segments[begin + i];
            s.begin_s += double(k) * period_s;
            s.end_s = i + 1 == count ? begun_s + double(k + 1) * period_s : s.end_s + double(k) * period_s;
            if (i > 0) s.begin_s = b.segments.back().end_s;
            b.segments.push_back(std::move(s));
        }
}

struct Kind {
    std::string_view name;
    void (*read)(Builder&, Options&);
};
constexpr Kind kKinds[] = {{"press", press},
                           {"shear", shear},
                           {"rotate", rotate},
                           {"steps", steps},
                           {"wander", wander},
                           {"hold", hold},
                           {"move", move},
                           {"slide", slide},
                           {"slip", slip},
                           {"tap", tap},
                           {"shake", [](Builder& b, Options& m) { wave(b, m, "shake", Wave::sine); }},
                           {"square", [](Builder& b, Options& m) { wave(b, m, "square", Wave::square); }},
                           {"warm", warm},
                           {"lift", lift},
                           {"release", release},
                           {"drop", drop},
                           {"repeat", repeat}};

}  // namespace

Motion read_motion(Options& scene, const Body& body, double rate_Hz) {
    Builder builder{scene, body, rate_Hz};
    builder.state.body_K = body.temperature_K;
    std::vector<std::string> names;
    for (const Kind& kind : kKinds) names.emplace_back(kind.name);
    for (Options& motion : scene.tables("motion", 1000)) {
        const std::string name = motion.one_of("do", names);
        const std::size_t begin = builder.segments.size();
        for (const Kind& kind : kKinds)
            if (kind.name == name) kind.read(builder, motion);
        builder.begins.push_back(begin);
        if (builder.segments.size() > kMaxSegments) motion.problem("do", "more than 200000 steps in all");
    }
    if (builder.begins.empty()) scene.problem("motion", "a scene has at least one [[motion]]");
    return {std::move(builder.segments), body};
}

}  // namespace tactiled::sim
