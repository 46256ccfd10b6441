#include "drivers/sim/linear.hpp"

namespace tactiled::sim {
namespace {

class Clock final : public Effect {
public:
    explicit Clock(double rate_Hz) : rate_Hz_(rate_Hz) {}
    void apply(Block& block) noexcept override {
        for (std::size_t n = 0; n < block.n; ++n) {
            block.t_s[n] = double(block.first + n) / rate_Hz_;
            block.missing[n] = 0;
            block.lost[n] = 0;
            block.dropped[n] = false;
            block.arrives[n] = {1, 0};
        }
    }

private:
    double rate_Hz_;
};

class World final : public Effect {
public:
    World(const Motion& motion, const Sensor& sensor) : motion_(motion), sensor_(sensor) {}
    void apply(Block& block) noexcept override { motion_.fill(block, sensor_); }

private:
    const Motion& motion_;
    const Sensor& sensor_;
};

class Drive final : public Effect {
public:
    void apply(Block& block) noexcept override { block.drive = block.load; }
};

class Gauges final : public Effect {
public:
    explicit Gauges(const Sensor& sensor) : sensor_(sensor) {}
    void apply(Block& block) noexcept override {
        for (std::size_t k = 0; k < sensor_.n(); ++k) {
            const auto& g = sensor_.gain[k];
            const double zero = sensor_.zero[k];
            for (std::size_t n = 0; n < block.n; ++n)
                block.channel[k][n] = zero + g[kFx] * block.drive[kFx][n] + g[kFy] * block.drive[kFy][n] +
                                      g[kFz] * block.drive[kFz][n] + g[kMx] * block.drive[kMx][n] +
                                      g[kMy] * block.drive[kMy][n];
        }
    }

private:
    const Sensor& sensor_;
};

}  // namespace

std::unique_ptr<Effect> make_clock(double rate_Hz) { return std::make_unique<Clock>(rate_Hz); }
std::unique_ptr<Effect> make_world(const Motion& motion, const Sensor& sensor) {
    return std::make_unique<World>(motion, sensor);
}
std::unique_ptr<Effect> make_drive() { return std::make_unique<Drive>(); }
std::unique_ptr<Effect> make_gauges(const Sensor& sensor) { return std::make_unique<Gauges>(sensor); }

}  // namespace tactiled::sim
