// The common parts of the methods of model "generic". See matrix.cpp.
#pragma once
#include <memory>
#include <string>
#include <string_view>

#include "decoupling/method.hpp"
#include "decoupling/solve/checked.hpp"

namespace tactiled {

// A correction that model "generic" adds to its matrix: g(u) with u = r / width, in N and Nm.
class Correction {
public:
    virtual ~Correction() = default;
    // Adds the correction to `out`, which has one number for each component of the calibration. rt: wait-free, no
    // allocation
    virtual void add(const double* u, double* out) noexcept = 0;
};

// The standard deviation of each channel over the calibration's rows, one number for each channel: every correction needs
// it.
inline constexpr KnownTable kWidth{"width", 1, kPerChannel};

// Recorded by the fit: the factor by which the weight of old rows decreases. The loop does not use it.
inline constexpr Parameter kForget{"forget", "weight of a row over that of the next one", 0.5, 1, 1};
// Recorded by the fit and not used by the loop.
inline constexpr Parameter kSeed{"seed", "of the random starts of the fit; reported, not used", 0, 4503599627370496, 1};

// Returns the decoupler of `method`: the matrix of the calibration and, if it is not nullptr, a correction. Returns
// nullptr with `fault` set if the calibration is not suitable; an existing fault is kept. setup
std::unique_ptr<Decoupler> make_generic(const CalibrationData& data, std::string_view method,
                                        std::unique_ptr<Correction> correction, std::string& fault);

// Returns the correction of method "quadratic" from the table of that name, which "rbf" may use as well; nullptr with
// `fault` set on a fault. setup
std::unique_ptr<Correction> make_quadratic(const CalibrationData& data, std::string& fault);

}  // namespace tactiled
