// The segment as the page shows it: at each tick one consistent set of records, and for each sensor the extremes of all
// samples since the tick before, so that neither a peak nor a bad sample between two ticks is missed.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::web {

// One sensor over one tick. Components fx fy fz mx my mz in N and Nm, frame S; NaN: no value.
struct Interval {
    using Values = std::array<float, 6>;
    Values value = kUnknown;                 // value of the newest sample, judged at the tick
    Values low = kUnknown, high = kUnknown;  // extremes of value -/+ one standard uncertainty; NaN where that is unknown
    std::uint32_t quality = 0;               // the worst of all samples: enum tactiled_quality
    std::uint32_t reasons = 0;               // reasons of all samples together

private:
    static constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    static constexpr Values kUnknown{kNan, kNan, kNan, kNan, kNan, kNan};
};

struct View {
    std::uint64_t taken_ns = 0;   // CLOCK_MONOTONIC
    std::int64_t wall_ms = 0;     // since 1970
    bool is_alive = false;        // the daemon publishes; false: `why`, and no sensor has a value
    std::string why;              // for a person
    std::uint64_t structure = 0;  // another number: names, ranges or the daemon have changed
    std::uint32_t reloads = 0;    // tactiled_header.reloads
    Snapshot snapshot;
    std::array<Interval, TACTILED_MAX_SENSORS> interval{};
    std::uint64_t missed = 0;  // samples that were overwritten before they were seen
    const Segment* segment = nullptr;

    [[nodiscard]] std::uint32_t n_sensors() const { return segment->is_open() ? segment->n_sensors() : 0; }
    [[nodiscard]] std::uint32_t n_links() const { return segment->is_open() ? segment->n_links() : 0; }
    // See bridges/edge.hpp.
    [[nodiscard]] std::uint32_t grasp_quality() const;
    [[nodiscard]] std::uint32_t weight_quality() const;

private:
    [[nodiscard]] std::uint32_t worst_quality() const;
};

// Follows one node, across restarts of its daemon.
class Source {
public:
    explicit Source(std::string node_name) : node_name_(std::move(node_name)) { view_.segment = &segment_; }

    // Looks at everything that was published since the last call. Never blocks.
    const View& tick();
    [[nodiscard]] const View& view() const { return view_; }

private:
    void attach();
    void read_interval(std::uint32_t sensor);

    std::string node_name_, why_;
    std::string unreadable_;  // why the segment of a successor cannot be opened, such as that of a newer layout
    Segment segment_;
    std::uint64_t tried_ns_ = 0;
    std::array<tactiled_cursor, TACTILED_MAX_SENSORS> cursor_{};
    View view_;
};

}  // namespace tactiled::web
