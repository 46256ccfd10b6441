// Reads the segment of a tactiled daemon. C++17, header only, nothing to link.
//
//     tactiled::Reader left("gripper", "left");                    // node, sensor
//     for (tactiled_sample s; left.wait(s, 1000);)
//         if (s.quality == TACTILED_GOOD) use(s.force_S_N);
//
// A reader costs the daemon nothing and cannot delay it. When the daemon dies, values become BAD, and the
// reader attaches to the next daemon automatically. Each thread needs its own object. The functions are
// documented and implemented in reader.h.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>
#if __cplusplus >= 202002L
#include <span>
#endif

#include <cmath>

#include "reader.h"

namespace tactiled {

inline std::uint64_t monotonic_ns() noexcept { return tactiled_now_ns(); }

// Records of one instant: a node record, and the sample of each sensor that belongs to it.
struct Snapshot {
    std::uint64_t taken_ns = 0;  // CLOCK_MONOTONIC
    tactiled_node node{};
    std::array<tactiled_sample, TACTILED_MAX_SENSORS> sensor{};  // judged at taken_ns; NO_VALUE beyond n_sensors
    // The sample of each sensor, with the parts of its standard deviations (uncertainty.h).
    [[nodiscard]] tactiled_placed placed(std::uint32_t index) const noexcept {
        return {sensor[index], {NAN, NAN}, budget[index]};
    }
    std::array<tactiled_budget, TACTILED_MAX_SENSORS> budget{};
};

// Histogram of the lateness of the pipeline's wake-ups: element i counts from tactiled_lateness_ns(i) to
// below tactiled_lateness_ns(i + 1).
using Lateness = std::array<std::uint32_t, TACTILED_LATENESS_BUCKETS>;
// Returns the lateness that the share `q` of the wake-ups did not exceed, interpolated within a step (1/8
// octave or 128 ns); NaN if there were no wake-ups.
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

// The array of a sensor with taxels: a copy of a record, judged as its sample.
class Array {
public:
    // The sample that the array belongs to, whose verdict is that of the array, and what the array yields; NO_VALUE before
    // the first read.
    const tactiled_array& head() const noexcept {
        static const tactiled_array none{};
        return words_.empty() ? none : *reinterpret_cast<const tactiled_array*>(words_.data());
    }
    std::uint32_t n_taxels() const noexcept { return plan_.n_taxels; }
    std::uint32_t components() const noexcept { return plan_.components; }  // bits 0..2: fx fy fz are measured
    std::uint32_t n_components() const noexcept { return plan_.n_components; }
    // The measured components of the force on taxel i, N, frame S; NaN without one. Component c of taxel i is also
    // forces()[i * n_components() + c].
    const float* force_S_N(std::uint32_t i) const noexcept { return forces() + std::size_t(i) * plan_.n_components; }
    const float* forces() const noexcept { return tactiled_taxel_forces(&head()); }
    const std::uint8_t* states() const noexcept { return tactiled_taxel_states(&head(), &plan_); }
#if __cplusplus >= 202002L
    std::span<const float> force_span() const noexcept {
        return {forces(), words_.empty() ? 0 : std::size_t(plan_.n_taxels) * plan_.n_components};
    }
    std::span<const std::uint8_t> state_span() const noexcept { return {states(), words_.empty() ? 0 : plan_.n_taxels}; }
#endif

private:
    friend class SegmentView;
    friend class Reader;
    void invalidate(std::uint32_t reason) noexcept {
        if (!words_.empty())
            tactiled_invalidate_array(reinterpret_cast<tactiled_array*>(words_.data()), plan_.n_taxels * plan_.n_components,
                                      reason);
    }
    // Allocates when the shape changes, else never.
    tactiled_array* prepare(const tactiled_array_plan& plan) {
        plan_ = plan;
        words_.resize(tactiled_array_size(plan.n_taxels, plan.components) / sizeof(std::uint64_t));
        return reinterpret_cast<tactiled_array*>(words_.data());
    }

    tactiled_array_plan plan_{};
    std::vector<std::uint64_t> words_;
};

// Read access to a mapped segment.
class SegmentView {
public:
    explicit SegmentView(const tactiled_segment* mapped) noexcept : c_(mapped) {}

    bool is_open() const noexcept { return c_->base != nullptr; }
    const tactiled_header& header() const noexcept { return *tactiled_header_of(c_); }
    // False if the daemon has ended cleanly or a successor has taken over: open again.
    bool is_current() const noexcept { return tactiled_is_current(c_) != 0; }
    std::uint32_t n_sensors() const noexcept { return c_->n_sensors; }
    std::uint32_t n_links() const noexcept { return c_->n_links; }
    const tactiled_sensor& sensor(std::uint32_t index) const noexcept { return *tactiled_sensor_of(c_, index); }
    const tactiled_link& link(std::uint32_t index) const noexcept { return *tactiled_link_of(c_, index); }
    // Identifies the configuration and the calibrations in force; changes with a reload.
    std::uint32_t calibration_id() const noexcept { return __atomic_load_n(&header().calibration_id, __ATOMIC_RELAXED); }
    // Counted since the daemon's start. All 0 means unknown.
    Lateness lateness() const noexcept {
        Lateness out{};
        const std::uint32_t at = header().lateness_offset;
        if (at == 0 || at % 4 != 0 || at > c_->size || c_->size - at < sizeof out) return out;
        const auto* counts = reinterpret_cast<const std::uint32_t*>(c_->base + at);
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = __atomic_load_n(counts + i, __ATOMIC_RELAXED);
        return out;
    }
    // Returns the index of the sensor with that name, or -1.
    int find(const std::string& sensor_name) const noexcept { return tactiled_find(c_, sensor_name.c_str()); }
    // Returns the message for a name that no sensor has, with the names that there are.
    std::string why_no_sensor(const std::string& node_name, const std::string& sensor_name) const {
        char text[320];
        tactiled_no_sensor(c_, node_name.c_str(), sensor_name.c_str(), text, sizeof text);
        return text;
    }

    // Copies the newest sample of a sensor, judged after the copy, or at `now_ns` if that is later. Returns false and a BAD
    // sample if there is none.
    bool latest(std::uint32_t index, tactiled_placed& placed, std::uint64_t now_ns = 0) const noexcept {
        return tactiled_latest_placed(c_, index, &placed, now_ns) != 0;
    }
    bool latest(std::uint32_t index, tactiled_sample& sample, std::uint64_t now_ns = 0) const noexcept {
        return tactiled_latest(c_, index, &sample, now_ns) != 0;
    }
    // True if the sensor has taxels.
    bool has_array(std::uint32_t index) const noexcept { return c_->array[index].ring.slots != 0; }
    // Copies the newest array of a sensor, judged as latest(). Returns false and a BAD array if there is none.
    bool latest(std::uint32_t index, Array& array, std::uint64_t now_ns = 0) const {
        return tactiled_latest_array(c_, index, array.prepare(c_->array[index]), now_ns) != 0;
    }
    // Copies the array of a sample that was read from this segment, as it was published. Returns false if it is no longer
    // kept.
    bool array_of(std::uint32_t index, const tactiled_sample& sample, Array& array) const {
        return tactiled_array_of_sample(c_, index, sample.sequence, array.prepare(c_->array[index])) != 0;
    }
    // Copies the newest node record; its grasp and its tool are judged likewise. Returns false if there is none.
    bool latest_node(tactiled_node& node, std::uint64_t now_ns = 0) const noexcept {
        return tactiled_latest_node(c_, &node, now_ns) != 0;
    }

    // Copies a consistent set of node record and samples. Returns false if the daemon has published none, or
    // has overwritten the records in every attempt.
    bool snapshot(Snapshot& out) const noexcept {
        for (int tries = 0; tries < 16; ++tries) {
            const std::uint64_t begun_ns = monotonic_ns();
            if (!latest_node(out.node)) return false;
            bool whole = true;
            for (std::uint32_t i = 0; i < n_sensors() && whole; ++i) {
                tactiled_placed placed;
                whole = tactiled_ring_read(c_->base, &c_->ring[i], std::uint32_t(out.node.count[i]) - 1, &placed,
                                           sizeof placed) != 0;
                tactiled_forget_appended(&placed, c_->ring[i].record_size);
                out.sensor[i] = placed.sample;
                out.budget[i] = placed.budget;
            }
            if (!whole) continue;
            out.taken_ns = monotonic_ns();
            // The thread was interrupted between reading and judging: the copy may be old, so it is read
            // again.
            if (out.taken_ns - begun_ns > 10'000'000u && tries < 15) continue;
            // The node record shows whether the daemon is alive.
            const bool current = is_current() && tactiled_is_fresh(out.node.t_ns, out.taken_ns, c_->watchdog_ms) != 0;
            for (std::uint32_t i = 0; i < n_sensors(); ++i) {
                tactiled_judge(&out.sensor[i], c_->stale_ms[i], out.taken_ns);
                if (!current) tactiled_invalidate(&out.sensor[i], TACTILED_DAEMON_STOPPED);
                if (out.sensor[i].quality != TACTILED_BAD) continue;
                tactiled_placed placed = out.placed(i);
                tactiled_forget_appended(&placed, 0);
                out.budget[i] = placed.budget;
            }
            if (!current) tactiled_forget_grasp(&out.node.grasp);
            if (!current) tactiled_forget_tool(&out.node.tool);
            for (std::uint32_t i = n_sensors(); i < TACTILED_MAX_SENSORS; ++i) out.sensor[i] = {}, out.budget[i] = {};
            return true;
        }
        return false;
    }

    const char* base() const noexcept { return c_->base; }
    const tactiled_segment* c() const noexcept { return c_; }

private:
    const tactiled_segment* c_;
};

// One mapping of one segment. It can be moved and not copied.
class Segment : public SegmentView {
public:
    Segment() noexcept : SegmentView(&mapped_) {}
    // Maps the segment of a node read-only and checks it, in `folder` or, if that is "", in the folders of
    // folder.h. Throws std::runtime_error with the reason.
    static Segment open(const std::string& node_name, const std::string& folder = "") {
        std::string why;
        Segment segment = try_open(node_name, why, folder);
        if (!segment.is_open()) throw std::runtime_error(why);
        return segment;
    }
    // Does the same as open(), but returns a closed Segment and the reason.
    static Segment try_open(const std::string& node_name, std::string& why, const std::string& folder = "") {
        Segment segment;
        if (!tactiled_open_in(&segment.mapped_, folder.c_str(), node_name.c_str())) why = segment.mapped_.why;
        return segment;
    }
    // Returns a warning that an open segment may be forged; "" in any folder but /dev/shm.
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
    // Attaches at once if possible; otherwise the other functions keep trying until the daemon exists. A name
    // of more than 31 characters is refused permanently: see why_not(). `folder` is as for Segment::open().
    Reader(const std::string& node_name, const std::string& sensor_name, const std::string& folder = "") {
        tactiled_reader_init_in(&c_, folder.c_str(), node_name.c_str(), sensor_name.c_str());
    }
    ~Reader() { tactiled_reader_detach(&c_); }
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;

    bool is_attached() const noexcept { return c_.index >= 0; }
    std::string why_not() const { return c_.segment.why; }
    SegmentView segment() const noexcept { return SegmentView(&c_.segment); }

    // Returns the newest sample, which is BAD with a reason if there is no valid one. Never blocks. next() is
    // not affected, except where a daemon has ended: the samples that next() had not returned then count as
    // lost.
    tactiled_sample latest() noexcept {
        tactiled_sample sample;
        tactiled_reader_latest(&c_, &sample);
        return sample;
    }
    // Copies the newest array of the sensor, which is BAD with a reason if there is no valid one. Returns false if the
    // sensor has no taxels, or there is no daemon. Never blocks.
    bool latest(Array& array) {
        (void)latest();  // attaches to a successor
        if (!is_attached() || !segment().has_array(std::uint32_t(c_.index))) {
            array.invalidate(TACTILED_DAEMON_STOPPED);
            return false;
        }
        segment().latest(std::uint32_t(c_.index), array);
        return true;
    }
    // Gives the sample after the last one that next() gave, or returns false if there is none yet. The first
    // call gives the newest sample. When the daemon ends or dies, next() gives the samples that are left in
    // the ring, then one BAD sample, then the samples of the successor.
    bool next(tactiled_sample& sample) noexcept { return tactiled_reader_next(&c_, &sample) != 0; }
    // Does the same as next(), but waits. Returns false on timeout.
    bool wait(tactiled_sample& sample, std::uint32_t timeout_ms, Wait how = Wait::block) noexcept {
        return tactiled_reader_wait(&c_, &sample, timeout_ms, tactiled_wait(how)) != 0;
    }
    // Restarts at the oldest sample that is kept.
    void rewind() noexcept { tactiled_reader_rewind(&c_); }
    // Samples that next() could not give because this reader was too slow.
    std::uint64_t lost() const noexcept { return c_.cursor.lost; }

private:
    tactiled_reader c_{};
};

}  // namespace tactiled
