#include "drivers/sim/motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/sim/effects/skin.hpp"

namespace tactiled::sim {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kPoint_m = 1e-6;  // the smallest contact

double course_of(const Segment& s, double u) noexcept {
    if (s.course == Course::at_once) return 1;
    return s.course == Course::smooth ? u * u * (3 - 2 * u) : u;
}

// Integral of course_of from 0 to u.
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

// The share of a contact of half width a about x that is on a cell of the given half width: of a flat body's uniform
// pressure, or of Hertz's, whose sum across the contact is proportional to 1 - u^2. The shares of all cells of a row
// add up to 1.
double overlap(double x, double a, double half, bool round) noexcept {
    const auto below = [&](double edge) {
        const double u = std::clamp((edge - x) / a, -1.0, 1.0);
        return round ? 0.5 + u * (0.75 - 0.25 * u * u) : 0.5 + 0.5 * u;
    };
    return below(half) - below(-half);
}

// Copies the previous sample to sample n.
void stay(Block& block, std::size_t n) noexcept {
    for (Block::Row& row : block.load) row[n] = row[n - 1];
    for (Block::Row* row : {&block.x_m, &block.y_m, &block.radius_m, &block.speed_m_s, &block.slide_m, &block.ambient_K,
                            &block.body_K, &block.acceleration_m_s2})
        (*row)[n] = (*row)[n - 1];
}

}  // namespace

double contact_radius(const Body& body, const Sensor& sensor) noexcept {
    const bool flat = body.shape == Body::Shape::flat || body.shape == Body::Shape::textured;
    return flat ? sensor.table.plate_radius_m : body.radius_m;
}

bool grows(const Body& body, const Sensor& sensor) noexcept {
    return sensor.half_width_m > 0 && body.shape == Body::Shape::sphere;
}

double footprint_m(const Body& body, const Sensor& sensor, double press_N) noexcept {
    if (!grows(body, sensor)) return contact_radius(body, sensor);
    return std::max(hertz_radius_m(press_N, body.radius_m, contact_modulus_Pa(skin(sensor), body)), kPoint_m);
}

bool covers_array(const Body& body, const Sensor& sensor) noexcept {
    return (sensor.half_width_m > 0 || sensor.is_array()) &&
           (body.shape == Body::Shape::flat || body.shape == Body::Shape::textured);
}

Motion::Motion(std::vector<Segment> segments, const Body& body) : segments_(std::move(segments)), body_(body) {
    double slid = 0;
    for (Segment& s : segments_) {
        s.slid_m = slid;
        s.still = s.from == s.to && s.from.speed_m_s == 0 && (s.wave == Wave::none || s.amplitude_N == 0);
        slid += (s.from.speed_m_s + (s.to.speed_m_s - s.from.speed_m_s) * path_of(s, 1)) * (s.end_s - s.begin_s);
    }
}

void Motion::fill(Block& block, const Sensor& sensor) const noexcept {
    const double half = sensor.half_width_m;
    const bool covers = covers_array(body_, sensor), round = grows(body_, sensor);
    const double modulus_Pa = round ? contact_modulus_Pa(skin(sensor), body_) : 0;
    double radius = contact_radius(body_, sensor);
    const double fair = sensor.share / (covers && half > 0 ? double(sensor.rows * sensor.columns) : 1);
    const double turn_cos = std::cos(sensor.turn_rad), turn_sin = std::sin(sensor.turn_rad);
    std::size_t at = 0;  // the segment, searched again in each block, because times may decrease slightly
    if (!segments_.empty()) {
        const auto later = std::upper_bound(segments_.begin(), segments_.end(), block.t_s[0],
                                            [](double t, const Segment& s) { return t < s.end_s; });
        at = std::min(std::size_t(later - segments_.begin()), segments_.size() - 1);
    }
    const Segment* last = nullptr;  // segment of the previous sample
    double last_direction = std::numeric_limits<double>::quiet_NaN(), cosine = 1, sine = 0;
    for (std::size_t n = 0; n < block.n; ++n) {
        const double t = block.t_s[n];
        if (segments_.empty()) return;
        while (at + 1 < segments_.size() && t >= segments_[at].end_s) ++at;
        while (at > 0 && t < segments_[at].begin_s) --at;
        const Segment& s = segments_[at];
        if (s.still && last == &s) {
            stay(block, n);
            continue;
        }
        last = &s;
        const double since = std::clamp(t, s.begin_s, s.end_s) - s.begin_s;
        const double u = since / (s.end_s - s.begin_s), c = course_of(s, u);
        const auto between = [&](double State::*q) { return s.from.*q + (s.to.*q - s.from.*q) * c; };
        const double wave = s.wave != Wave::none && t < s.end_s ? wave_of(s, since, u) : 0;
        const double press = std::max(0.0, between(&State::press_N) + (s.wave_on_press ? wave : 0));
        const double shear = between(&State::shear_N) + (s.wave_on_press ? 0 : wave);
        const double direction = between(&State::direction_rad) - sensor.turn_rad;

        // The contact's centre, relative to the sensor.
        const double x0 = between(&State::x_m) - sensor.x_m, y0 = between(&State::y_m) - sensor.y_m;
        double x = turn_cos * x0 + turn_sin * y0, y = turn_cos * y0 - turn_sin * x0, share = fair;
        if (covers) {
            x = y = 0;
        } else if (half > 0) {
            if (round) radius = std::max(hertz_radius_m(sensor.share * press, body_.radius_m, modulus_Pa), kPoint_m);
            share *= overlap(x, radius, half, round) * overlap(y, radius, half, round);
            x = std::clamp(x, -half, half);
            y = std::clamp(y, -half, half);
        }
        if (direction != last_direction) {
            last_direction = direction;
            cosine = std::cos(direction);
            sine = std::sin(direction);
        }
        const double fx = share * shear * cosine, fy = share * shear * sine;
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
