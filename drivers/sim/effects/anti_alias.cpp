// Low pass before the converter, against aliasing.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

double corner_Hz(const Setting& s) { return std::isnan(s.p[0]) ? s.rate_Hz / 4 : s.p[0]; }

// A sine with fewer than 16 samples per period is not a straight line between them. The motion is then evaluated at
// intermediate instants, 32 per period, up to one block of them per sample.
std::size_t instants(const Setting& s) {
    const double per_sample = s.extent.frequency_Hz / s.rate_Hz;
    if (s.scene == nullptr || per_sample * 16 <= 1) return 1;
    return std::size_t(std::min(std::ceil(32 * per_sample), double(Block::kSize)));
}

// Two equal poles, y1' = w (u - y1), y2' = w (y1 - y2), exact for an input that is straight over each step h. The
// states are y1 - u and y2 - u, so that a constant input is unchanged to the last bit:
//     d1 = a d1 + (a - 1) / x * rise,  d2 = a (d2 + x d1) + (2 (a - 1) / x + a) * rise,  x = w h, a = exp(-x)
class TwoPoles {
public:
    explicit TwoPoles(double x) : a_(std::exp(-x)), ax_(x < 700 ? a_ * x : 0), k1_(std::expm1(-x) / x), k2_(2 * k1_ + a_) {}
    // Returns the output after the input has risen by `rise` over the step, minus the input at the end of the step.
    // rt: wait-free
    double step(double rise, double& d1, double& d2) const noexcept {
        d2 = a_ * d2 + ax_ * d1 + k2_ * rise;
        d1 = a_ * d1 + k1_ * rise;
        return d2;
    }

private:
    double a_, ax_, k1_, k2_;
};

// The input between two samples: the linear model's response to the motion there, and the linearly interpolated rest
// by the effects before.
class AntiAlias final : public Effect {
public:
    explicit AntiAlias(const Setting& s)
        : sensor_(s.sensor),
          instants_(instants(s)),
          poles_(6.283185307179586 * corner_Hz(s) / (s.rate_Hz * double(instants_))),
          motion_(instants_ > 1 ? &s.scene->motion : nullptr),
          between_(instants_ > 1 ? std::make_unique<Block>() : nullptr) {}

    void apply(Block& block) noexcept override {
        if (block.n == 0) return;
        if (!started_) start(block);
        if (motion_ != nullptr) {
            for (std::size_t n = 0; n < block.n; ++n) pass_between(block, n);
        } else {
            const std::size_t channels = sensor_.n();
            for (std::size_t n = 0; n < block.n; ++n)  // channels in the inner loop, because they are independent
                for (std::size_t k = 0; k < channels; ++k) {
                    double& value = block.channel[k][n];
                    const double rise = value - last_[k];
                    last_[k] = value;
                    value += poles_.step(rise, first_[k], second_[k]);
                }
        }
    }

private:
    void start(const Block& block) noexcept {
        for (std::size_t k = 0; k < sensor_.n(); ++k) last_[k] = block.channel[k][0];
        last_s_ = block.t_s[0];
        started_ = true;
        if (motion_ == nullptr) return;
        between_->n = 1;
        between_->t_s[0] = last_s_;
        motion_->fill(*between_, sensor_);
        for (std::size_t k = 0; k < sensor_.n(); ++k) world_[k] = linear(k, 0);
    }
    void pass_between(Block& block, std::size_t n) noexcept {
        const double from_s = last_s_, step_s = (block.t_s[n] - from_s) / double(instants_);
        between_->n = instants_;
        for (std::size_t i = 0; i < instants_; ++i) between_->t_s[i] = from_s + step_s * double(i + 1);
        last_s_ = between_->t_s[instants_ - 1] = block.t_s[n];
        motion_->fill(*between_, sensor_);
        for (std::size_t k = 0; k < sensor_.n(); ++k) {
            double& value = block.channel[k][n];
            const double was = world_[k], now = linear(k, instants_ - 1);
            const double rest = ((value - now) - (last_[k] - was)) / double(instants_);
            double before = was, late = 0;
            for (std::size_t i = 0; i < instants_; ++i) {
                const double here = linear(k, i);
                late = poles_.step(here - before + rest, first_[k], second_[k]);
                before = here;
            }
            world_[k] = now;
            last_[k] = value;
            value += late;
        }
    }
    [[nodiscard]] double linear(std::size_t k, std::size_t i) const noexcept {
        double sum = 0;
        for (std::size_t axis = 0; axis < kAxes; ++axis) sum += sensor_.gain[k][axis] * between_->load[axis][i];
        return sum;
    }

    const Sensor& sensor_;
    std::size_t instants_;
    TwoPoles poles_;
    const Motion* motion_;
    std::unique_ptr<Block> between_;
    Channels last_{}, world_{}, first_{}, second_{};
    double last_s_ = 0;
    bool started_ = false;
};

// The share (1 + w t) exp(-w t) of the impulse response w^2 t exp(-w t) is older than t. The input between two samples is
// between their values. With intermediate instants, both the motion and the interpolated rest may add the same difference
// again, and an error before this effect enters all three.
Bound bound(const Setting& s) {
    const double w = 6.283185307179586 * corner_Hz(s);
    const auto older = [&](double age_s) {
        const double x = w * std::floor(age_s * s.rate_Hz + 1e-9) / s.rate_Hz;
        return (1 + x) * std::exp(-x);
    };
    const double widened = instants(s) > 1 ? 3 : 1;
    return {.change_N = widened * lag_N(s, 16 / w + 4 / s.rate_Hz, older), .gain = widened};
}

const EffectEntry entry{
    .name = "anti_alias",
    .title = "low pass before the converter",
    .equation = "H = 1 / (1 + s / w_c)^2",
    .source = "derived: second order, critically damped; sampled by what follows it, so a line above half the rate folds",
    .stage = Stage::converter,
    .instructions = 150,
    .parameters = {{"corner_Hz", "of each of two poles; by default a quarter of the rate", kByModel, 1e-3, 1e7}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<AntiAlias>(s); },
    .delay_s = [](const Setting& s, std::size_t) { return 2 / (6.283185307179586 * corner_Hz(s)); }};

}  // namespace
}  // namespace tactiled::sim
