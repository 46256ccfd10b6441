// Hertz contact: the contact of a round body grows with the press.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"
#include "drivers/sim/effects/skin.hpp"

namespace tactiled::sim {
namespace {

std::unique_ptr<Effect> make(const Setting& s) {
    const bool round = s.body.shape == Body::Shape::sphere && s.body.radius_m > 0 && s.sensor.half_width_m == 0;
    return each_sample([round, radius_m = s.body.radius_m, modulus_Pa = contact_modulus_Pa(skin(s.sensor), s.body)](
                           Block& block, std::size_t n) {
        if (round) block.radius_m[n] = hertz_radius_m(-block.load[kFz][n], radius_m, modulus_Pa);
    });
}

// Only a table's influence map uses the radius; on an array the motion has it already (motion.hpp, footprint_m). Two
// means over parts of the map are between its minimum and its maximum.
Bound bound(const Setting& s) {
    if (s.sensor.table.influence.empty() || s.sensor.half_width_m > 0 || s.body.shape != Body::Shape::sphere ||
        s.body.radius_m <= 0)
        return {};
    const double press = s.extent.max[kFz];
    const double modulus_Pa = contact_modulus_Pa(skin(s.sensor), s.body);
    const double reach = std::hypot(s.extent.x_m, s.extent.y_m) +
                         std::max(s.body.radius_m, hertz_radius_m(press, s.body.radius_m, modulus_Pa));
    const double factor[3] = {s.sensor.table.gauge_factor_tangential, s.sensor.table.gauge_factor_tangential,
                              s.sensor.table.gauge_factor_normal};
    Channels change{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k)
        for (std::size_t axis = kFx; axis <= kFz; ++axis) {
            double min = 0, max = 0;  // 0 beyond the plate
            for (const auto& row : s.sensor.table.influence) {
                if (std::hypot(row[0], row[1]) > reach) continue;
                min = std::min(min, row[2 + 3 * k + axis]);
                max = std::max(max, row[2 + 3 * k + axis]);
            }
            change[k] += std::abs(factor[axis]) * (max - min) * s.extent.max[axis];
        }
    const double change_N = s.sensor.largest_N(change);
    // an error of the press changes the radius, and the results of two radii differ by at most this
    return {.change_N = change_N, .jump_N = change_N};
}

const EffectEntry entry{.name = "hertz_contact",
                        .title = "contact of a round body",
                        .equation = "a^3 = 3 F R / (4 E*)",
                        .source = "Hertz 1882",
                        .stage = Stage::contact,
                        .instructions = 150,
                        .models = kTable,
                        .bound = bound,
                        .make = make,
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
