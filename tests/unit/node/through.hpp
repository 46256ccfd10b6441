// Models with a known force: channels, unchanged. The reasons of real models are tested with them.
#pragma once
#include <limits>

#include "decoupling/decoupler.hpp"

namespace tactiled {

class Through final : public Decoupler {
public:
    static constexpr double kSd_N = 0.01;
    // If the second channel is above `unsure_above` the uncertainty is unknown, as for a method whose past is not
    // known yet. With an sd of NaN jumps are not checked.
    explicit Through(double unsure_above = std::numeric_limits<double>::infinity(), double sd_N = kSd_N)
        : unsure_above_(unsure_above), sd_N_(sd_N) {}

    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        if (r.missing != 0) {
            e.reasons = TACTILED_MISSING_CHANNEL;
            return e;
        }
        for (std::size_t i = 0; i < 3; ++i) e.wrench_S[i] = r.channel[i], e.sd[i] = sd_N_;
        if (r.saturated != 0) e.reasons |= TACTILED_SATURATED;
        if (r.channel[1] > unsure_above_) e.reasons |= TACTILED_UNKNOWN_UNCERTAINTY;
        e.has_value = true;
        return e;
    }
    std::string_view method() const noexcept override { return "through"; }

private:
    double unsure_above_, sd_N_;
};

// The first channel as fx, without a standard deviation.
class FirstChannel final : public Decoupler {
public:
    Estimate decouple(const Reading& r) noexcept override {
        Estimate e;
        e.wrench_S = {r.channel[0], 0, 0, kNaN, kNaN, kNaN};
        e.has_value = true;
        return e;
    }
    std::string_view method() const noexcept override { return "first channel"; }
};

}  // namespace tactiled
