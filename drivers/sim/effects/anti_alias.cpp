// Low pass before the converter, against frequencies that would fold.
#include <cmath>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

double corner_Hz(const Setting& s) { return std::isnan(s.p[0]) ? s.rate_Hz / 4 : s.p[0]; }
double keep(const Setting& s) { return std::exp(-6.283185307179586 * corner_Hz(s) / s.rate_Hz); }

// Two poles at one place: it never overshoots.
class AntiAlias final : public Effect {
public:
    explicit AntiAlias(const Setting& s) : channels_(s.sensor.n()), keep_(keep(s)) {}
    void apply(Block& block) noexcept override {
        if (block.n == 0) return;
        for (std::size_t k = 0; k < channels_; ++k) {
            if (!started_) first_[k] = second_[k] = block.channel[k][0];
            for (std::size_t n = 0; n < block.n; ++n) {
                first_[k] += (1 - keep_) * (block.channel[k][n] - first_[k]);
                second_[k] += (1 - keep_) * (first_[k] - second_[k]);
                block.channel[k][n] = second_[k];
            }
        }
        started_ = true;
    }

private:
    std::size_t channels_;
    double keep_;
    Channels first_{}, second_{};
    bool started_ = false;
};

// A sample that is j samples old has the weight (1 - a)^2 (j + 1) a^j; all older ones together have a^(j+1) (1 + (j + 1) (1
// - a)).
Bound bound(const Setting& s) {
    const double a = keep(s);
    const auto older = [&](double age_s) {
        const double j = std::floor(age_s * s.rate_Hz + 1e-9) + 1;
        return std::pow(a, j) * (1 + j * (1 - a));
    };
    const double time_s = 1 / (6.283185307179586 * corner_Hz(s));
    return {.change_N = lag_N(s, 16 * time_s + 4 / s.rate_Hz, older)};
}

}  // namespace

extern const EffectEntry anti_alias;
const EffectEntry anti_alias{
    .name = "anti_alias",
    .title = "low pass before the converter",
    .equation = "H = 1 / (1 + s / w_c)^2",
    .source = "derived: second order, critically damped",
    .stage = Stage::converter,
    .cost_class = "c1",
    .instructions = 150,
    .models = kAll,
    .parameters = {{"corner_Hz", "of each of two poles; by default a quarter of the rate", kByModel, 1e-3, 1e7}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<AntiAlias>(s); }};

}  // namespace tactiled::sim
