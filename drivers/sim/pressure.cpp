#include "drivers/sim/pressure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "drivers/sim/effects/skin.hpp"

namespace tactiled::sim {
namespace {

constexpr double kPi = std::numbers::pi, kPoint_m = 1e-6;  // the smallest half width of a contact
// The parts of a ball are sums of eight terms. Their error is below this part of the force (pressure_test.cpp).
constexpr double kQuadrature = 1e-5;

// Quadrature of Gauss and Legendre with eight points on -1 .. 1.
constexpr std::array<double, 4> kNode{0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
constexpr std::array<double, 4> kWeight{0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};

// Integral of (c^2 - y^2)^(1/2) from 0 to y, which is limited to -c .. c.
double half_disc(double y, double c) noexcept {
    const double u = std::clamp(y, -c, c);
    return 0.5 * (u * std::sqrt(c * c - u * u) + c * c * std::asin(u / c));
}

// Part of the pressure of Hertz on the unit disc that is on x0 .. x1, y0 .. y1. With x = sin(t) the integral over y is in
// closed form; over t it is smooth between the angles at which the rim crosses y0 and y1.
double on_ball(double x0, double x1, double y0, double y1) noexcept {
    const double t0 = std::asin(std::clamp(x0, -1.0, 1.0)), t1 = std::asin(std::clamp(x1, -1.0, 1.0));
    const double a0 = std::acos(std::min(std::abs(y0), 1.0)), a1 = std::acos(std::min(std::abs(y1), 1.0));
    std::array<double, 6> ends{t0, -a0, -a1, a0, a1, t1};
    for (double& end : ends) end = std::clamp(end, t0, t1);
    std::sort(ends.begin(), ends.end());
    double sum = 0;
    for (std::size_t e = 0; e + 1 < ends.size(); ++e) {
        const double middle = (ends[e] + ends[e + 1]) / 2, half = (ends[e + 1] - ends[e]) / 2;
        for (std::size_t i = 0; i < kNode.size() && half > 0; ++i)
            for (const double t : {middle - half * kNode[i], middle + half * kNode[i]}) {
                const double c = std::cos(t);
                sum += half * kWeight[i] * c * (half_disc(y1, c) - half_disc(y0, c));
            }
    }
    return 1.5 / kPi * sum;
}

// A pressure across a strip of half width b, of total 1: its integral from 0, and the integral of that.
struct Across {
    double b;
    bool round;  // Hertz, else even

    [[nodiscard]] double once(double v) const noexcept {
        const double w = std::clamp(v / b, -1.0, 1.0);
        return round ? (w * std::sqrt(1 - w * w) + std::asin(w)) / kPi : w / 2;
    }
    [[nodiscard]] double twice(double v) const noexcept {
        const double w = std::min(std::abs(v) / b, 1.0), beyond = std::max(std::abs(v) - b, 0.0) / 2;
        const double root = std::sqrt(1 - w * w);
        return beyond + b * (round ? (w * std::asin(w) + root - root * root * root / 3 - 2.0 / 3) / kPi : w * w / 4);
    }
};

struct Point {
    double u, v;  // along and across the strip
};

struct Polygon {
    std::array<Point, 8> at{};
    std::size_t n = 0;
};

// The part of a polygon with side * u <= limit.
Polygon cut(const Polygon& polygon, double side, double limit) noexcept {
    Polygon result;
    for (std::size_t i = 0; i < polygon.n; ++i) {
        const Point a = polygon.at[i], b = polygon.at[(i + 1) % polygon.n];
        const double from = limit - side * a.u, to = limit - side * b.u;
        if (from >= 0) result.at[result.n++] = a;
        if ((from > 0 && to < 0) || (from < 0 && to > 0)) {
            const double part = from / (from - to);
            result.at[result.n++] = {a.u + (b.u - a.u) * part, a.v + (b.v - a.v) * part};
        }
    }
    return result;
}

// Green: the integral of g(v) over a polygon, counterclockwise, is minus the integral of G(v) du along its sides.
double on_strip(const Polygon& polygon, const Across& across) noexcept {
    double sum = 0;
    for (std::size_t i = 0; i < polygon.n; ++i) {
        const Point a = polygon.at[i], b = polygon.at[(i + 1) % polygon.n];
        const bool along = std::abs(b.v - a.v) < 1e-6 * across.b;
        sum -= (b.u - a.u) * (along ? across.once((a.v + b.v) / 2) : (across.twice(b.v) - across.twice(a.v)) / (b.v - a.v));
    }
    return std::max(sum, 0.0);
}

bool is_ball(const Body& body) { return body.shape == Body::Shape::sphere || body.shape == Body::Shape::fingers; }

}  // namespace

Pressure::Pressure(const Body& body, const Sensor& array)
    : body_(body),
      rows_(array.rows),
      columns_(array.columns),
      pitch_m_(array.pitch_m),
      modulus_Pa_(contact_modulus_Pa(skin(array), body)),
      cosine_(std::cos(body.turn_rad - array.turn_rad)),
      sine_(std::sin(body.turn_rad - array.turn_rad)) {}

double Pressure::half_width_m(double press_N) const noexcept {
    const double N = std::max(press_N, 0.0), R = body_.radius_m;
    switch (body_.shape) {
        case Body::Shape::sphere: return std::max(hertz_radius_m(N, R, modulus_Pa_), kPoint_m);
        case Body::Shape::fingers: return std::max(hertz_radius_m(N / 2, R, modulus_Pa_), kPoint_m);
        case Body::Shape::cylinder:
            return std::clamp(std::sqrt(4 * N * R / (kPi * body_.length_m * modulus_Pa_)), kPoint_m, std::max(R, kPoint_m));
        case Body::Shape::edge: return R;
        case Body::Shape::flat:
        case Body::Shape::textured: break;
    }
    return 0;
}

double Pressure::x_m(std::size_t column) const noexcept { return (double(column) - double(columns_ - 1) / 2) * pitch_m_; }
double Pressure::y_m(std::size_t row) const noexcept { return (double(rows_ - 1) / 2 - double(row)) * pitch_m_; }

Pressure::Ends Pressure::columns_in(double from_m, double to_m) const noexcept {
    const double left_m = -double(columns_) / 2 * pitch_m_, most = double(columns_);
    return {std::size_t(std::clamp(std::floor((from_m - left_m) / pitch_m_), 0.0, most)),
            std::size_t(std::clamp(std::ceil((to_m - left_m) / pitch_m_), 0.0, most))};
}
Pressure::Ends Pressure::rows_in(double from_m, double to_m) const noexcept {
    const double top_m = double(rows_) / 2 * pitch_m_, most = double(rows_);
    return {std::size_t(std::clamp(std::floor((top_m - to_m) / pitch_m_), 0.0, most)),
            std::size_t(std::clamp(std::ceil((top_m - from_m) / pitch_m_), 0.0, most))};
}

// Adds `share` times the parts of a ball; returns true if no part of it is beside the array.
bool Pressure::add_ball(double share, double a_m, double x, double y, std::vector<double>& part) const noexcept {
    const Ends rows = rows_in(y - a_m, y + a_m), columns = columns_in(x - a_m, x + a_m);
    const double half = pitch_m_ / 2;
    for (std::size_t row = rows.begin; row < rows.end; ++row)
        for (std::size_t column = columns.begin; column < columns.end; ++column) {
            const double dx = x_m(column) - x, dy = y_m(row) - y;
            part[row * columns_ + column] +=
                share * on_ball((dx - half) / a_m, (dx + half) / a_m, (dy - half) / a_m, (dy + half) / a_m);
        }
    return std::abs(x) + a_m <= double(columns_) * half && std::abs(y) + a_m <= double(rows_) * half;
}

// The same for an edge or a cylinder of half width b.
bool Pressure::add_strip(double b_m, double x, double y, std::vector<double>& part) const noexcept {
    const double long_m = body_.length_m / 2, half = pitch_m_ / 2;
    const double reach_x = std::abs(cosine_) * long_m + std::abs(sine_) * b_m,
                 reach_y = std::abs(sine_) * long_m + std::abs(cosine_) * b_m;
    const Ends rows = rows_in(y - reach_y, y + reach_y), columns = columns_in(x - reach_x, x + reach_x);
    const Across across{b_m, body_.shape == Body::Shape::cylinder};
    for (std::size_t row = rows.begin; row < rows.end; ++row)
        for (std::size_t column = columns.begin; column < columns.end; ++column) {
            Polygon square;
            for (const auto& [sx, sy] : {Point{-half, -half}, {half, -half}, {half, half}, {-half, half}}) {
                const double dx = x_m(column) - x + sx, dy = y_m(row) - y + sy;
                square.at[square.n++] = {cosine_ * dx + sine_ * dy, cosine_ * dy - sine_ * dx};
            }
            part[row * columns_ + column] += on_strip(cut(cut(square, 1, long_m), -1, long_m), across) / body_.length_m;
        }
    return std::abs(x) + reach_x <= double(columns_) * half && std::abs(y) + reach_y <= double(rows_) * half;
}

Pressure::Contact Pressure::spread(double press_N, double x, double y, std::vector<double>& part) const noexcept {
    const double half_m = half_width_m(press_N), ball_m2 = kPi * half_m * half_m;
    Contact contact{true, 0};
    std::fill(part.begin(), part.end(), 0.0);
    switch (body_.shape) {
        case Body::Shape::sphere: contact = {add_ball(1, half_m, x, y, part), ball_m2}; break;
        case Body::Shape::fingers: {
            const double dx = cosine_ * body_.apart_m / 2, dy = sine_ * body_.apart_m / 2;
            const bool one = add_ball(0.5, half_m, x - dx, y - dy, part),
                       other = add_ball(0.5, half_m, x + dx, y + dy, part);
            contact = {one && other, 2 * ball_m2};
            break;
        }
        case Body::Shape::edge:
        case Body::Shape::cylinder: contact = {add_strip(half_m, x, y, part), 2 * half_m * body_.length_m}; break;
        case Body::Shape::flat:
        case Body::Shape::textured:
            std::fill(part.begin(), part.end(), 1 / double(part.size()));
            return {true, double(part.size()) * pitch_m_ * pitch_m_};
    }
    const double sum = std::accumulate(part.begin(), part.end(), 0.0);
    if (contact.is_whole && sum > 0)
        for (double& p : part) p /= sum;
    return contact;
}

// Largest pressure of a force of 1 N.
double Pressure::peak_1_m2(double press_N) const {
    const double half_m = half_width_m(press_N);
    if (is_ball(body_)) return 1.5 / (kPi * half_m * half_m);  // also of two fingertips at one place
    return (body_.shape == Body::Shape::cylinder ? 4 / kPi : 1) / (2 * half_m * body_.length_m);
}

double Pressure::max_part(double press_N) const {
    if (half_width_m(press_N) == 0) return 1 / double(rows_ * columns_);
    return std::min(1.0, peak_1_m2(press_N) * pitch_m_ * pitch_m_ + kQuadrature);
}

// The part changes by the pressure at the sides that the contact crosses, each at most pitch * peak.
double Pressure::max_slope_1_m(double press_N) const {
    if (half_width_m(press_N) == 0) return 0;
    return std::numbers::sqrt2 * peak_1_m2(press_N) * pitch_m_;
}

double Pressure::axis_rad() const {
    const bool round = body_.shape == Body::Shape::sphere || half_width_m(1) == 0;
    return round ? std::numeric_limits<double>::quiet_NaN() : std::atan2(sine_, cosine_);
}

}  // namespace tactiled::sim
