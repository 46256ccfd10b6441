// The parts of model "generic" that its files share. See generic.cpp.
#pragma once
#include <memory>
#include <string>

#include "decoupling/solve/checked.hpp"

namespace tactiled {

// One of the corrections that model "generic" adds to its matrix: g(u) with u = r / width, in N and Nm.
class Correction {
public:
    virtual ~Correction() = default;
    // `out` has a number a component of the calibration. rt: wait-free, no allocation
    virtual void add(const double* u, double* out) noexcept = 0;
};

// What a correction is made of, from `calibration.tables`; sizes are checked: on a fault nullptr, and `fault` says why.
// setup
std::unique_ptr<Correction> make_quadratic(const Calibration& calibration, std::string& fault);
std::unique_ptr<Correction> make_rbf(const Calibration& calibration, std::string& fault);
std::unique_ptr<Correction> make_mlp(const Calibration& calibration, std::string& fault);

// The table of that name; where it is missing or not `rows` x `columns` (0 = any number), `fault` says so. setup
const std::vector<std::vector<double>>* table_of(const Calibration& calibration, const std::string& name, std::size_t rows,
                                                 std::size_t columns, std::string& fault);

}  // namespace tactiled
