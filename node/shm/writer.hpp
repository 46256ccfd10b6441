// Creates and fills the segment that tactiled/layout.h describes. There is one writer, and any number of readers, which
// cannot modify the segment.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "config/options.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/frame.hpp"
#include "tactiled/layout.h"

namespace tactiled {

// Contents of the directory; the writer fills in rings and offsets.
struct SegmentPlan {
    std::string name;
    std::string version;
    std::string control;  // path of the control socket, "" = none
    std::string group;    // "" = the group of the daemon
    std::uint32_t watchdog_ms = 250;
    // slots per sensor, a power of two; 0: the maximum up to 1024 with which the segment has at most 2 MB
    std::uint32_t history = 0;
    // slots of the arrays of a sensor, and of the raw taxels of a link for each of its sensors; a power of two
    std::uint32_t array_history = 128;
    std::uint32_t calibration_id = 0;
    bool tool = false;  // the node records have a tool
    std::vector<tactiled_sensor> sensors;
    // for each sensor with n_taxels: place, m, and normal of each taxel, six numbers
    std::vector<std::vector<float>> places;
    std::vector<tactiled_link> links;  // taxels.record_size: bytes of the raw taxels of a frame, 0 = none
};

// The file tactiled.NAME in runtime_folder(). The file of an earlier daemon is replaced if its lock is free.
class SegmentWriter {
public:
    // Creates the file without a name (O_TMPFILE), fills and locks the file, and then gives it its name. Readers therefore
    // see no incomplete segment, and a kill at any moment needs no cleanup. setup: throws SetupError where another daemon of
    // that name runs (with its pid) or is starting, the name belongs to another user, or there is no room or no folder
    explicit SegmentWriter(const SegmentPlan& plan);
    // Marks the segment as stopped for the readers and removes the name.
    ~SegmentWriter();
    SegmentWriter(const SegmentWriter&) = delete;
    SegmentWriter& operator=(const SegmentWriter&) = delete;

    [[nodiscard]] std::uint32_t epoch() const noexcept { return header().epoch; }
    [[nodiscard]] std::uint64_t watchdog_ms() const noexcept { return header().watchdog_ms; }
    void set_state(tactiled_state state) noexcept;

    // Publishes the next sample of sensor `index`; its sequence must count up by one. rt: wait-free
    void publish(std::uint32_t index, const tactiled_placed& placed) noexcept;
    // Does the same for a sample of which no more is known. rt: wait-free
    void publish(std::uint32_t index, const tactiled_sample& sample) noexcept;
    // Publishes the array of sample `sequence` of sensor `index`: a record of tactiled_array_size() bytes, before the
    // sample.
    // rt: wait-free, linear in the size
    void publish_array(std::uint32_t index, std::uint64_t sequence, const void* record) noexcept;
    // Publishes the raw taxels of frame `number` of link `index`, before the frame. `record`: struct tactiled_taxels and
    // what follows it.
    // rt: wait-free, linear in the size
    void publish_taxels(std::uint32_t index, std::uint64_t number, std::span<const std::uint64_t> record) noexcept;
    // Publishes the next frame of link `index`, number `number` from 0. rt: wait-free
    void publish(std::uint32_t index, std::uint64_t number, const Frame& frame) noexcept;
    // Publishes the next node record, after the samples that the record counts. rt: wait-free
    void publish(const tactiled_node& node) noexcept;

    // Counts the lateness of a wake-up of the loop. rt: wait-free
    void count_lateness(std::uint64_t late_ns) noexcept;

    // set_sensor() replaces the directory entry of sensor `index`, except name, model, link, stale_ms, ring and array. Call
    // it between begin_reload() and end_reload(), which also sets the new CAL_ID. rt: wait-free
    void begin_reload() noexcept;
    void set_sensor(std::uint32_t index, const tactiled_sensor& entry) noexcept;
    void end_reload(std::uint32_t calibration_id) noexcept;

    // Wakes at most `max` of the readers that sleep until the next node record, and returns their number.
    // rt: no system call if no reader has requested a wake-up, else one, whose time grows with `max`
    int wake_readers(int max) noexcept;
    // Returns the page in which readers request their wake-up (struct tactiled_wake). The page is sealed and cannot shrink.
    [[nodiscard]] int wake_page() const noexcept { return wake_fd_; }

    // Counts the reasons of one sample of sensor `index`. From the thread that publishes it. rt: bounded by the
    // reasons
    void count_reasons(std::uint32_t index, std::uint32_t reasons) noexcept;
    // Sets how the age of the sensor's samples is proved, and the bound of the age. From the thread that publishes the
    // samples. rt: wait-free
    void set_age(std::uint32_t index, std::uint32_t freshness, double bound_ns) noexcept;
    // Removes the path of the control socket from the header, because another program may use that path. rt: wait-free
    void withdraw_control() noexcept;
    // Set a link's state and counters. Each word has one writer. rt: wait-free
    void set_link_state(std::uint32_t index, tactiled_link_state state) noexcept;
    void set_link_count(std::uint32_t index, tactiled_link_count kind, std::uint32_t count) noexcept;
    // Sets all counters of the link's thread, which are all except UNBOUND. rt: wait-free
    void set_link_counts(std::uint32_t index, const std::uint32_t (&count)[TACTILED_LINK_COUNTS]) noexcept;

private:
    [[nodiscard]] tactiled_header& header() const noexcept { return *reinterpret_cast<tactiled_header*>(base_); }
    void lay_out(const SegmentPlan& plan, std::uint32_t epoch);
    void give_back() noexcept;

    std::string path_;
    Descriptor fd_, wake_fd_;
    char* base_ = nullptr;
    std::size_t size_ = 0;
    const tactiled_wake* wake_ = nullptr;
};

}  // namespace tactiled
