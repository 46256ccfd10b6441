// The last 60 seconds of every sensor, so that a page that is loaded anew is not empty.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "node/web/source.hpp"

namespace tactiled::web {

inline constexpr double kTicksPerS = 30;
inline constexpr std::size_t kHistoryTicks = 60 * 30;

class History {
public:
    // Names the sensors from now on. A sensor of a known name keeps its past; of a new one there is none.
    void name_sensors(const std::vector<std::string>& names);
    void add(const View& view);

    // Appends one JSON object for `sensor`: {"sensor": index, "t_s": ..., "quality": ..., "reasons": ..., "value": [...],
    // "low": [...], "high": [...]}. Each column is base64 of little-endian numbers, oldest first: t_s float64
    // (CLOCK_MONOTONIC), quality and reasons uint32, the others float32, one column for each bit of `components`.
    void encode(std::size_t sensor, std::uint32_t components, std::string& out) const;

private:
    struct Past {
        std::string name;
        std::vector<Interval> ring;
    };
    std::vector<double> t_s_;
    std::vector<Past> sensors_;
    std::size_t next_ = 0, size_ = 0;
};

// Appends `bytes` in base64, padded.
void append_base64(std::string& out, const void* bytes, std::size_t size);

}  // namespace tactiled::web
