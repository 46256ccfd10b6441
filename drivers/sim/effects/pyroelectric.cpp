// Pyroelectric charge: a piezo film responds to a change of its temperature as to a force.
#include <cmath>

#include "drivers/sim/effects/reach.hpp"
#include "drivers/sim/effects/warmth.hpp"

namespace tactiled::sim {
namespace {

// Apparent force per 1 K: 27 uC/(m^2 K) times the area, over 25 pC/N.
double per_K(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    const double radius_m = s.sensor.capacitive.disc_radius_m;
    return 27e-6 * std::numbers::pi * radius_m * radius_m / 25e-12;
}

// The film's temperature follows room and body through the pad; its charge discharges: v' = per_K T' - v / tau.
std::unique_ptr<Effect> make(const Setting& s) {
    const std::size_t film = s.sensor.find("Vp");
    const double h = 1 / (s.rate_Hz * s.p[2]);
    return each_film_reading(
        s, [V_per_K = per_K(s) * s.sensor.per_N[film], share = s.p[1],
            approach = -std::expm1(-1 / (s.rate_Hz * diffusion_s(s.sensor))), scale_N = touch_scale_N(s.sensor),
            keep = std::exp(-h), fresh = -std::expm1(-h) / h, film_K = 0.0,
            value = 0.0](double v, std::size_t, const Block& block, std::size_t n) mutable {
            const double outside_K =
                block.ambient_K[n] + share * touch(-block.load[kFz][n], scale_N) * (block.body_K[n] - block.ambient_K[n]);
            const double rise_K = approach * (outside_K - film_K);
            film_K += rise_K;
            value = keep * value + fresh * V_per_K * rise_K;
            return v + value;
        });
}

// A voltage whose charge comes at a rate stays at or below rate * tau (1 - exp(-length / tau)). The film warms no
// faster than the room, and than (outside - film) / diffusion time; contact adds at most +- share * body.
Bound bound(const Setting& s) {
    if (s.sensor.find("Vp") >= s.sensor.n()) return {};
    const double through_s = diffusion_s(s.sensor), leak_s = s.p[2], length_s = (double(s.samples) + 1) / s.rate_Hz;
    const double kept_s = leak_s * -std::expm1(-length_s / leak_s), N_per_K = per_K(s);
    // For a film that follows an outside temperature within +- max_K for the scene's length.
    const auto N_of = [&](double max_K, double rate_K_s) {
        const double reached_K = max_K * -std::expm1(-length_s / through_s);
        return N_per_K * std::min(2 * reached_K, std::min((max_K + reached_K) / through_s, rate_K_s) * kept_s);
    };
    const double any = std::numeric_limits<double>::infinity();
    const double body_K = s.p[1] * s.extent.body_K, scale_N = touch_scale_N(s.sensor);
    const double change_N = N_of(s.extent.ambient_K, any) + N_of(body_K * touch(max(s, kFz), scale_N), any);
    return {.change_N = change_N, .gain = 1 + N_of(body_K / scale_N * load_of_error(s.sensor, kFz), any), .own_N = change_N};
}

const EffectEntry entry{
    .name = "pyroelectric",
    .title = "pyroelectric charge",
    .equation = "i = p A dT/dt, v' = i / C - v / tau",
    .source = "PVDF: 27 uC/(m^2 K) against 25 pC/N, so 0.1 K on 1 cm^2 reads 10.8 N",
    .stage = Stage::transducer,
    .instructions = 40,
    .models = kCapacitive,
    .parameters = {{"N_per_K", "what 1 K looks like; by default PVDF of the disc's area", kByModel, 0, 1e5},
                   {"share", "of the body's temperature that reaches the surface in full contact", 0.5, 0, 1},
                   {"leak_s", "tau of the film", 0.1, 1e-5, 1e6}},
    .bound = bound,
    .make = make};

}  // namespace
}  // namespace tactiled::sim
