#include "node/shm/writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <linux/futex.h>
#include <linux/membarrier.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>

#include "drivers/clock.hpp"
#include "node/shm/folder.hpp"
#include "node/shm/frame_record.hpp"
#include "node/shm/lock_file.hpp"
#include "node/shm/publish.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

constexpr std::uint32_t kAlign = 128;

std::uint32_t aligned(std::uint64_t size) { return std::uint32_t((size + kAlign - 1) / kAlign * kAlign); }

std::string boot_id() {
    char text[40] = "";
    if (std::FILE* file = std::fopen("/proc/sys/kernel/random/boot_id", "re")) {
        if (std::fgets(text, sizeof text, file) == nullptr) text[0] = 0;
        std::fclose(file);
    }
    text[std::strcspn(text, "\n")] = 0;
    return text;
}

constexpr std::uint32_t kNodeRecords = 64;  // 16 ms of a 4 kHz loop; readers use only the newest records
constexpr std::size_t kPreferredSize = 2'000'000, kFramesSize = 1'000'000;
constexpr std::uint32_t kMaxHistory = 1024, kMinHistory = 64;

// Returns the number of frames per link, so that the frames of all links need at most 1 MB. At 1 kHz a recorder may pause
// for 1 s with one or two links, and for 0.13 s with sixteen.
std::uint32_t frames_of(const SegmentPlan& plan) {
    std::uint32_t frames = kMaxHistory;
    while (frames > kMinHistory &&
           frames * aligned(TACTILED_RECORD_OFFSET + sizeof(tactiled_frame)) * plan.links.size() > kFramesSize)
        frames /= 2;
    return frames;
}

// Without [tool] the record ends before the tool, as in a version 1.6 segment.
std::size_t node_size_of(const SegmentPlan& plan) { return plan.tool ? sizeof(tactiled_node) : TACTILED_NODE_SIZE_1_6; }

// More records with [tool], because a recording reads all of them: 64 ms of a 4 kHz loop.
std::uint32_t node_records_of(const SegmentPlan& plan) { return plan.tool ? 4 * kNodeRecords : kNodeRecords; }

std::size_t array_slot_of(const tactiled_sensor& sensor) {
    return aligned(TACTILED_RECORD_OFFSET + tactiled_array_size(sensor.n_taxels, sensor.taxel_components));
}

// One power of two for all sensors of the link, because they share its ring of raw taxels.
std::uint32_t taxel_slots_of(const SegmentPlan& plan, const tactiled_link& link) {
    const auto sensors = std::ranges::count_if(
        plan.sensors, [&](const tactiled_sensor& sensor) { return std::string_view(sensor.link) == link.name; });
    return plan.array_history * std::bit_ceil(std::max(1u, unsigned(sensors)));
}

// Returns the size of all arrays and raw taxels, with the heads of their rings and the places.
std::size_t arrays_size_of(const SegmentPlan& plan) {
    std::size_t size = 0;
    for (const tactiled_link& link : plan.links)
        if (link.taxels.record_size > 0)
            size +=
                std::size_t(aligned(TACTILED_RECORD_OFFSET + link.taxels.record_size)) * taxel_slots_of(plan, link) + kAlign;
    for (const tactiled_sensor& sensor : plan.sensors)
        if (sensor.n_taxels > 0)
            size += array_slot_of(sensor) * plan.array_history + kAlign + aligned(6 * sizeof(float) * sensor.n_taxels);
    return size;
}

// Returns the size without arrays and the rings of frames.
std::size_t size_of(const SegmentPlan& plan, std::uint32_t history) {
    const std::size_t sensors = plan.sensors.size();
    const std::size_t slot = aligned(TACTILED_RECORD_OFFSET + sizeof(tactiled_placed));
    const std::size_t node_slot = aligned(TACTILED_RECORD_OFFSET + node_size_of(plan));
    return sizeof(tactiled_header) + aligned(sizeof(tactiled_sensor) * sensors) + sizeof(tactiled_link) * plan.links.size() +
           aligned(4 * TACTILED_LATENESS_BUCKETS) + kAlign * (sensors + 1) + node_slot * node_records_of(plan) +
           slot * history * sensors;
}

std::uint32_t history_of(const SegmentPlan& plan) {
    std::uint32_t history = plan.history != 0 ? plan.history : kMaxHistory;
    while (plan.history == 0 && history > kMinHistory && size_of(plan, history) > kPreferredSize) history /= 2;
    return history;
}

Descriptor make_wake_page() {
    Descriptor fd(::memfd_create("tactiled-wake", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (fd >= 0 && (::ftruncate(fd, sizeof(tactiled_wake)) != 0 ||
                    ::fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0))
        fd.reset();
    return fd;
}

// Returns true if a process holds a lock for writing, which a reader cannot take. The lock is queried and not taken, because
// taking it would make a dead writer seem alive to another starting process.
bool is_write_locked(int fd) {
    struct flock whole {};
    whole.l_type = F_RDLCK;
    whole.l_whence = SEEK_SET;
    return ::fcntl(fd, F_OFD_GETLK, &whole) == 0 && whole.l_type != F_UNLCK;
}

constexpr int kPatienceMs = 2'000;  // a start takes milliseconds

// Marks the file of a dead daemon as replaced for its readers, removes its name, and returns its epoch; nullopt if there is
// no file of that name.
std::optional<std::uint32_t> retire_predecessor(const std::string& path) {
    const Descriptor fd(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
    if (fd < 0 && errno == ENOENT) return std::nullopt;
    if (fd < 0)
        throw SetupError(fmt::format("{}: {}: another user owns it; remove it, or choose another [node] name", path,
                                     std::strerror(errno)));
    struct stat status {};
    ::fstat(fd, &status);
    if (status.st_uid != ::geteuid())
        throw SetupError(
            fmt::format("{}: belongs to user {}: remove it, or choose another [node] name", path, status.st_uid));
    tactiled_header old{};
    const bool whole = ::pread(fd, &old, sizeof old, 0) == ssize_t(sizeof old) &&
                       std::memcmp(old.magic, TACTILED_MAGIC, sizeof old.magic) == 0;
    if (is_write_locked(fd))  // the writer is `old.pid`, because a writer locks the file before it gives it a name
        throw SetupError(fmt::format("{}: another daemon of this name runs, pid {}", path, whole ? old.pid : 0));
    if (whole) {
        const std::uint32_t replaced = TACTILED_REPLACED;
        [[maybe_unused]] const auto written = ::pwrite(fd, &replaced, sizeof replaced, offsetof(tactiled_header, state));
    }
    ::unlink(path.c_str());  // the writer is dead and this process holds the start lock, so no other process has replaced
                             // the file
    return whole ? old.epoch : 0;
}

}  // namespace

SegmentWriter::SegmentWriter(const SegmentPlan& plan) : path_(fmt::format("{}/tactiled.{}", runtime_folder(), plan.name)) {
    const std::string folder = path_.substr(0, path_.rfind('/'));
    assert(plan.sensors.size() <= TACTILED_MAX_SENSORS && plan.links.size() <= TACTILED_MAX_LINKS);
    const auto fail = [&](const char* what) -> SetupError {
        const std::string text = fmt::format("{}: {}: {}", path_, what, std::strerror(errno));
        give_back();
        return SetupError(text);
    };
    const std::size_t frame_slot = aligned(TACTILED_RECORD_OFFSET + sizeof(tactiled_frame));
    size_ =
        size_of(plan, history_of(plan)) + (frame_slot * frames_of(plan) + kAlign) * plan.links.size() + arrays_size_of(plan);
    wake_fd_ = make_wake_page();
    void* const page = ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ, MAP_SHARED | MAP_POPULATE, wake_fd_, 0);
    if (wake_fd_ < 0 || page == MAP_FAILED) throw fail("the page of sleeping readers");
    wake_ = static_cast<const tactiled_wake*>(page);
    // Lets a reader order its request for a wake-up against publishing without a fence in the daemon; if refused: see
    // reader.h.
    ::syscall(SYS_membarrier, MEMBARRIER_CMD_REGISTER_GLOBAL_EXPEDITED, 0, 0);

    // The time since boot in units of 17 ms differs from the epoch of each earlier start, also if a clean end left no file.
    auto epoch = std::uint32_t(with_suspend_ns() >> 24);
    // Held from reading the old file until the new file has its name, to serialise daemons that start at the same time. The
    // lock of the segment is not suitable, because a reader may hold a lock on that file. In /dev/shm another user can
    // create the file of this lock; two daemons of one name that start at the same time are then not serialised.
    LockFile start(fmt::format("{}/.tactiled.{}", folder, plan.name));
    if (start.take(kPatienceMs) == LockFile::State::busy) {
        give_back();
        throw SetupError(fmt::format("{}: another daemon of this name is starting", path_));
    }
    for (;;) {
        if (const auto old = retire_predecessor(path_)) epoch = std::max(epoch, *old);
        if (fd_ < 0) {
            fd_.reset(::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
            if (fd_ < 0) throw fail("cannot create");  // EOPNOTSUPP: a file system without unnamed files
            // ftruncate would succeed on a full file system, and the first write would raise SIGBUS.
            if (const int error = ::posix_fallocate(fd_, 0, off_t(size_))) {
                errno = error;
                throw fail("no room for the segment");
            }
            void* map = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_, 0);
            if (map == MAP_FAILED) throw fail("mmap");
            base_ = static_cast<char*>(map);
            lay_out(plan, epoch + 1);
            if (!plan.group.empty()) {
                const group* found = ::getgrnam(plan.group.c_str());
                struct stat made {};  // fchown, which a sandbox may forbid, is called only if the group differs
                if (found == nullptr) errno = ENOENT;  // getgrnam() leaves errno unchanged
                if (found == nullptr || ::fstat(fd_, &made) != 0 ||
                    (made.st_gid != found->gr_gid && ::fchown(fd_, uid_t(-1), found->gr_gid) != 0))
                    throw fail(fmt::format("group {}", plan.group).c_str());
            }
            if (::fchmod(fd_, 0640) != 0) throw fail("chmod");
            if (!lock(fd_)) throw fail("lock");
        }
        header().epoch = epoch + 1;
        const std::string nameless = fmt::format("/proc/self/fd/{}", int(fd_));
        if (::linkat(AT_FDCWD, nameless.c_str(), AT_FDCWD, path_.c_str(), AT_SYMLINK_FOLLOW) == 0) return;
        if (errno != EEXIST) throw fail("cannot name");  // EEXIST: another process has created the name meanwhile
    }
}

SegmentWriter::~SegmentWriter() {
    set_state(TACTILED_STOPPED);
    if (is_still_named(fd_, path_)) ::unlink(path_.c_str());
    give_back();
}

void SegmentWriter::give_back() noexcept {
    if (base_ != nullptr) ::munmap(base_, size_);
    if (wake_ != nullptr) ::munmap(const_cast<tactiled_wake*>(wake_), sizeof *wake_);
}

void SegmentWriter::lay_out(const SegmentPlan& plan, std::uint32_t epoch) {
    tactiled_header& h = header();
    std::memcpy(h.magic, TACTILED_MAGIC, sizeof h.magic);
    h.byte_order = TACTILED_BYTE_ORDER;
    h.major = TACTILED_MAJOR;
    h.minor = TACTILED_MINOR;
    h.header_size = sizeof h;
    h.total_size = std::uint32_t(size_);
    h.epoch = epoch;
    h.pid = std::uint32_t(::getpid());
    const auto put = [](auto& field, const std::string& text) { text.copy(field, sizeof field - 1); };
    put(h.boot_id, boot_id());
    put(h.name, plan.name);
    put(h.version, plan.version);
    put(h.control, plan.control);
    h.watchdog_ms = plan.watchdog_ms;
    h.calibration_id = plan.calibration_id;
    h.n_sensors = std::uint32_t(plan.sensors.size());
    h.n_links = std::uint32_t(plan.links.size());
    h.sensor_size = sizeof(tactiled_sensor);
    h.link_size = sizeof(tactiled_link);

    std::uint32_t at = sizeof h;
    const auto take = [&](std::uint64_t size) { return std::exchange(at, at + aligned(size)); };
    h.sensor_offset = take(sizeof(tactiled_sensor) * plan.sensors.size());
    h.link_offset = take(sizeof(tactiled_link) * plan.links.size());
    h.lateness_offset = take(4 * TACTILED_LATENESS_BUCKETS);
    const auto ring = [&](std::size_t record_size, std::uint32_t slots) {
        tactiled_ring r{};
        r.record_size = std::uint32_t(record_size);
        r.slot_size = aligned(TACTILED_RECORD_OFFSET + record_size);
        r.slots = slots;
        r.head_offset = take(4);
        r.offset = take(std::uint64_t(r.slot_size) * r.slots);
        for (std::uint32_t i = 0; i < r.slots; ++i)  // odd: not readable, because never written
            *reinterpret_cast<std::uint32_t*>(base_ + r.offset + std::size_t(i) * r.slot_size) = 1;
        return r;
    };
    h.node = ring(node_size_of(plan), node_records_of(plan));
    auto* sensors = reinterpret_cast<tactiled_sensor*>(base_ + h.sensor_offset);
    for (std::size_t i = 0; i < plan.sensors.size(); ++i) {
        sensors[i] = plan.sensors[i];
        sensors[i].ring = ring(sizeof(tactiled_placed), history_of(plan));
        sensors[i].age_bound_us = TACTILED_AGE_UNBOUNDED;
        if (sensors[i].n_taxels == 0) continue;
        sensors[i].arrays = ring(tactiled_array_size(sensors[i].n_taxels, sensors[i].taxel_components), plan.array_history);
        sensors[i].taxel_place_offset = take(6 * sizeof(float) * sensors[i].n_taxels);
        std::memcpy(base_ + sensors[i].taxel_place_offset, plan.places[i].data(), 6 * sizeof(float) * sensors[i].n_taxels);
    }
    auto* links = reinterpret_cast<tactiled_link*>(base_ + h.link_offset);
    for (std::size_t i = 0; i < plan.links.size(); ++i) {
        links[i] = plan.links[i];
        links[i].frames = ring(sizeof(tactiled_frame), frames_of(plan));
        if (const std::uint32_t size = plan.links[i].taxels.record_size; size > 0)
            links[i].taxels = ring(size, taxel_slots_of(plan, plan.links[i]));
    }
    assert(at == size_);
    set_state(TACTILED_STARTING);
}

void SegmentWriter::set_state(tactiled_state state) noexcept {
    __atomic_store_n(&header().state, std::uint32_t(state), __ATOMIC_RELEASE);
}

void SegmentWriter::publish(std::uint32_t index, const tactiled_placed& placed) noexcept {
    const auto& sensor = reinterpret_cast<const tactiled_sensor*>(base_ + header().sensor_offset)[index];
    publish_record(base_, sensor.ring, placed.sample.sequence, &placed, sizeof placed);
}

void SegmentWriter::publish(std::uint32_t index, const tactiled_sample& sample) noexcept {
    tactiled_placed placed{};
    placed.sample = sample;
    tactiled_forget_appended(&placed, 0);
    publish(index, placed);
}

void SegmentWriter::publish_array(std::uint32_t index, std::uint64_t sequence, const void* record) noexcept {
    const auto& sensor = reinterpret_cast<const tactiled_sensor*>(base_ + header().sensor_offset)[index];
    publish_record(base_, sensor.arrays, sequence, record, sensor.arrays.record_size);
}

void SegmentWriter::publish_taxels(std::uint32_t index, std::uint64_t number,
                                   std::span<const std::uint64_t> record) noexcept {
    const auto& link = reinterpret_cast<const tactiled_link*>(base_ + header().link_offset)[index];
    publish_record(base_, link.taxels, number, record.data(), record.size_bytes());
}

void SegmentWriter::publish(std::uint32_t index, std::uint64_t number, const Frame& frame) noexcept {
    const auto& link = reinterpret_cast<const tactiled_link*>(base_ + header().link_offset)[index];
    publish_record(base_, link.frames, number, published_part(frame), published_size(frame));
}

void SegmentWriter::publish(const tactiled_node& node) noexcept {
    publish_record(base_, header().node, node.sequence, &node, header().node.record_size);
}

void SegmentWriter::count_lateness(std::uint64_t late_ns) noexcept {
    auto* const count =
        reinterpret_cast<std::uint32_t*>(base_ + header().lateness_offset) + tactiled_lateness_bucket(late_ns);
    __atomic_store_n(count, *count + 1, __ATOMIC_RELAXED);
}

void SegmentWriter::begin_reload() noexcept {
    __atomic_store_n(&header().reloads, header().reloads + 1, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);  // odd before any word of an entry changes
}

void SegmentWriter::set_sensor(std::uint32_t index, const tactiled_sensor& entry) noexcept {
    auto& live = reinterpret_cast<tactiled_sensor*>(base_ + header().sensor_offset)[index];
    tactiled_sensor wanted = entry;
    wanted.ring = live.ring;
    wanted.arrays = live.arrays;
    wanted.taxel_place_offset = live.taxel_place_offset;
    std::copy(std::begin(live.count), std::end(live.count), wanted.count);
    wanted.freshness = live.freshness;
    wanted.age_bound_us = live.age_bound_us;
    static_assert(sizeof wanted % 4 == 0 && alignof(tactiled_sensor) % 4 == 0);
    for (std::size_t at = 0; at < sizeof wanted; at += 4) {  // unchanged bytes are not written
        std::uint32_t word = 0;
        std::memcpy(&word, reinterpret_cast<const char*>(&wanted) + at, 4);
        auto* const there = reinterpret_cast<std::uint32_t*>(reinterpret_cast<char*>(&live) + at);
        if (__atomic_load_n(there, __ATOMIC_RELAXED) != word) __atomic_store_n(there, word, __ATOMIC_RELAXED);
    }
}

void SegmentWriter::end_reload(std::uint32_t calibration_id) noexcept {
    __atomic_store_n(&header().calibration_id, calibration_id, __ATOMIC_RELAXED);
    __atomic_store_n(&header().reloads, header().reloads + 1, __ATOMIC_RELEASE);  // pairs with a reader's acquire
}

int SegmentWriter::wake_readers(int max) noexcept {
    const auto* head = reinterpret_cast<const std::uint32_t*>(base_ + header().node.head_offset);
    const std::uint32_t until = __atomic_load_n(&wake_->wanted_until, __ATOMIC_RELAXED);
    const std::uint32_t ahead = until - __atomic_load_n(head, __ATOMIC_RELAXED);
    if (ahead == 0 || ahead > TACTILED_WAKE_RECORDS) return 0;  // expired, or invalid
    return int(::syscall(SYS_futex, head, FUTEX_WAKE, max, nullptr, nullptr, 0));
}

void SegmentWriter::count_reasons(std::uint32_t index, std::uint32_t reasons) noexcept {
    auto& sensor = reinterpret_cast<tactiled_sensor*>(base_ + header().sensor_offset)[index];
    for (; reasons != 0; reasons &= reasons - 1) {
        std::uint32_t& count = sensor.count[std::countr_zero(reasons)];
        __atomic_store_n(&count, count + 1, __ATOMIC_RELAXED);
    }
}

void SegmentWriter::set_age(std::uint32_t index, std::uint32_t freshness, double bound_ns) noexcept {
    auto& sensor = reinterpret_cast<tactiled_sensor*>(base_ + header().sensor_offset)[index];
    const double bound_us = std::ceil(bound_ns / 1000);
    const bool is_bounded = freshness != TACTILED_FRESHNESS_UNKNOWN && bound_us < double(TACTILED_AGE_UNBOUNDED);
    __atomic_store_n(&sensor.freshness, freshness, __ATOMIC_RELAXED);
    __atomic_store_n(&sensor.age_bound_us, is_bounded ? std::uint32_t(std::max(bound_us, 0.0)) : TACTILED_AGE_UNBOUNDED,
                     __ATOMIC_RELAXED);
}

void SegmentWriter::withdraw_control() noexcept {
    __atomic_store_n(&header().control[0], '\0', __ATOMIC_RELAXED);  // the rest stays: a reader may be copying it
}

void SegmentWriter::set_link_state(std::uint32_t index, tactiled_link_state state) noexcept {
    auto& link = reinterpret_cast<tactiled_link*>(base_ + header().link_offset)[index];
    __atomic_store_n(&link.state, std::uint32_t(state), __ATOMIC_RELAXED);
}

void SegmentWriter::set_link_count(std::uint32_t index, tactiled_link_count kind, std::uint32_t count) noexcept {
    auto& link = reinterpret_cast<tactiled_link*>(base_ + header().link_offset)[index];
    __atomic_store_n(&link.count[kind], count, __ATOMIC_RELAXED);
}

void SegmentWriter::set_link_counts(std::uint32_t index, const std::uint32_t (&count)[TACTILED_LINK_COUNTS]) noexcept {
    auto& link = reinterpret_cast<tactiled_link*>(base_ + header().link_offset)[index];
    for (std::size_t kind = 0; kind < TACTILED_LINK_COUNTS; ++kind)
        if (kind != TACTILED_LINK_UNBOUND) __atomic_store_n(&link.count[kind], count[kind], __ATOMIC_RELAXED);
}

}  // namespace tactiled
