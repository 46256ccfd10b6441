// Computes the range of a motion from its segments alone, without a run.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "drivers/sim/motion.hpp"
#include "drivers/sim/pressure.hpp"

namespace tactiled::sim {
namespace {

struct Span {
    double min = 0, max = 0;
    void take(double v) {
        min = std::min(min, v);
        max = std::max(max, v);
    }
    [[nodiscard]] double size() const { return std::max(std::abs(min), std::abs(max)); }
};

// One quantity of a segment: its range, its rate and its jumps.
struct Reach {
    Span span;
    double rate = 0, jump = 0, end_jump = 0;  // jump at its begin or within it; jump at its end
};

Reach operator*(double factor, Reach r) {
    const double a = factor * r.span.min, b = factor * r.span.max;
    return {{std::min(a, b), std::max(a, b)},
            std::abs(factor) * r.rate,
            std::abs(factor) * r.jump,
            std::abs(factor) * r.end_jump};
}

Reach reach_of(const Segment& s, double State::*quantity, double amplitude = 0) {
    const double from = s.from.*quantity, to = s.to.*quantity, length = s.end_s - s.begin_s;
    Reach r{{std::min(from, to), std::max(from, to)}};
    if (s.course == Course::at_once)
        r.jump = std::abs(to - from);
    else
        r.rate = std::abs(to - from) / length * (s.course == Course::smooth ? 1.5 : 1);
    const double a = std::abs(amplitude), hz = std::max(s.from_Hz, s.to_Hz);
    switch (a > 0 ? s.wave : Wave::none) {
        case Wave::none: break;
        case Wave::sine:
            r.rate += 2 * std::numbers::pi * hz * a;
            r.end_jump = a;  // a square wave may end at any phase
            r.span = {r.span.min - a, r.span.max + a};
            break;
        case Wave::square:
            r.jump += 2 * a;
            r.end_jump = a;
            r.span = {r.span.min - a, r.span.max + a};
            break;
        case Wave::pulse:
            r.rate += std::numbers::pi * a / length;
            r.span = {r.span.min + std::min(0.0, amplitude), r.span.max + std::max(0.0, amplitude)};
            break;
    }
    return r;
}

// The contact's centre, relative to the sensor.
struct Place {
    double arm_m[2] = {0, 0};          // |x|, |y|
    double moves_m_s = 0, hops_m = 0;  // rate and jump of the centre on the sensor
};

Place place_of(const Segment& s, const Sensor& sensor, bool covers) {
    Place p;
    if (covers) return p;
    const double turn_cos = std::cos(sensor.turn_rad), turn_sin = std::sin(sensor.turn_rad);
    for (const State* q : {&s.from, &s.to}) {
        const double x = q->x_m - sensor.x_m, y = q->y_m - sensor.y_m;
        p.arm_m[0] = std::max(p.arm_m[0], std::abs(turn_cos * x + turn_sin * y));
        p.arm_m[1] = std::max(p.arm_m[1], std::abs(turn_cos * y - turn_sin * x));
    }
    const Reach x = reach_of(s, &State::x_m), y = reach_of(s, &State::y_m);
    p.moves_m_s = std::hypot(x.rate, y.rate);
    p.hops_m = std::hypot(x.jump, y.jump);
    if (sensor.is_array()) p.arm_m[0] = p.arm_m[1] = 0;  // on one taxel
    if (sensor.half_width_m > 0)
        for (double& arm : p.arm_m) arm = std::min(arm, sensor.half_width_m);
    return p;
}

// Variation of a taxel's share, as a factor of the whole load: its own rate and jump, and under a sphere the addition
// to those of the press by the growth of the contact.
struct Sharing {
    double rate_1_s = 0, jump = 0, growth = 0;
};

// A share o of overlaps in x and y. A uniform pressure loses at most 1 / 2a per metre at each side, Hertz's 3 / 4a:
// together at most 1.07 / a along a path. A sphere's a is proportional to the cube root of the press N: |N do/dN| <=
// 2/3 max u p(u) = 0.385, and N / a grows with N. A press therefore changes at most as under its largest radius, and
// a shear, which may exist without a press, as under its smallest radius, which may be 0.
Sharing sharing_of(const Place& place, double radius_m, bool grows) {
    return {1.07 * place.moves_m_s / radius_m, std::min(1.0, 1.07 * place.hops_m / radius_m), grows ? 0.385 : 0};
}

// Reduces the load of a body to that of any one taxel, which the contact may leave at any time. Its press F_i grows by at
// most the press N, 0 <= dF_i / dN <= 1; its part of a shear changes by (dF_i / dN - F_i / N) / N, at most 1 / N.
void take_one_taxel(std::array<Reach, kAxes>& load, const Reach& press, double T, const Body& body, const Sensor& sensor,
                    const Place& place, double share) {
    const Pressure pressure(body, sensor);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const bool is_press = axis == kFz;
        const double least_N = std::max(press.span.min, 1e-12), whole = share * (is_press ? press.span.max : T);
        const double of_N = share * (is_press ? press.span.max : press.span.min);
        const double part = pressure.max_part(of_N), slope_1_m = pressure.max_slope_1_m(of_N);
        const double grown = share * (is_press ? 1 : T / least_N), limit = is_press ? share * press.span.max : share * T;
        load[axis] = (is_press ? 0 : part) * load[axis];
        load[axis].rate += grown * press.rate + whole * slope_1_m * place.moves_m_s;
        load[axis].jump += std::min(grown * press.jump, limit) + whole * std::min(1.0, slope_1_m * place.hops_m);
        load[axis].end_jump += std::min(grown * press.end_jump, limit);
        if (is_press) load[axis].span = {-part * whole, 0};
        load[axis].span.take(0);
    }
    load[kMx] = load[kMy] = {};
}

std::array<Reach, kAxes> loads_of(const Segment& s, const Body& body, const Sensor& sensor, const Place& place,
                                  double share) {
    Reach press = reach_of(s, &State::press_N, s.wave_on_press ? s.amplitude_N : 0);
    press.span = {std::max(0.0, press.span.min), std::max(0.0, press.span.max)};
    const Reach shear = reach_of(s, &State::shear_N, s.wave_on_press ? 0 : s.amplitude_N);
    const Reach turn = reach_of(s, &State::direction_rad);
    const double T = shear.span.size(), N = press.span.max;
    std::array<Reach, kAxes> load;
    const double angle = s.from.direction_rad - sensor.turn_rad;
    if (s.from.direction_rad == s.to.direction_rad) {
        load[kFx] = share * std::cos(angle) * shear;
        load[kFy] = share * std::sin(angle) * shear;
    } else {
        const Reach any{{-T, T}, shear.rate + T * turn.rate, shear.jump + T * std::min(2.0, turn.jump), shear.end_jump};
        load[kFx] = load[kFy] = share * any;
    }
    load[kFz] = -share * press;
    if (sensor.half_width_m > 0 && !covers_array(body, sensor)) {
        const double least_N = std::max(press.span.min, 1e-12);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double whole = share * (axis == kFz ? N : T), radius_N = axis == kFz ? N : press.span.min;
            const Sharing sharing =
                sharing_of(place, footprint_m(body, sensor, sensor.share * radius_N), grows(body, sensor));
            const double pressed = axis == kFz ? 1 : T / least_N;  // share of the load for each newton of the press
            load[axis].rate += whole * sharing.rate_1_s + share * sharing.growth * pressed * press.rate;
            load[axis].jump += whole * sharing.jump + share * std::min(sharing.growth * pressed * press.jump, 2 * (N + T));
            load[axis].end_jump += share * std::min(sharing.growth * pressed * press.end_jump, 2 * (N + T));
            load[axis].span.take(0);  // the contact may be elsewhere
        }
    }
    for (std::size_t m = 0; m < 2; ++m) {
        const double arm = place.arm_m[1 - m], max = share * N;
        load[kMx + m] = {{-arm * max, arm * max},
                         arm * load[kFz].rate + max * place.moves_m_s,
                         arm * load[kFz].jump + max * std::min(place.hops_m, 2 * arm),
                         arm * load[kFz].end_jump};
    }
    if (sensor.is_array() && !covers_array(body, sensor)) take_one_taxel(load, press, T, body, sensor, place, share);
    return load;
}

// Shear and press follow the same course, so that their difference is largest at an end, except for waves.
void take_friction(Extent& e, const Segment& s, const Body& body, double share, bool& known) {
    const double wave = s.wave == Wave::none ? 0 : std::abs(s.amplitude_N);
    for (const State* q : {&s.from, &s.to}) {
        const double T = std::abs(q->shear_N) + (s.wave_on_press ? 0 : wave);
        const double N = std::max(0.0, q->press_N - (s.wave_on_press ? wave : 0));
        if (T == 0) continue;
        e.press_min_N = known ? std::min(e.press_min_N, share * N) : share * N;
        known = true;
        e.shear_excess_N = std::max(e.shear_excess_N, share * (T - body.friction * N));
        e.kinetic_excess_N = std::max(e.kinetic_excess_N, share * (T - body.kinetic_friction * N));
    }
}

// Returns true if a component of the load ever decreases. `went`: -1, 0 or 1, the last direction of each.
bool reverses(const Segment& s, const Place& place, std::array<int, 3>& went) {
    const auto of = [](const State& q) {
        return std::array{q.shear_N * std::cos(q.direction_rad), q.shear_N * std::sin(q.direction_rad), -q.press_N};
    };
    const auto from = of(s.from), to = of(s.to);
    bool back = (s.wave != Wave::none && s.amplitude_N != 0) || s.from.direction_rad != s.to.direction_rad ||
                place.moves_m_s + place.hops_m > 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const int sign = to[axis] > from[axis] ? 1 : to[axis] < from[axis] ? -1 : 0;
        back = back || sign * went[axis] < 0;
        if (sign != 0) went[axis] = sign;
    }
    return back;
}

void take_surroundings(Extent& e, const Segment& s, const State& first) {
    const double length = s.end_s - s.begin_s;
    if (s.wave == Wave::sine || s.wave == Wave::square) e.frequency_Hz = std::max({e.frequency_Hz, s.from_Hz, s.to_Hz});
    e.speed_m_s = std::max({e.speed_m_s, s.from.speed_m_s, s.to.speed_m_s});
    e.slide_m = s.slid_m + std::max(s.from.speed_m_s, s.to.speed_m_s) * length;
    for (const State* q : {&s.from, &s.to}) {
        e.moved_m = std::max(e.moved_m, std::hypot(q->x_m - first.x_m, q->y_m - first.y_m));
        e.ambient_K = std::max(e.ambient_K, std::abs(q->ambient_K));
        e.body_K = std::max(e.body_K, std::abs(q->body_K - q->ambient_K));
        e.acceleration_m_s2 = std::max(e.acceleration_m_s2, std::abs(q->acceleration_m_s2));
    }
    const Reach ambient = reach_of(s, &State::ambient_K);
    e.ambient_rate_K_s = std::max(e.ambient_rate_K_s, ambient.jump > 0 ? 1e30 : ambient.rate);
}

}  // namespace

double Extent::change(Axis axis, double seconds) const {
    const double apart = apart_s(seconds), jumps = 1 + std::floor(apart / jump_every_s);
    return std::min(span[axis], rate[axis] * apart + jump[axis] * jumps + 2 * added[axis]);
}

Load Extent::changes(double seconds) const {
    Load all{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) all[axis] = change(Axis(axis), seconds);
    return all;
}

Extent Motion::extent(const Sensor& sensor, std::size_t first, std::size_t last) const {
    Extent e;
    std::array<Span, kAxes> span;
    std::array<int, 3> went{};
    Load end_jump{};  // jump at the end of the previous segment
    double jumped_s = -std::numeric_limits<double>::infinity();
    bool friction_known = false;
    const bool covers = covers_array(body_, sensor);
    const double share = sensor.share / (covers ? double(sensor.rows * sensor.columns) : 1);
    for (std::size_t i = 0; i < segments_.size() && i <= last; ++i) {
        const Segment& s = segments_[i];
        const Place place = place_of(s, sensor, covers);
        const auto load = loads_of(s, body_, sensor, place, share);
        if (i < first) {  // segments before `first` only set the state for the next segment
            for (std::size_t axis = 0; axis < kAxes; ++axis) end_jump[axis] = load[axis].end_jump;
            std::ignore = reverses(s, place, went);
            continue;
        }
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
            span[axis].take(load[axis].span.min);
            span[axis].take(load[axis].span.max);
            e.rate[axis] = std::max(e.rate[axis], load[axis].rate);
            const double jump = end_jump[axis] + load[axis].jump;
            if (jump > 0 && jumped_s != s.begin_s) {
                e.jump_every_s = std::min(e.jump_every_s, s.begin_s - jumped_s);
                jumped_s = s.begin_s;
            }
            e.jump[axis] = std::max({e.jump[axis], jump, load[axis].end_jump});
            end_jump[axis] = load[axis].end_jump;
        }
        e.x_m = std::max(e.x_m, place.arm_m[0]);
        e.y_m = std::max(e.y_m, place.arm_m[1]);
        e.reverses |= reverses(s, place, went);
        take_friction(e, s, body_, share, friction_known);
        take_surroundings(e, s, segments_.front().from);
        e.length_s = s.end_s;
    }
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
        e.max[axis] = span[axis].size();
        e.span[axis] = span[axis].max - span[axis].min;
    }
    return e;
}

}  // namespace tactiled::sim
