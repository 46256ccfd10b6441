// The parts of model "generic" that its methods share. See matrix.cpp.
#pragma once
#include <memory>
#include <string>
#include <string_view>

#include "decoupling/method.hpp"
#include "decoupling/solve/checked.hpp"

namespace tactiled {

// One of the corrections that model "generic" adds to its matrix: g(u) with u = r / width, in N and Nm.
class Correction {
public:
    virtual ~Correction() = default;
    // `out` has a number a component of the calibration. rt: wait-free, no allocation
    virtual void add(const double* u, double* out) noexcept = 0;
};

// The standard deviation of each channel over the calibration's rows, one number for each channel: every correction needs
// it.
inline constexpr KnownTable kWidth{"width", 1, kPerChannel};

// The fit writes down by how much old rows counted less; the loop does not use it.
inline constexpr Parameter kForget{"forget", "weight of a row over that of the next one", 0.5, 1, 1};
// Likewise.
inline constexpr Parameter kSeed{"seed", "of the random starts of the fit; reported, not used", 0, 4503599627370496, 1};

// The decoupler of `method`: the matrix of the calibration and, where it is not nullptr, a correction. nullptr where the
// calibration does not serve, and `fault` says why; a fault that is there already stays. setup
std::unique_ptr<Decoupler> make_generic(const CalibrationData& data, std::string_view method,
                                        std::unique_ptr<Correction> correction, std::string& fault);

// The correction of method "quadratic" from the table of that name, which "rbf" may add to as well. nullptr on a fault,
// and `fault` says why. setup
std::unique_ptr<Correction> make_quadratic(const CalibrationData& data, std::string& fault);

}  // namespace tactiled
