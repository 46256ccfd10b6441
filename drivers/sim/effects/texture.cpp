// Texture: the ridges of a sliding body modulate the press.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"
#include "drivers/sim/effects/skin.hpp"

namespace tactiled::sim {
namespace {

// Press of half a ridge's height, averaged over the contact of a ridge with the width 2 a: sin(x) / x, x = 2 pi a /
// pitch.
double amplitude_N(const Setting& s) {
    const double x = 6.283185307179586 * s.p[0] / std::max(s.body.texture_pitch_m, 1e-9);
    const double kept = x < 1e-6 ? 1 : std::abs(std::sin(x) / x);
    return s.p[1] * skin(s.sensor).press_N_m * std::max(s.body.texture_height_m, 0.0) / 2 * kept * s.sensor.share;
}

// press + min(A, press) sin(2 pi slide / pitch), at the centre of contact; the shear follows with kinetic friction.
std::unique_ptr<Effect> make(const Setting& s) {
    return each_sample([amplitude_N = amplitude_N(s), kinetic = s.body.kinetic_friction,
                        ridges_m = 1 / std::max(s.body.texture_pitch_m, 1e-9)](Block& block, std::size_t n) {
        auto& [fx, fy, fz, mx, my] = block.load;
        const double press = -fz[n], ridge = block.slide_m[n] * ridges_m;
        if (block.speed_m_s[n] <= 0 || press <= 0) return;
        const double wave = std::sin(6.283185307179586 * (ridge - std::floor(ridge)));
        const double more = std::min(amplitude_N, press);
        const double shear = std::sqrt(fx[n] * fx[n] + fy[n] * fy[n]);
        fz[n] -= more * wave;
        mx[n] -= block.y_m[n] * more * wave;
        my[n] += block.x_m[n] * more * wave;
        if (shear <= 0) return;
        const double scale = std::min(kinetic * more, shear) / shear * wave;
        fx[n] += fx[n] * scale;
        fy[n] += fy[n] * scale;
    });
}

// An error of the input changes min(A, press) and min(mu A, shear) by at most the same amount.
Bound bound(const Setting& s) {
    const double amplitude = std::min(amplitude_N(s), s.extent.max[kFz]);
    if (amplitude <= 0 || s.extent.speed_m_s <= 0) return {};
    const double shear = s.body.kinetic_friction * amplitude;
    Load change{std::min(shear, s.extent.max[kFx]), std::min(shear, s.extent.max[kFy]), amplitude, s.extent.y_m * amplitude,
                s.extent.x_m * amplitude};
    const Load error = observed(s.sensor);
    const double shear_error = 2 * std::hypot(error[kFx], error[kFy]) + s.body.kinetic_friction * error[kFz];
    const Load more{shear_error, shear_error, error[kFz], s.extent.y_m * error[kFz], s.extent.x_m * error[kFz]};
    const double change_N = s.sensor.channel_N(change);
    return {.change_N = change_N, .gain = 1 + s.sensor.channel_N(more), .own_N = change_N, .load = change};
}

const EffectEntry entry{
    .name = "texture",
    .title = "ridges of a sliding body",
    .equation = "N = N + min(k h/2 |sinc(2 a / pitch)|, N) sin(2 pi slide / pitch), T likewise with mu_k",
    .source = "derived: f = v / pitch, a contact 2 a wide averages",
    .stage = Stage::contact,
    .instructions = 170,
    .parameters = {{"contact_m", "half width of the contact of a ridge", 2e-4, 0, 1},
                   {"stiffness", "against a press, in that of the skin alone", 0.5, 0, 1e3}},
    .bound = bound,
    .make = make,
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
