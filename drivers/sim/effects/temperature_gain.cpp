// Gain by temperature: a warm skin is softer or stiffer, and a warm gauge responds less or more.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

double per_K(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    return s.sensor.model == Model::table ? 5e-4 : -2e-3;  // polyimide gets softer, rubber stiffer
}

std::unique_ptr<Effect> make(const Setting& s) {
    return each_reading(
        s, [per_K = per_K(s), zero = s.sensor.zero](double r, std::size_t k, const Block& block, std::size_t n) {
            return r + per_K * block.ambient_K[n] * (r - zero[k]);
        });
}

Bound bound(const Setting& s) {
    const double part = std::abs(per_K(s)) * s.extent.ambient_K;
    Channels change = largest_swing(s);
    for (double& c : change) c *= part;
    return bound_of_own(s, change, 1 + part);
}

const EffectEntry entry{.name = "temperature_gain",
                        .title = "gain by temperature",
                        .equation = "r = zero + (1 + beta dT) (r - zero)",
                        .source = "handbook values; rubber's modulus goes with the absolute temperature",
                        .stage = Stage::transducer,
                        .instructions = 100,
                        .models = kAll | kTaxel,
                        .parameters = {{"per_K", "relative; by default by the sensor's model", kByModel, -0.05, 0.05}},
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
