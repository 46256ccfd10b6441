// The pressure of a body on an array of taxels: the part of its force on each taxel, as an integral over the taxel's area.
//
//   flat              the same on all taxels
//   sphere, fingers   Hertz: p = 3 F / (2 pi a^2) (1 - r^2 / a^2)^(1/2), a^3 = 3 F R / (4 E*); two fingertips carry a half
//   each cylinder          Hertz: p = 2 F / (pi b L) (1 - v^2 / b^2)^(1/2), b^2 = 4 F R / (pi L E*), even along its length
//   edge              even: F / (2 r L)
//
// Johnson, Contact Mechanics, 1985, chapter 4. A shear is distributed as the press is.
#pragma once
#include <vector>

#include "drivers/sim/motion.hpp"
#include "drivers/sim/sensor.hpp"

namespace tactiled::sim {

class Pressure {
public:
    // setup
    Pressure(const Body& body, const Sensor& array);

    struct Contact {
        bool is_whole;   // no part of it is beside the array
        double area_m2;  // the whole contact has this area
    };
    // Sets part[i] to the part of a force on taxel i, for a press with its centre at (x, y) of the array's frame. The parts
    // of a whole contact add up to 1. rt: wait-free, linear in the number of taxels
    Contact spread(double press_N, double x_m, double y_m, std::vector<double>& part) const noexcept;

    // Upper limits, over all places, of the part of one taxel, and of its change per metre by which the contact moves.
    // setup
    [[nodiscard]] double max_part(double press_N) const;
    [[nodiscard]] double max_slope_1_m(double press_N) const;
    // Direction of a long contact, or of the line through two fingertips, in the array's frame; NaN for a round one. setup
    [[nodiscard]] double axis_rad() const;

private:
    struct Ends {
        std::size_t begin, end;
    };
    [[nodiscard]] double half_width_m(double press_N) const noexcept;
    [[nodiscard]] double peak_1_m2(double press_N) const;
    [[nodiscard]] Ends columns_in(double from_m, double to_m) const noexcept;
    [[nodiscard]] Ends rows_in(double from_m, double to_m) const noexcept;
    [[nodiscard]] double x_m(std::size_t column) const noexcept;
    [[nodiscard]] double y_m(std::size_t row) const noexcept;
    bool add_ball(double share, double a_m, double x_m, double y_m, std::vector<double>& part) const noexcept;
    bool add_strip(double b_m, double x_m, double y_m, std::vector<double>& part) const noexcept;

    Body body_;
    std::size_t rows_, columns_;
    double pitch_m_, modulus_Pa_;
    double cosine_, sine_;  // the body's line has this direction
};

}  // namespace tactiled::sim
