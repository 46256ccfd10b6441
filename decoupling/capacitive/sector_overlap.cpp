// Derived for this project; the thesis' eq. XXVI treats the shifted disc as concentric, with an error of 9 % at first order
// (decoupling/capacitive/README.md, "Errata"). Seen from the origin, the edge of the disc of radius R shifted by d is at
//
//     rho(t) = c + S,    c = d cos t,  u = d sin t,  S = sqrt((R - u)(R + u)),    t measured from the shift's direction.
//
// If the edge lies between inner and outer from t1 to t2, the area changes relative to no shift by
//
//     dA = 1/2 [u2 rho2 - u1 rho1 + R^2 (asin(u2/R) - asin(u1/R))]
//
// Each term is proportional to d, so a shift of 1 pm is as exact as one of 1 mm; the difference of two areas would lose 10
// digits. The derivative by the shift is the chord of the edge, rotated by -90 degrees.
#include "decoupling/capacitive/sector_overlap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace tactiled {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The edge at one angle: the angle's cosine and sine in a fixed frame, and the components of the shift (dx, dy)
// relative to that direction.
struct EdgePoint {
    double x, y;  // the edge's cosine and sine
    // the symbols above, without the angle of the shift: d sin(theta - phi) = sin theta dx - cos theta dy
    double u, S, rho;

    EdgePoint(double cosine, double sine, double R, double dx, double dy) noexcept {
        u = sine * dx - cosine * dy;
        S = std::sqrt(std::max(0.0, (R - u) * (R + u)));
        rho = cosine * dx + sine * dy + S;
        x = rho * cosine;
        y = rho * sine;
    }
};

// Overlap of the part from `from` to `to` where the edge is clipped neither by inner nor by outer.
Overlap free_edge(const EdgePoint& from, const EdgePoint& to, double R) noexcept {
    const double turned = std::atan2(to.u * from.S - from.u * to.S, from.S * to.S + from.u * to.u);
    return {
        .change = 0.5 * (to.u * to.rho - from.u * from.rho + R * R * turned), .d_dx = to.y - from.y, .d_dy = from.x - to.x};
}

// Returns the angle from the shift's direction up to which the edge is beyond radius `a`: 0 .. pi. Half angles are
// used, because the cosine (a^2 + d^2 - R^2) / 2ad loses all digits if a is near R and d is small.
double clip_angle(double a, double R, double d) noexcept {
    const double beyond = (R - a + d) * (R + a - d), within = (a + d - R) * (a + d + R);
    if (!(beyond > 0)) return 0;
    if (!(within > 0)) return kPi;
    return 2 * std::atan2(std::sqrt(beyond), std::sqrt(within));
}

}  // namespace

Sector::Sector(double inner_radius, double outer_radius, double centre_rad, double half_opening_rad) noexcept
    : inner(inner_radius),
      outer(outer_radius),
      centre(centre_rad),
      half_opening(half_opening_rad),
      cos_from(std::cos(centre - half_opening)),
      sin_from(std::sin(centre - half_opening)),
      cos_to(std::cos(centre + half_opening)),
      sin_to(std::sin(centre + half_opening)) {}

double area_at_rest(const Sector& sector, double disc_radius) noexcept {
    const double edge = std::clamp(disc_radius, sector.inner, sector.outer);
    return (edge - sector.inner) * (edge + sector.inner) * sector.half_opening;
}

Overlap overlap(const Sector& sector, double R, double dx, double dy) noexcept {
    const double d = std::hypot(dx, dy);
    if (R - d >= sector.outer) return {};  // covered as before
    const double from = sector.centre - sector.half_opening, to = sector.centre + sector.half_opening;
    if (R - d >= sector.inner && R + d <= sector.outer && sector.half_opening < kPi / 2)
        return free_edge({sector.cos_from, sector.sin_from, R, dx, dy}, {sector.cos_to, sector.sin_to, R, dx, dy}, R);

    // Cut where the edge crosses inner or outer; two revolutions cover every sector.
    const double towards = d > 0 ? std::atan2(dy, dx) : 0.0;
    const double full = clip_angle(sector.outer, R, d), some = clip_angle(sector.inner, R, d);
    std::array<double, 24> cut;
    std::size_t n = 0;
    cut[n++] = from;
    cut[n++] = to;
    for (int turn = -2; turn <= 2; ++turn)
        for (const double angle : {-some, -full, full, some}) {
            const double at = towards + angle + 2 * kPi * turn;
            if (from < at && at < to && n < cut.size()) cut[n++] = at;
        }
    std::sort(cut.begin(), cut.begin() + std::ptrdiff_t(n));

    const double rest = std::clamp(R, sector.inner, sector.outer);
    Overlap sum{};
    const auto constant = [&](double edge, double width) { sum.change += 0.5 * (edge - rest) * (edge + rest) * width; };
    for (std::size_t i = 0; i + 1 < n; ++i) {
        const double width = cut[i + 1] - cut[i];
        const double middle = std::abs(std::remainder(cut[i] + 0.5 * width - towards, 2 * kPi));
        if (middle < full) {
            constant(sector.outer, width);
        } else if (middle > some) {
            constant(sector.inner, width);
        } else {
            // At most half a revolution at once, because of the atan2 of free_edge().
            const double half = cut[i] + 0.5 * width;
            const EdgePoint a{std::cos(cut[i]), std::sin(cut[i]), R, dx, dy}, b{std::cos(half), std::sin(half), R, dx, dy},
                c{std::cos(cut[i + 1]), std::sin(cut[i + 1]), R, dx, dy};
            for (const Overlap& part : {free_edge(a, b, R), free_edge(b, c, R)}) {
                sum.change += part.change;
                sum.d_dx += part.d_dx;
                sum.d_dy += part.d_dy;
            }
            constant(R, width);
        }
    }
    return sum;
}

}  // namespace tactiled
