// The parts of a sample's standard deviation, from the standard deviations before and after each stage of the pipeline.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "decoupling/decoupler.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// Standard deviations of one sample: that of the model, with its zero, and as published.
struct SdStages {
    Wrench of_model = kUnseen, with_zero = kUnseen, published = kUnseen;
};

// Sets the parts, whose squares add up to those of `sd.published`; NaN where that is not known. The loops vectorise.
// rt: wait-free
inline void put_parts(const Estimate& estimate, const SdStages& sd, tactiled_budget& budget) noexcept {
    const auto square = [](double x) { return x * x; };
    double squared[TACTILED_PARTS][6];
    for (std::size_t c = 0; c < 6; ++c) {
        const double of_model = square(sd.of_model[c]), with_zero = square(sd.with_zero[c]);
        const double known = sd.published[c] - sd.published[c];  // 0, or NaN
        const double noise = std::min(square(estimate.noise[c]), of_model), reference = square(estimate.reference[c]),
                     temperature = square(estimate.temperature[c]);
        const double calibration = of_model - noise - reference - temperature, zero = with_zero - of_model,
                     motion = square(sd.published[c]) - with_zero;
        squared[TACTILED_OF_NOISE][c] = noise + known;
        squared[TACTILED_OF_REFERENCE][c] = reference + known;
        squared[TACTILED_OF_TEMPERATURE][c] = temperature + known;
        squared[TACTILED_OF_CALIBRATION][c] = calibration < 0 ? known : calibration + known;
        squared[TACTILED_OF_ZERO][c] = zero < 0 ? known : zero + known;
        squared[TACTILED_OF_MOTION][c] = motion < 0 ? known : motion + known;
    }
    for (std::size_t part = 0; part < TACTILED_PARTS; ++part)
        for (std::size_t c = 0; c < 6; ++c) budget.sd_part[part][c] = std::sqrt(float(squared[part][c]));
    for (std::size_t c = 0; c < 6; ++c)
        budget.sd_part[TACTILED_OF_REFERENCE][c] =
            std::copysign(budget.sd_part[TACTILED_OF_REFERENCE][c], float(estimate.reference[c]));
}

// Sets how the errors correlate, and the load on which that depends. rt: wait-free
inline void put_correlations(const Correlations& correlations, const Wrench& raw_S, tactiled_budget& budget) noexcept {
    std::copy(correlations.between.begin(), correlations.between.end(), budget.correlation);
    for (std::size_t c = 0; c < 6; ++c) {
        const double load = raw_S[c] / correlations.full_scale[c];
        budget.load[c] = load == load ? float(load) : 0.0f;  // NaN: not measured
    }
    budget.alike = correlations.alike;
    budget.alike_within = correlations.alike_within;
    budget.model = correlations.model;
}

}  // namespace tactiled
