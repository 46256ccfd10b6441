// Window of a converter: a reading is the mean over the conversion time.
#include <cmath>
#include <vector>

#include "drivers/sim/effects/bounds.hpp"

namespace tactiled::sim {
namespace {

// An AD7746 at 10 Hz takes 0.1 s; the windows of the other converters are far shorter than a sample.
double window_s(const Setting& s) {
    if (!std::isnan(s.p[0])) return s.p[0];
    return s.sensor.model == Model::capacitive ? 0.1 : 0;
}

// Exact for readings that are linear between samples: whole samples by a running sum, the oldest part separately.
class ConverterWindow final : public Effect {
public:
    explicit ConverterWindow(const Setting& s) : channels_(s.sensor.n()), length_(window_s(s) * s.rate_Hz) {
        whole_ = std::size_t(length_);
        part_ = length_ - double(whole_);
        for (std::size_t k = 0; k < channels_; ++k)
            if (!is_piezo(s.sensor, k)) past_[k].resize(whole_ + 2);
    }

    void apply(Block& block) noexcept override {
        if (length_ <= 0 || block.n == 0) return;
        std::size_t at = at_;
        for (std::size_t k = 0; k < channels_; ++k) {
            std::vector<double>& past = past_[k];
            if (past.empty()) continue;
            at = at_;
            if (!started_) {
                for (double& x : past) x = block.channel[k][0];
                sum_[k] = block.channel[k][0] * double(whole_ + 1);
            }
            for (std::size_t n = 0; n < block.n; ++n) {
                // past[at] = the oldest, whole + 2 samples before this one; the sum contains the whole + 1 samples
                // after it.
                const double now = block.channel[k][n];
                past[at] = now;
                at = at + 1 == past.size() ? 0 : at + 1;
                const double oldest = past[at], next = past[at + 1 == past.size() ? 0 : at + 1];
                fresh_[k] += now;
                sum_[k] += now - oldest;
                if (at == 0) {  // discards the rounding errors of one pass
                    sum_[k] = fresh_[k] - past[0];
                    fresh_[k] = 0;
                }
                // sum_: the newest whole + 1 samples; trapezia between them, then a part towards the oldest.
                const double trapezia = sum_[k] - (now + next) / 2;
                const double piece = part_ * (next + part_ / 2 * (oldest - next));
                block.channel[k][n] = (trapezia + piece) / length_;
            }
        }
        at_ = at;
        started_ = true;
    }

private:
    std::size_t channels_;
    double length_, part_ = 0;
    std::size_t whole_ = 0, at_ = 0;
    std::array<std::vector<double>, kMaxSensorChannels> past_;
    Channels sum_{}, fresh_{};
    bool started_ = false;
};

// Weights of the samples over the window W = m + f: 1/2, 1, ..., 1/2 + f - f^2/2, f^2/2.
Bound bound(const Setting& s) {
    const double length = window_s(s) * s.rate_Hz, whole = std::floor(length), part = length - whole;
    if (length <= 0) return {};
    const auto older = [&](double age_s) {
        const double j = std::floor(age_s * s.rate_Hz + 1e-9);
        return j > whole ? 0 : (j < whole ? length - j - 0.5 : part * part / 2) / length;
    };
    return {.change_N = lag_N(s, (whole + 1.01) / s.rate_Hz, older)};
}

const EffectEntry entry{
    .name = "converter_window",
    .title = "averaging by the converter",
    .equation = "r(t) = mean of r over t - T_c .. t",
    .source = "boxcar, sinc(f T_c); AD7746 at 10 Hz",
    .stage = Stage::converter,
    .instructions = 230,
    .parameters = {{"window_s", "by default 0.1 s of capacitances, else 0", kByModel, 0, 2}},
    .bound = bound,
    .make = [](const Setting& s) -> std::unique_ptr<Effect> { return std::make_unique<ConverterWindow>(s); },
    .delay_s = [](const Setting& s, std::size_t k) { return is_piezo(s.sensor, k) ? 0 : window_s(s) / 2; }};

}  // namespace
}  // namespace tactiled::sim
