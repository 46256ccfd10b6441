// Simulated slips and vibrating transport, and the estimator's results.
#pragma once
#include <cstdint>

namespace tactiled::bench {

struct SlipFigures {
    int n = 0, found = 0, in_10_ms = 0, early = 0;  // early: gross slip was reported before it began
    // incipient slip was reported before; while the object hung at two thirds of the limit
    int incipient_before = 0, incipient_at_rest = 0;
    double p50_ms = 0, p99_ms = 0, friction_error = 0;  // rms, relative, of the coefficient learnt
};

// `n` slips of one jaw: clamped, loaded, then pulled until it slips. The configured friction is wrong by up to
// `told_off` (relative; 1 = none is configured); kinetic over static friction is `kinetic`.
SlipFigures slips(std::uint64_t seed, int n, double told_off, double kinetic_from, double kinetic_to);

struct TransportFigures {
    double hours = 0;
    int gross = 0, incipient = 0;  // said, though nothing slipped: times that it began
};
// An object held with 1.5 times the least grip, shaken at 5 to 60 Hz with up to `g` of the weight. `told` as above.
TransportFigures transport(std::uint64_t seed, double hours, double g, bool reported);

}  // namespace tactiled::bench
