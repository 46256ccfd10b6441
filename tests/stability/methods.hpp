// Every method of every model, with a calibration made by hand (nothing is fitted, so it is the same on every machine) and
// a stretch of ordinary readings.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "decoupling/decoupler.hpp"

namespace tactiled::stability {

struct Method {
    std::string name;  // "table/linear"
    Calibration calibration;
    // A press with a shear that both change slowly, as under a finger; sound, inside of the domain.
    std::vector<std::vector<double>> ordinary;
    bool remembers = false;  // a sample hangs on those before it

    [[nodiscard]] std::string model() const { return calibration.model; }
};

std::vector<Method> all_methods();

// One of them; aborts where there is none.
Calibration calibration_of(const std::string& name);

// setup: throws SetupError where the calibration is refused
std::unique_ptr<Decoupler> made(const Calibration& calibration);

}  // namespace tactiled::stability
