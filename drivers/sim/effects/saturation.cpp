// Saturation: a reading is limited to the range of its converter.
#include <algorithm>
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

class Saturation final : public Effect {
public:
    explicit Saturation(const Setting& s) : channels_(s.sensor.n()) {
        for (std::size_t k = 0; k < channels_; ++k) {
            const double limit = s.p[0] * half_range(s.sensor, k);
            min_[k] = s.sensor.zero[k] - limit;
            max_[k] = s.sensor.zero[k] + limit;
        }
    }
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < channels_; ++k)
            for (std::size_t n = 0; n < block.n; ++n)
                block.channel[k][n] = std::clamp(block.channel[k][n], min_[k], max_[k]);
    }

private:
    std::size_t channels_;
    Channels min_{}, max_{};
};

// The part beyond a limit; 0 where the load cannot reach it.
Bound bound(const Setting& s) {
    Channels change = largest_swing(s);
    for (std::size_t k = 0; k < s.sensor.n(); ++k) change[k] = std::max(change[k] - s.p[0] * half_range(s.sensor, k), 0.0);
    return {.change_N = s.sensor.largest_N(change)};
}

const EffectEntry entry{.name = "saturation",
                        .title = "saturation limits of the converter",
                        .equation = "r = min(max(r, zero - rail), zero + rail)",
                        .source = "full scales: 10 N of the capacitive sensor, 2 kPa of the hairs, 1 N of the table",
                        .stage = Stage::converter,
                        .cost_class = "c1",
                        .instructions = 150,
                        .models = kAll,
                        .parameters = {{"rail", "of the reading with each force at full scale", 1.25, 0.01, 1e3}},
                        .bound = bound,
                        .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<Saturation>(s); },
                        .instant = true};

}  // namespace
}  // namespace tactiled::sim
