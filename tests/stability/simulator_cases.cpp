// The simulator's own formulas: what it makes readings of must be no worse than what reads them.
#include <cmath>

#include "tests/stability/hard_case.hpp"
#include "tests/unit/sim/effects_at_work.hpp"

namespace tactiled::stability {
namespace {

using namespace sim;

// Strain of a neo-Hookean pad under the load q, > 0 in compression: x^3 - 3 q x - 1 = 0, (x - 1) / x; by its inverse series'
// one root near 1, in 100 digits.
Real exact_strain(const Real& q) {
    Real x = q > 0 ? Real(1 + q) : Real(1);
    for (int i = 0; i < 200; ++i) x -= (x * x * x - 3 * q * x - 1) / (3 * (x * x - q));
    return (x - 1) / x;
}

void add_material(Cases& cases) {
    // A load of 1e-12 of the pad's stiffness, and one that would press it to a fiftieth.
    AtWork pad("capacitive", {"large_deflection"});
    const double per_N = pad.sensor().capacitive.strain_per_N;
    const struct {
        const char *id, *what;
        double q;
    } loads[] = {{"M1", "a soft pad under 1e-12 of its stiffness", 1e-12},
                 {"M2", "a soft pad under 40 times its stiffness", 40},
                 {"M3", "a soft pad torn by 0.3 of its stiffness", -0.3}};
    for (const auto& load : loads) {
        const double N = load.q / per_N;
        const Real strain = exact_strain(Real(per_N) * Real(N));
        double x = std::max(1 + load.q, 0.0);
        for (int i = 0; i < 3; ++i) x -= (x * (x * x - 3 * load.q) - 1) / (3 * (x * x - load.q));
        cases.value(load.id, load.what, {-(x - 1) / x / per_N, pad(press(N)).drive[kFz], -strain / Real(per_N), 1, 16});
    }
}

void add_electronics(Cases& cases) {
    AtWork table("table", {"bridge_nonlinearity"});
    const double N = -0.028 / table.sensor().gain[0][kFz];
    const double x = -table.sensor().gain[0][kFz] * N;
    cases.value("H25", "a quarter bridge at dR/R = 0.028", {0.028, table(press(N)).channel[0], Real(x) / (1 + Real(x) / 2)});
}

}  // namespace

void add_simulator_cases(Cases& cases) {
    add_material(cases);
    add_electronics(cases);
}

}  // namespace tactiled::stability
