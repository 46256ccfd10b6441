// Contact patch: the table's gauges respond to the place and the area of the load on the plate.
#include <cmath>
#include <optional>

#include "drivers/sim/effects/influence.hpp"
#include "drivers/sim/effects/reach.hpp"

namespace tactiled::sim {
namespace {

bool concerns(const Setting& s) { return makes_patch(s.body) && has_map(s.sensor.table); }

// The strains of the influence map, averaged over the patch, replace those of a load on the whole plate. The moment
// of the patch's centre, which the linear model has added, is contained in the map.
class ContactPatch final : public Effect {
public:
    explicit ContactPatch(const Setting& s) : sensor_(s.sensor) {
        if (concerns(s)) map_.emplace(s.sensor.table);
    }
    void apply(Block& block) noexcept override {
        if (!map_) return;
        for (std::size_t n = 0; n < block.n; ++n) {
            if (block.x_m[n] != x_m_ || block.y_m[n] != y_m_ || block.radius_m[n] != radius_m_) {
                x_m_ = block.x_m[n];
                y_m_ = block.y_m[n];
                radius_m_ = block.radius_m[n];
                more_ = map_->excess(x_m_, y_m_, radius_m_);
                for (std::size_t k = 0; k < sensor_.n(); ++k)
                    more_[k][kFz] -= sensor_.gain[k][kMx] * y_m_ - sensor_.gain[k][kMy] * x_m_;
            }
            for (std::size_t k = 0; k < sensor_.n(); ++k)
                block.channel[k][n] += more_[k][kFx] * block.drive[kFx][n] + more_[k][kFy] * block.drive[kFy][n] +
                                       more_[k][kFz] * block.drive[kFz][n];
        }
    }

private:
    const Sensor& sensor_;
    std::optional<InfluenceMap> map_;
    double x_m_ = std::numeric_limits<double>::quiet_NaN(), y_m_ = 0, radius_m_ = 0;
    InfluenceMap::Matrix more_{};
};

// The largest excess of the map over all places and radii that are possible in the scene.
Bound bound(const Setting& s) {
    if (!concerns(s)) return {};
    auto more = InfluenceMap(s.sensor.table).largest_excess(s.extent.x_m, s.extent.y_m, s.body.radius_m);
    Channels change{}, of_error{};
    for (std::size_t k = 0; k < s.sensor.n(); ++k) {
        more[k][kFz] += std::abs(s.sensor.gain[k][kMx]) * s.extent.y_m + std::abs(s.sensor.gain[k][kMy]) * s.extent.x_m;
        for (const Axis axis : {kFx, kFy, kFz}) {
            change[k] += more[k][axis] * max(s, axis);
            of_error[k] += more[k][axis] * load_of_error(s.sensor, axis);
        }
    }
    const double change_N = s.sensor.largest_N(change);
    return {.change_N = change_N, .gain = 1 + s.sensor.largest_N(of_error), .own_N = change_N};  // an error of the input
                                                                                                 // moves the patch
}

const EffectEntry entry{
    .name = "contact_patch",
    .title = "place and size of the contact",
    .equation = "r = mean over the patch of the strain by a force at a point, times the force",
    .source = "own finite elements, 961 points of the plate",
    .stage = Stage::transducer,
    .instructions = 8000,
    .models = kTable,
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<ContactPatch>(s); },
    .instant = true};

}  // namespace
}  // namespace tactiled::sim
