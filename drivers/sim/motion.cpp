#include "drivers/sim/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tactiled::sim {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

double course_of(const Segment& s, double u) noexcept {
    if (s.course == Course::at_once) return 1;
    return s.course == Course::smooth ? u * u * (3 - 2 * u) : u;
}

// The integral of course_of from 0 to u.
double path_of(const Segment& s, double u) noexcept {
    if (s.course == Course::at_once) return u;
    return s.course == Course::smooth ? u * u * u * (1 - u / 2) : u * u / 2;
}

double wave_of(const Segment& s, double since_s, double u) noexcept {
    const double cycles = (s.from_Hz + (s.to_Hz - s.from_Hz) * u / 2) * since_s;
    switch (s.wave) {
        case Wave::none: return 0;
        case Wave::sine: return s.amplitude_N * std::sin(kTurn * (cycles - std::floor(cycles)));
        case Wave::square: return cycles - std::floor(cycles) < 0.5 ? s.amplitude_N : -s.amplitude_N;
        case Wave::pulse: return s.amplitude_N * std::sin(std::numbers::pi * u);
    }
    return 0;
}

// The part of [x - a, x + a] that lies on a cell of that half width.
double overlap(double x, double a, double half) noexcept {
    return std::max(0.0, std::min(x + a, half) - std::max(x - a, -half)) / (2 * a);
}

}  // namespace

double contact_radius(const Body& body, const Sensor& sensor) noexcept {
    const bool flat = body.shape == Body::Shape::flat || body.shape == Body::Shape::textured;
    return flat ? sensor.table.plate_radius_m : body.radius_m;
}

bool covers_array(const Body& body, const Sensor& sensor) noexcept {
    return sensor.half_width_m > 0 && (body.shape == Body::Shape::flat || body.shape == Body::Shape::textured);
}

Motion::Motion(std::vector<Segment> segments, const Body& body) : segments_(std::move(segments)), body_(body) {
    double slid = 0;
    for (Segment& s : segments_) {
        s.slid_m = slid;
        slid += (s.from.speed_m_s + (s.to.speed_m_s - s.from.speed_m_s) * path_of(s, 1)) * (s.end_s - s.begin_s);
    }
}

void Motion::fill(Block& block, const Sensor& sensor) const noexcept {
    const double radius = contact_radius(body_, sensor), half = sensor.half_width_m;
    const bool covers = covers_array(body_, sensor);
    const double fair = sensor.share / (covers ? double(sensor.rows * sensor.columns) : 1);
    const double turn_cos = std::cos(sensor.turn_rad), turn_sin = std::sin(sensor.turn_rad);
    std::size_t at = 0;  // the segment, found anew in each block: times may go back a little
    if (!segments_.empty()) {
        const auto later = std::upper_bound(segments_.begin(), segments_.end(), block.t_s[0],
                                            [](double t, const Segment& s) { return t < s.end_s; });
        at = std::min(std::size_t(later - segments_.begin()), segments_.size() - 1);
    }
    for (std::size_t n = 0; n < block.n; ++n) {
        const double t = block.t_s[n];
        if (segments_.empty()) return;
        while (at + 1 < segments_.size() && t >= segments_[at].end_s) ++at;
        while (at > 0 && t < segments_[at].begin_s) --at;
        const Segment& s = segments_[at];
        const double since = std::clamp(t, s.begin_s, s.end_s) - s.begin_s;
        const double u = since / (s.end_s - s.begin_s), c = course_of(s, u);
        const auto between = [&](double State::*q) { return s.from.*q + (s.to.*q - s.from.*q) * c; };
        const double wave = s.wave != Wave::none && t < s.end_s ? wave_of(s, since, u) : 0;
        const double press = std::max(0.0, between(&State::press_N) + (s.wave_on_press ? wave : 0));
        const double shear = between(&State::shear_N) + (s.wave_on_press ? 0 : wave);
        const double direction = between(&State::direction_rad) - sensor.turn_rad;

        // The contact's centre, seen from the sensor.
        const double x0 = between(&State::x_m) - sensor.x_m, y0 = between(&State::y_m) - sensor.y_m;
        double x = turn_cos * x0 + turn_sin * y0, y = turn_cos * y0 - turn_sin * x0, share = fair;
        if (covers) {
            x = y = 0;
        } else if (half > 0) {
            share *= overlap(x, radius, half) * overlap(y, radius, half);
            x = std::clamp(x, -half, half);
            y = std::clamp(y, -half, half);
        }
        const double fx = share * shear * std::cos(direction), fy = share * shear * std::sin(direction);
        const double fz = -share * press;
        block.load[kFx][n] = fx;
        block.load[kFy][n] = fy;
        block.load[kFz][n] = fz;
        block.load[kMx][n] = y * fz;  // r x F with the contact on the surface, z = 0
        block.load[kMy][n] = -x * fz;
        block.x_m[n] = x;
        block.y_m[n] = y;
        block.radius_m[n] = radius;
        block.speed_m_s[n] = between(&State::speed_m_s);
        block.slide_m[n] =
            s.slid_m + (s.from.speed_m_s * u + (s.to.speed_m_s - s.from.speed_m_s) * path_of(s, u)) * (s.end_s - s.begin_s);
        block.ambient_K[n] = between(&State::ambient_K);
        block.body_K[n] = between(&State::body_K);
        block.acceleration_m_s2[n] = between(&State::acceleration_m_s2);
    }
}

}  // namespace tactiled::sim
