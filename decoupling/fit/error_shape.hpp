// The standard deviation of one component as a function of the load, from errors on held-out rows.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

namespace tactiled {

// The variance of an error is a sum of these parts: a constant, and terms that grow with the square of the component's
// estimate, of the load, and of the distance of the load from its peak since the last rest.
enum Part : std::size_t { kConstant, kSlope, kLoad, kUnloading, kParts };
using Parts = std::array<double, kParts>;

struct Error {
    Parts square;  // 1, and the squares of component / full scale, of the load, and of its distance from the peak, 0 .. 1
    double size;
    double weight;  // 1 / number of rows of its load: their errors are alike
    std::size_t group;
};

// The errors of one component with the zero of the calibration, and after a tare.
struct Errors {
    std::vector<Error> plain, tared;
};

// Parts that the errors of a component may have.
struct Allowed {
    bool load, unloading;
};

// Returns the likeliest parts of normal errors, made so much larger that the mean square of the plain errors, that of the
// tared ones and, if `by_sessions`, that of each group is no more than the variance. Each group of errors is then a session.
Parts variance_of(const Errors& errors, bool by_sessions, const Allowed& allowed);

// Minimum number of errors for a scale.
inline constexpr std::size_t kMinErrors = 8;

}  // namespace tactiled
