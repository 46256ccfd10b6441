// The standard deviation of one component as a function of the load, from errors on held-out rows.
#pragma once
#include <cstddef>
#include <vector>

namespace tactiled {

struct Error {
    // squares of |estimate| / full scale, of the load, and of its peak since the last rest minus the load, 0 .. 1
    double share, load, below_peak;
    double size;
    std::size_t group;
};

// Slopes of an error that grows with its component, with the load, and with the distance from the greatest load since the
// last rest: its standard deviation is
// s sqrt(1 + (slope |estimate| / full scale)^2 + (load slope load)^2 + (unloading (peak - load))^2).
struct Shape {
    double slope = 0, load = 0, unloading = 0;
};

// The errors of one component with the zero of the calibration, and after a tare; those under load come first.
struct Errors {
    std::vector<Error> plain, tared;
    std::size_t loaded = 0;
};

// Returns the shape with the smallest valid standard deviations, in the geometric mean over the rows. `by_sessions`: each
// group of errors is a session, and the scale is valid for each. `components`: of the calibration.
Shape best_shape(const Errors& errors, bool by_sessions, std::size_t components, bool takes_unloading);

// Returns the smallest scale s of a shape that is valid for the errors.
double scale_of(const Errors& errors, const Shape& shape, bool by_sessions, std::size_t components);

// Minimum number of errors for a scale.
inline constexpr std::size_t kMinErrors = 8;

}  // namespace tactiled
