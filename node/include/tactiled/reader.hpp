// Reads the segment of a tactiled daemon. C++17, header only, nothing to link.
//
//     tactiled::Reader left("gripper", "left");                    // node, sensor
//     for (tactiled_sample s; left.wait(s, 1000);)
//         if (s.quality == TACTILED_GOOD) use(s.force_S_N);
//
// A reader costs the daemon nothing, cannot delay it, and survives its death: values become BAD, and the reader attaches
// to the successor by itself. One object a thread. The functions are documented and implemented in reader.h.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "reader.h"

namespace tactiled {

inline std::uint64_t monotonic_ns() noexcept { return tactiled_now_ns(); }

// Records of one instant: a node record and the sample of each sensor that it names.
struct Snapshot {
    std::uint64_t taken_ns = 0;  // CLOCK_MONOTONIC
    tactiled_node node{};
    std::array<tactiled_sample, TACTILED_MAX_SENSORS> sensor{};  // judged at taken_ns; NO_VALUE beyond n_sensors
};

// How often the pipeline's loop woke how late: index i is from tactiled_lateness_ns(i) to before that of i + 1.
using Lateness = std::array<std::uint32_t, TACTILED_LATENESS_BUCKETS>;
// The lateness that the share `q` of the wake-ups did not exceed, between the ends of a step (1/8 octave or 128 ns); NaN
// without any.
inline double lateness_quantile_ns(const Lateness& counts, double q) noexcept {
    double all = 0, below = 0;
    for (const auto n : counts) all += n;
    for (std::uint32_t i = 0; i < counts.size(); below += counts[i++]) {
        if (counts[i] == 0 || below + counts[i] < q * all) continue;
        const double from = double(tactiled_lateness_ns(i)), to = double(tactiled_lateness_ns(i + 1));
        return from + (to - from) * (q * all - below) / counts[i];
    }
    return std::numeric_limits<double>::quiet_NaN();
}

// The readable contents of a mapped segment.
class SegmentView {
public:
    explicit SegmentView(const tactiled_segment* mapped) noexcept : c_(mapped) {}

    bool is_open() const noexcept { return c_->base != nullptr; }
    const tactiled_header& header() const noexcept { return *tactiled_header_of(c_); }
    // False once the daemon has ended cleanly or a successor has taken over: open again.
    bool is_current() const noexcept { return tactiled_is_current(c_) != 0; }
    std::uint32_t n_sensors() const noexcept { return c_->n_sensors; }
    std::uint32_t n_links() const noexcept { return c_->n_links; }
    const tactiled_sensor& sensor(std::uint32_t index) const noexcept { return *tactiled_sensor_of(c_, index); }
    const tactiled_link& link(std::uint32_t index) const noexcept { return *tactiled_link_of(c_, index); }
    // Identifies the configuration and the calibrations in force; another one after a reload.
    std::uint32_t calibration_id() const noexcept { return __atomic_load_n(&header().calibration_id, __ATOMIC_RELAXED); }
    // Since the daemon's start. All 0: not known.
    Lateness lateness() const noexcept {
        Lateness out{};
        const std::uint32_t at = header().lateness_offset;
        if (at == 0 || at % 4 != 0 || at > c_->size || c_->size - at < sizeof out) return out;
        const auto* counts = reinterpret_cast<const std::uint32_t*>(c_->base + at);
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = __atomic_load_n(counts + i, __ATOMIC_RELAXED);
        return out;
    }
    // Index of the sensor of that name, or -1.
    int find(const std::string& sensor_name) const noexcept { return tactiled_find(c_, sensor_name.c_str()); }

    // The newest sample of a sensor, judged at `now_ns`. False, and a BAD sample, when there is none.
    bool latest(std::uint32_t index, tactiled_sample& sample, std::uint64_t now_ns = monotonic_ns()) const noexcept {
        return tactiled_latest(c_, index, &sample, now_ns) != 0;
    }
    // The newest node record; its grasp and its tool are judged at `now_ns`. False when there is none.
    bool latest_node(tactiled_node& node, std::uint64_t now_ns = monotonic_ns()) const noexcept {
        return tactiled_latest_node(c_, &node, now_ns) != 0;
    }

    // A consistent set of node record and samples. False when the daemon has published none, or lapped every try.
    bool snapshot(Snapshot& out) const noexcept {
        for (int tries = 0; tries < 16; ++tries) {
            const std::uint64_t begun_ns = monotonic_ns();
            if (!latest_node(out.node)) return false;
            bool whole = true;
            for (std::uint32_t i = 0; i < n_sensors() && whole; ++i)
                whole = tactiled_ring_read(c_->base, &c_->ring[i], std::uint32_t(out.node.count[i]) - 1, &out.sensor[i],
                                           sizeof out.sensor[i]) != 0;
            if (!whole) continue;
            out.taken_ns = monotonic_ns();
            // Held up between reading and judging: what was read may be old, what is there now need not be.
            if (out.taken_ns - begun_ns > 10'000'000u && tries < 15) continue;
            // The node record is the daemon's newest sign of life.
            const bool current = is_current() && tactiled_is_fresh(out.node.t_ns, out.taken_ns, c_->watchdog_ms) != 0;
            for (std::uint32_t i = 0; i < n_sensors(); ++i) {
                tactiled_judge(&out.sensor[i], c_->stale_ms[i], out.taken_ns);
                if (!current) tactiled_invalidate(&out.sensor[i], TACTILED_DAEMON_STOPPED);
            }
            if (!current) tactiled_forget_grasp(&out.node.grasp);
            if (!current) tactiled_forget_tool(&out.node.tool);
            for (std::uint32_t i = n_sensors(); i < TACTILED_MAX_SENSORS; ++i) out.sensor[i] = tactiled_sample{};
            return true;
        }
        return false;
    }

    const char* base() const noexcept { return c_->base; }
    const tactiled_segment* c() const noexcept { return c_; }

private:
    const tactiled_segment* c_;
};

// One mapping of one segment. Moves, does not copy.
class Segment : public SegmentView {
public:
    Segment() noexcept : SegmentView(&mapped_) {}
    // Maps the segment of a node read-only and checks it, in `folder` or, where that is "", in those of folder.h. Throws
    // std::runtime_error that says what is wrong.
    static Segment open(const std::string& node_name, const std::string& folder = "") {
        std::string why;
        Segment segment = try_open(node_name, why, folder);
        if (!segment.is_open()) throw std::runtime_error(why);
        return segment;
    }
    // The same as open(), but returns a closed Segment and the reason.
    static Segment try_open(const std::string& node_name, std::string& why, const std::string& folder = "") {
        Segment segment;
        if (!tactiled_open_in(&segment.mapped_, folder.c_str(), node_name.c_str())) why = segment.mapped_.why;
        return segment;
    }
    // A warning that an open segment may be forged; "" in any folder but /dev/shm.
    const char* warning() const noexcept { return is_open() ? mapped_.why : ""; }
    Segment(Segment&& other) noexcept : Segment() { *this = std::move(other); }
    Segment& operator=(Segment&& other) noexcept {
        std::swap(mapped_, other.mapped_);
        return *this;
    }
    Segment(const Segment&) = delete;
    Segment& operator=(const Segment&) = delete;
    ~Segment() { close(); }
    void close() noexcept { tactiled_close(&mapped_); }

private:
    tactiled_segment mapped_{};
};

enum class Wait { poll = TACTILED_POLL, predict = TACTILED_PREDICT, block = TACTILED_BLOCK };

// Follows one sensor of one node, across restarts of the daemon.
class Reader {
public:
    // Attaches at once if it can; a daemon that is not there yet is waited for by the other functions. A name of more than
    // 31 characters is refused for good: why_not(). `folder` is as for Segment::open().
    Reader(const std::string& node_name, const std::string& sensor_name, const std::string& folder = "") {
        tactiled_reader_init_in(&c_, folder.c_str(), node_name.c_str(), sensor_name.c_str());
    }
    ~Reader() { tactiled_reader_detach(&c_); }
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;

    bool is_attached() const noexcept { return c_.index >= 0; }
    std::string why_not() const { return c_.segment.why; }
    SegmentView segment() const noexcept { return SegmentView(&c_.segment); }

    // The newest sample; BAD with a reason when there is no good one. Never blocks. Takes nothing from next() but, where a
    // daemon has ended, what next() had not taken of it: that counts as lost.
    tactiled_sample latest() noexcept {
        tactiled_sample sample;
        tactiled_reader_latest(&c_, &sample);
        return sample;
    }
    // The sample after the last one that next() gave, or false when there is none yet. The first call gives the newest.
    // When the daemon ends or dies: what is left in the ring, then one BAD sample, then the successor's.
    bool next(tactiled_sample& sample) noexcept { return tactiled_reader_next(&c_, &sample) != 0; }
    // The same as next(), but waits. False when the time is over.
    bool wait(tactiled_sample& sample, std::uint32_t timeout_ms, Wait how = Wait::block) noexcept {
        return tactiled_reader_wait(&c_, &sample, timeout_ms, tactiled_wait(how)) != 0;
    }
    // Starts again with the oldest sample that is kept.
    void rewind() noexcept { tactiled_reader_rewind(&c_); }
    // Samples that next() could not give because this reader was too slow.
    std::uint64_t lost() const noexcept { return c_.cursor.lost; }

private:
    tactiled_reader c_{};
};

}  // namespace tactiled
