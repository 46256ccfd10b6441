// Reads the segment of a tactiled daemon. C++17, header only, nothing to link.
//
//     tactiled::Reader left("gripper", "left");                    // node, sensor
//     for (tactiled_sample s; true;)
//         if (left.next(s) && s.quality == TACTILED_GOOD) use(s.force_S_N);
//
// A reader costs the daemon nothing, cannot delay it, and survives its death: values become BAD, and the reader attaches
// to the successor by itself. One object a thread.
#pragma once
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include "layout.h"

namespace tactiled {

inline std::uint64_t monotonic_ns() noexcept {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return std::uint64_t(t.tv_sec) * 1'000'000'000u + std::uint64_t(t.tv_nsec);
}

// What belongs together at one instant: a node record and the sample of each sensor that it names.
struct Snapshot {
    std::uint64_t taken_ns = 0;  // CLOCK_MONOTONIC
    tactiled_node node{};
    std::array<tactiled_sample, TACTILED_MAX_SENSORS> sensor{};  // judged at taken_ns; NO_VALUE beyond n_sensors
};

// One mapping of one segment. Moves, does not copy.
class Segment {
public:
    Segment() = default;
    // Maps /dev/shm/tactiled.NAME read-only and checks it. Throws std::runtime_error that says what is wrong.
    static Segment open(const std::string& node_name) {
        std::string why;
        Segment segment = try_open(node_name, why);
        if (!segment.is_open()) throw std::runtime_error(why);
        return segment;
    }
    // As open(), but returns a closed Segment and the reason.
    static Segment try_open(const std::string& node_name, std::string& why) {
        const std::string path = "/dev/shm/tactiled." + node_name;
        Segment segment;
        const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
        if (fd < 0) {
            why = path + ": " + std::strerror(errno) +
                  (errno == ENOENT   ? " (no daemon of that name runs)"
                   : errno == EACCES ? " (join the segment's group)"
                                     : "");
            return segment;
        }
        struct stat status {};
        if (::fstat(fd, &status) != 0 || status.st_size < off_t(sizeof(tactiled_header))) {
            why = path + ": too short to be a segment";
        } else {
            void* base = ::mmap(nullptr, std::size_t(status.st_size), PROT_READ, MAP_SHARED | MAP_POPULATE, fd, 0);
            if (base == MAP_FAILED) {
                why = path + ": mmap: " + std::strerror(errno);
            } else {
                segment.base_ = static_cast<const char*>(base);
                segment.size_ = std::size_t(status.st_size);
                why = segment.check();
                if (!why.empty()) {
                    why = path + ": " + why;
                    segment.close();
                }
            }
        }
        ::close(fd);
        return segment;
    }

    Segment(Segment&& other) noexcept { *this = std::move(other); }
    Segment& operator=(Segment&& other) noexcept {
        std::swap(base_, other.base_);
        std::swap(size_, other.size_);
        return *this;
    }
    Segment(const Segment&) = delete;
    Segment& operator=(const Segment&) = delete;
    ~Segment() { close(); }
    void close() noexcept {
        if (base_ != nullptr) ::munmap(const_cast<char*>(base_), size_);
        base_ = nullptr;
    }

    bool is_open() const noexcept { return base_ != nullptr; }
    const tactiled_header& header() const noexcept { return *reinterpret_cast<const tactiled_header*>(base_); }
    // False once the daemon has ended cleanly or a successor has taken over: open again.
    bool is_current() const noexcept {
        const auto state = __atomic_load_n(&header().state, __ATOMIC_ACQUIRE);
        return state == TACTILED_RUNNING || state == TACTILED_STARTING;
    }
    std::uint32_t n_sensors() const noexcept { return header().n_sensors; }
    std::uint32_t n_links() const noexcept { return header().n_links; }
    const tactiled_sensor& sensor(std::uint32_t index) const noexcept {
        return *reinterpret_cast<const tactiled_sensor*>(base_ + header().sensor_offset +
                                                         std::size_t(index) * header().sensor_size);
    }
    const tactiled_link& link(std::uint32_t index) const noexcept {
        return *reinterpret_cast<const tactiled_link*>(base_ + header().link_offset +
                                                       std::size_t(index) * header().link_size);
    }
    // Index of the sensor of that name, or -1.
    int find(const std::string& sensor_name) const noexcept {
        for (std::uint32_t i = 0; i < n_sensors(); ++i)
            if (sensor_name == sensor(i).name) return int(i);
        return -1;
    }

    // The newest sample of a sensor, judged now. False, and a BAD sample, when there is none.
    bool latest(std::uint32_t index, tactiled_sample& sample) const noexcept {
        if (!tactiled_ring_latest(base_, &sensor(index).ring, &sample, sizeof sample)) {
            sample = tactiled_sample{};
            tactiled_invalidate(&sample, TACTILED_READER_OVERRUN);
            return false;
        }
        tactiled_judge(&sample, sensor(index).stale_ms, monotonic_ns());
        if (!is_current()) tactiled_invalidate(&sample, TACTILED_DAEMON_STOPPED);
        return true;
    }

    bool latest_node(tactiled_node& node) const noexcept {
        return tactiled_ring_latest(base_, &header().node, &node, sizeof node) != 0;
    }

    // A consistent set of node record and samples. False when the daemon has published none, or lapped every try.
    bool snapshot(Snapshot& out) const noexcept {
        for (int tries = 0; tries < 16; ++tries) {
            const std::uint64_t begun_ns = monotonic_ns();
            if (!latest_node(out.node)) return false;
            bool whole = true;
            for (std::uint32_t i = 0; i < n_sensors() && whole; ++i)
                whole = tactiled_ring_read(base_, &sensor(i).ring, std::uint32_t(out.node.count[i]) - 1, &out.sensor[i],
                                           sizeof out.sensor[i]) != 0;
            if (!whole) continue;
            out.taken_ns = monotonic_ns();
            // Held up between reading and judging: what was read may be old, what is there now need not be.
            if (out.taken_ns - begun_ns > 10'000'000u && tries < 15) continue;
            const bool current = is_current();
            for (std::uint32_t i = 0; i < n_sensors(); ++i) {
                tactiled_judge(&out.sensor[i], sensor(i).stale_ms, out.taken_ns);
                if (!current) tactiled_invalidate(&out.sensor[i], TACTILED_DAEMON_STOPPED);
            }
            for (std::uint32_t i = n_sensors(); i < TACTILED_MAX_SENSORS; ++i) out.sensor[i] = tactiled_sample{};
            return true;
        }
        return false;
    }

    const char* base() const noexcept { return base_; }

private:
    // "" when the header describes something that may be read within the mapping.
    std::string check() const {
        const tactiled_header& h = header();
        if (std::memcmp(h.magic, TACTILED_MAGIC, sizeof h.magic) != 0) return "no tactiled segment";
        if (h.byte_order != TACTILED_BYTE_ORDER) return "written by a machine of the other byte order";
        if (h.major != TACTILED_MAJOR)
            return "its layout is version " + std::to_string(h.major) + "." + std::to_string(h.minor) +
                   ", this reader knows " + std::to_string(TACTILED_MAJOR) + "." + std::to_string(TACTILED_MINOR) +
                   ": build the reader against the daemon's headers";
        if (h.total_size > size_ || h.header_size < sizeof(tactiled_header)) return "truncated";
        if (h.n_sensors > TACTILED_MAX_SENSORS || h.n_links > TACTILED_MAX_LINKS) return "more sensors or links than can be";
        if (h.sensor_size < sizeof(tactiled_sensor) || h.link_size < sizeof(tactiled_link))
            return "directory entries too small";
        if (!fits(h.sensor_offset, std::uint64_t(h.sensor_size) * h.n_sensors, 4) ||
            !fits(h.link_offset, std::uint64_t(h.link_size) * h.n_links, 128))
            return "a directory lies outside";
        if (!fits(h.node)) return "the node ring lies outside";
        for (std::uint32_t i = 0; i < h.n_sensors; ++i)
            if (!fits(sensor(i).ring)) return "a sensor's ring lies outside";
        return "";
    }
    bool fits(std::uint64_t offset, std::uint64_t size, std::uint32_t alignment) const noexcept {
        return offset % alignment == 0 && offset + size <= size_;
    }
    bool fits(const tactiled_ring& ring) const noexcept {
        return ring.slots != 0 && (ring.slots & (ring.slots - 1)) == 0 && ring.slot_size % 128 == 0 &&
               ring.record_size % 4 == 0 && TACTILED_RECORD_OFFSET + std::uint64_t(ring.record_size) <= ring.slot_size &&
               fits(ring.offset, std::uint64_t(ring.slots) * ring.slot_size, 128) && fits(ring.head_offset, 4, 4);
    }

    const char* base_ = nullptr;
    std::size_t size_ = 0;
};

// Follows one sensor of one node, across restarts of the daemon.
class Reader {
public:
    // Attaches at once if it can; a daemon that is not there yet is waited for by latest() and next().
    Reader(std::string node_name, std::string sensor_name) : node_(std::move(node_name)), name_(std::move(sensor_name)) {
        attach();
    }

    bool is_attached() const noexcept { return index_ >= 0; }
    const std::string& why_not() const noexcept { return why_; }
    const Segment& segment() const noexcept { return segment_; }

    // The newest sample; BAD with a reason when there is no good one. Never blocks.
    tactiled_sample latest() {
        tactiled_sample sample{};
        if (!ready()) {
            tactiled_invalidate(&sample, TACTILED_DAEMON_STOPPED);
            return sample;
        }
        segment_.latest(std::uint32_t(index_), sample);
        return sample;
    }

    // The sample after the last one that next() gave, or false when there is none yet. The first call gives the newest.
    // What the ring has already overwritten is skipped and counted in lost().
    bool next(tactiled_sample& sample) {
        if (!ready()) return false;
        const tactiled_ring& ring = segment_.sensor(std::uint32_t(index_)).ring;
        for (int tries = 0; tries < 16; ++tries) {
            const std::uint32_t head = tactiled_ring_head(segment_.base(), &ring);
            if (!started_) next_ = head - 1;
            if (started_ && head == next_) return false;
            if (head - next_ >= ring.slots && started_) {  // the slot of `next_` may be open already
                const std::uint32_t oldest = head - ring.slots + 1 + ring.slots / 8;
                lost_ += oldest - next_;
                next_ = oldest;
            }
            if (!tactiled_ring_read(segment_.base(), &ring, next_, &sample, sizeof sample)) {
                if (!started_) return false;
                continue;
            }
            started_ = true;
            ++next_;
            tactiled_judge(&sample, segment_.sensor(std::uint32_t(index_)).stale_ms, monotonic_ns());
            return true;
        }
        return false;
    }

    // Samples that next() could not give because this reader was too slow.
    std::uint64_t lost() const noexcept { return lost_; }

private:
    bool ready() {
        if (index_ >= 0 && segment_.is_current()) return true;
        const std::uint64_t now = monotonic_ns();
        if (now - tried_ns_ >= 10'000'000u) attach();  // 10 ms: an open() a try is cheap, a spinning reader is not
        return index_ >= 0 && segment_.is_current();
    }
    void attach() {
        tried_ns_ = monotonic_ns();
        Segment fresh = Segment::try_open(node_, why_);
        if (!fresh.is_open() || !fresh.is_current()) return;
        segment_ = std::move(fresh);
        index_ = segment_.find(name_);
        started_ = false;
        if (index_ < 0) why_ = "node \"" + node_ + "\" has no sensor \"" + name_ + "\"";
    }

    std::string node_, name_, why_;
    Segment segment_;
    int index_ = -1;
    bool started_ = false;
    std::uint32_t next_ = 0;
    std::uint64_t lost_ = 0, tried_ns_ = 0;
};

}  // namespace tactiled
