// Overlap of a shifted round electrode with a fixed electrode that is a sector of an annulus. Exact.
#pragma once

namespace tactiled {

// inner <= rho <= outer, centre - half_opening <= theta <= centre + half_opening; any unit of length, radians.
// inner = 0 and half_opening = pi is a disc. half_opening <= pi.
struct Sector {
    double inner = 0, outer = 1, centre = 0, half_opening = 1;
    double cos_from = 1, sin_from = 0, cos_to = 1, sin_to = 0;  // directions of its two sides

    Sector() = default;
    Sector(double inner_radius, double outer_radius, double centre_rad, double half_opening_rad) noexcept;
};

struct Overlap {
    // area minus the area without shift, unit of length squared; exact to rounding for the smallest shift
    double change;
    double d_dx, d_dy;  // derivatives of the area by the shift, unit of length
};

// Returns the area that the sector shares with a disc of that radius around the origin.
double area_at_rest(const Sector& sector, double disc_radius) noexcept;

// Returns the overlap with the disc's centre at (dx, dy), hypot(dx, dy) < disc_radius.
// rt: wait-free
Overlap overlap(const Sector& sector, double disc_radius, double dx, double dy) noexcept;

}  // namespace tactiled
