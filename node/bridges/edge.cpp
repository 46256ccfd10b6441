#include "node/bridges/edge.hpp"

#include <algorithm>
#include <array>

namespace tactiled::bridges {

std::uint32_t grasp_quality(const tactiled_grasp& grasp, std::uint32_t worst_of_sensors) {
    if (grasp.state == TACTILED_GRIP_UNKNOWN) return TACTILED_BAD;
    return worst_of_sensors == TACTILED_GOOD ? TACTILED_GOOD : TACTILED_UNCERTAIN;
}

std::uint32_t weight_quality(const tactiled_grasp& grasp, std::uint32_t worst_of_sensors) {
    const std::uint32_t of_grasp = grasp_quality(grasp, worst_of_sensors);
    if (grasp.weight_state == TACTILED_WEIGHT_STABLE && grasp.weight_doubts == 0) return of_grasp;
    const bool has_value = grasp.weight_state == TACTILED_WEIGHT_ESTIMATING || grasp.weight_state == TACTILED_WEIGHT_STABLE;
    return has_value ? std::max<std::uint32_t>(of_grasp, TACTILED_UNCERTAIN) : std::uint32_t(TACTILED_BAD);
}

std::uint32_t worse(std::uint32_t a, std::uint32_t b) {
    const auto rank = [](std::uint32_t quality) {
        return quality == TACTILED_NO_VALUE ? std::uint32_t(TACTILED_BAD) : quality;
    };
    return std::max(rank(a), rank(b));
}

std::uint32_t worst_quality(std::span<const tactiled_sample> samples) {
    std::uint32_t worst = samples.empty() ? TACTILED_BAD : TACTILED_GOOD;
    for (const tactiled_sample& sample : samples) worst = worse(worst, sample.quality);
    return worst;
}

std::uint32_t worst_quality(const SegmentView& segment) {
    std::array<tactiled_sample, TACTILED_MAX_SENSORS> samples;
    const std::uint32_t n = segment.is_open() ? segment.n_sensors() : 0;
    for (std::uint32_t i = 0; i < n; ++i) segment.latest(i, samples[i]);
    return worst_quality(std::span(samples).first(n));
}

std::uint64_t valid_until_ns(const SegmentView& segment, std::uint32_t sensor, const tactiled_sample& sample) {
    return std::min(sample.t_ns + std::uint64_t(segment.c()->stale_ms[sensor]) * 1'000'000,
                    sample.t_published_ns + std::uint64_t(segment.c()->watchdog_ms) * 1'000'000);
}

std::uint64_t valid_until_ns(const SegmentView& segment, const tactiled_node& node) {
    return node.t_ns + std::uint64_t(tactiled_node_limit_ms(segment.c())) * 1'000'000;
}

}  // namespace tactiled::bridges
