// What a motion can reach, from its segments alone: nothing is run.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/sim/motion.hpp"

namespace tactiled::sim {
namespace {

struct Span {
    double least = 0, most = 0;
    void take(double v) {
        least = std::min(least, v);
        most = std::max(most, v);
    }
    [[nodiscard]] double size() const { return std::max(std::abs(least), std::abs(most)); }
};

// One quantity of a segment: where it lies, how fast it goes, how far it jumps.
struct Reach {
    Span span;
    double rate = 0, jump = 0;
};

Reach reach_of(const Segment& s, double State::*quantity, double amplitude) {
    const double from = s.from.*quantity, to = s.to.*quantity, length = s.end_s - s.begin_s;
    Reach r{{std::min(from, to), std::max(from, to)}, 0, 0};
    if (s.course == Course::at_once)
        r.jump = std::abs(to - from);
    else
        r.rate = std::abs(to - from) / length * (s.course == Course::smooth ? 1.5 : 1);
    const double a = std::abs(amplitude), hz = std::max(s.from_Hz, s.to_Hz);
    switch (a > 0 ? s.wave : Wave::none) {
        case Wave::none: break;
        case Wave::sine:
            r.rate += 2 * std::numbers::pi * hz * a;
            r.jump += a;  // it may end anywhere in its course
            r.span = {r.span.least - a, r.span.most + a};
            break;
        case Wave::square:
            r.jump += 2 * a;
            r.span = {r.span.least - a, r.span.most + a};
            break;
        case Wave::pulse:
            r.rate += std::numbers::pi * a / length;
            r.span = {r.span.least + std::min(0.0, amplitude), r.span.most + std::max(0.0, amplitude)};
            break;
    }
    return r;
}

}  // namespace

double Extent::change(Axis axis, double seconds) const { return std::min(span[axis], rate[axis] * seconds + jump[axis]); }

std::array<double, kAxes> Extent::changes(double seconds) const {
    std::array<double, kAxes> all{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) all[axis] = change(Axis(axis), seconds);
    return all;
}

Extent Motion::extent(const Sensor& sensor, std::size_t upto) const {
    Extent e;
    std::array<Span, kAxes> span;
    bool excess_known = false;
    const bool taxel = sensor.half_width_m > 0;
    const bool covers = taxel && (body_.shape == Body::Shape::flat || body_.shape == Body::Shape::textured);
    const double share = sensor.share / (covers ? double(sensor.rows * sensor.columns) : 1);
    const double turn_cos = std::cos(sensor.turn_rad), turn_sin = std::sin(sensor.turn_rad);
    std::array<int, kAxes> direction{};  // in which each component went last
    for (std::size_t i = 0; i < segments_.size() && i <= upto; ++i) {
        const Segment& s = segments_[i];
        const double length = s.end_s - s.begin_s;
        e.length_s = s.end_s;
        Reach press = reach_of(s, &State::press_N, s.wave_on_press ? s.amplitude_N : 0);
        press.span = {std::max(0.0, press.span.least), std::max(0.0, press.span.most)};
        const Reach shear = reach_of(s, &State::shear_N, s.wave_on_press ? 0 : s.amplitude_N);
        const Reach turn = reach_of(s, &State::direction_rad, 0);
        const Reach x = reach_of(s, &State::x_m, 0), y = reach_of(s, &State::y_m, 0);

        // Where the contact is, seen from the sensor.
        double off[2] = {0, 0};
        for (const State* q : {&s.from, &s.to}) {
            const double x0 = q->x_m - sensor.x_m, y0 = q->y_m - sensor.y_m;
            off[0] = std::max(off[0], std::abs(turn_cos * x0 + turn_sin * y0));
            off[1] = std::max(off[1], std::abs(turn_cos * y0 - turn_sin * x0));
        }
        const double moves = std::hypot(x.rate, y.rate), hops = std::hypot(x.jump, y.jump);
        const State& first = segments_.front().from;
        for (const State* q : {&s.from, &s.to})
            e.moved_m = std::max(e.moved_m, std::hypot(q->x_m - first.x_m, q->y_m - first.y_m));
        double share_rate = 0, share_jump = 0;
        if (covers)
            off[0] = off[1] = 0;
        else if (taxel) {
            const double radius = contact_radius(body_, sensor);
            share_rate = moves / radius;  // each side of the overlap loses at most 1 / 2a a metre
            share_jump = std::min(1.0, hops / radius);
            for (double& o : off) o = std::min(o, sensor.half_width_m);
        }
        e.x_m = std::max(e.x_m, off[0]);
        e.y_m = std::max(e.y_m, off[1]);

        // Components of the load in the sensor's directions.
        const double T = shear.span.size(), N = press.span.most;
        std::array<Span, kAxes> here;
        std::array<double, kAxes> rate{}, jump{};
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const auto part = [&](double rad) {
                return axis == 0 ? std::cos(rad - sensor.turn_rad) : std::sin(rad - sensor.turn_rad);
            };
            const bool still = s.from.direction_rad == s.to.direction_rad;
            const double most = still ? std::abs(part(s.from.direction_rad)) : 1;
            if (still) {
                const double p = share * part(s.from.direction_rad);
                here[axis] = {std::min(p * shear.span.least, p * shear.span.most),
                              std::max(p * shear.span.least, p * shear.span.most)};
                if (taxel) here[axis].take(0);
            } else {
                here[axis] = {-share * T, share * T};
            }
            rate[axis] = share * (most * shear.rate + T * turn.rate + T * share_rate);
            jump[axis] = share * (most * shear.jump + T * std::min(2.0, turn.jump) + T * share_jump);
        }
        here[kFz] = {-share * N, -share * (taxel ? 0 : press.span.least)};
        rate[kFz] = share * (press.rate + N * share_rate);
        jump[kFz] = share * (press.jump + N * share_jump);
        for (std::size_t m = 0; m < 2; ++m) {
            const std::size_t axis = kMx + m;
            const double arm = off[1 - m];
            here[axis] = {-arm * share * N, arm * share * N};
            rate[axis] = arm * rate[kFz] + (covers ? 0 : share * N * moves);
            jump[axis] = arm * jump[kFz] + (covers ? 0 : share * N * std::min(hops, 2 * arm));
        }
        for (std::size_t axis = 0; axis < kAxes; ++axis) {
            span[axis].take(here[axis].least);
            span[axis].take(here[axis].most);
            e.rate[axis] = std::max(e.rate[axis], rate[axis]);
            e.jump[axis] = std::max(e.jump[axis], jump[axis]);
        }

        // Does anything come back?
        const double before[3] = {s.from.shear_N * std::cos(s.from.direction_rad),
                                  s.from.shear_N * std::sin(s.from.direction_rad), -s.from.press_N};
        const double after[3] = {s.to.shear_N * std::cos(s.to.direction_rad), s.to.shear_N * std::sin(s.to.direction_rad),
                                 -s.to.press_N};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const int sign = after[axis] > before[axis] ? 1 : after[axis] < before[axis] ? -1 : 0;
            if (sign * direction[axis] < 0) e.reverses = true;
            if (sign != 0) direction[axis] = sign;
        }
        if ((s.wave != Wave::none && s.amplitude_N != 0) || turn.rate > 0 || turn.jump > 0 || (taxel && moves + hops > 0) ||
            moves + hops > 0)
            e.reverses = true;

        // Friction: shear and press follow the same course, so their difference is largest at an end, waves aside.
        const double wave = std::abs(s.amplitude_N) * (s.wave == Wave::none ? 0 : 1);
        for (const State* q : {&s.from, &s.to}) {
            const double T_end = std::abs(q->shear_N) + (s.wave_on_press ? 0 : wave);
            const double N_end = std::max(0.0, q->press_N - (s.wave_on_press ? wave : 0));
            if (T_end == 0) continue;
            e.press_least_N = excess_known ? std::min(e.press_least_N, share * N_end) : share * N_end;
            excess_known = true;
            e.shear_excess_N = std::max(e.shear_excess_N, share * (T_end - body_.friction * N_end));
            e.kinetic_excess_N = std::max(e.kinetic_excess_N, share * (T_end - body_.kinetic_friction * N_end));
        }
        if (s.wave == Wave::sine || s.wave == Wave::square) e.frequency_Hz = std::max({e.frequency_Hz, s.from_Hz, s.to_Hz});
        e.speed_m_s = std::max({e.speed_m_s, s.from.speed_m_s, s.to.speed_m_s});
        e.slide_m = s.slid_m + std::max(s.from.speed_m_s, s.to.speed_m_s) * length;
        for (const State* q : {&s.from, &s.to}) {
            e.ambient_K = std::max(e.ambient_K, std::abs(q->ambient_K));
            e.body_K = std::max(e.body_K, std::abs(q->body_K - q->ambient_K));
            e.acceleration_m_s2 = std::max(e.acceleration_m_s2, std::abs(q->acceleration_m_s2));
        }
        const Reach ambient = reach_of(s, &State::ambient_K, 0);
        e.ambient_rate_K_s = std::max(e.ambient_rate_K_s, ambient.jump > 0 ? ambient.jump / length : ambient.rate);
    }
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
        e.most[axis] = span[axis].size();
        e.span[axis] = span[axis].most - span[axis].least;
    }
    return e;
}

}  // namespace tactiled::sim
