#include "node/shm/writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>

namespace tactiled {
namespace {

constexpr char kFolder[] = "/dev/shm";
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

// An open-file-description lock on the whole file says that its writer lives; the kernel drops it with the process.
bool lock(int fd) {
    struct flock whole {};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    return ::fcntl(fd, F_OFD_SETLK, &whole) == 0;
}

bool is_still_named(int fd, const std::string& path) {
    struct stat opened {
    }, named{};
    return ::fstat(fd, &opened) == 0 && ::lstat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
           opened.st_dev == named.st_dev;
}

// Tells the readers of a dead daemon's file that it will not change again, takes its name away, and returns its epoch.
// nullopt when there is no file of that name.
std::optional<std::uint32_t> retire_predecessor(const std::string& path) {
    for (;;) {
        const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
        if (fd < 0 && errno == ENOENT) return std::nullopt;
        if (fd < 0)
            throw SetupError(
                fmt::format("{}: {}: not ours; remove it, or choose another [node] name", path, std::strerror(errno)));
        struct stat status {};
        ::fstat(fd, &status);
        if (status.st_uid != ::geteuid()) {
            ::close(fd);
            throw SetupError(
                fmt::format("{}: belongs to user {}: remove it, or choose another [node] name", path, status.st_uid));
        }
        tactiled_header old{};
        const bool whole = ::pread(fd, &old, sizeof old, 0) == ssize_t(sizeof old) &&
                           std::memcmp(old.magic, TACTILED_MAGIC, sizeof old.magic) == 0;
        if (!lock(fd)) {
            ::close(fd);
            throw SetupError(fmt::format("{}: another daemon of this name runs, pid {}", path, whole ? old.pid : 0));
        }
        if (!is_still_named(fd, path)) {  // its writer went away between our open and our lock
            ::close(fd);
            continue;
        }
        if (whole) {
            const std::uint32_t replaced = TACTILED_REPLACED;
            [[maybe_unused]] const auto written = ::pwrite(fd, &replaced, sizeof replaced, offsetof(tactiled_header, state));
        }
        ::unlink(path.c_str());  // while the lock is held: nobody else can have replaced it
        ::close(fd);
        return whole ? old.epoch : 0;
    }
}

}  // namespace

SegmentWriter::SegmentWriter(const SegmentPlan& plan) : path_(fmt::format("{}/tactiled.{}", kFolder, plan.name)) {
    assert(plan.sensors.size() <= TACTILED_MAX_SENSORS && plan.links.size() <= TACTILED_MAX_LINKS);
    const auto fail = [&](const char* what) -> SetupError {
        const std::string text = fmt::format("{}: {}: {}", path_, what, std::strerror(errno));
        if (base_ != nullptr) ::munmap(base_, size_);
        if (fd_ >= 0) ::close(fd_);
        return SetupError(text);
    };
    const std::uint32_t slot = aligned(TACTILED_RECORD_OFFSET + sizeof(tactiled_sample));
    const std::uint32_t node_slot = aligned(TACTILED_RECORD_OFFSET + sizeof(tactiled_node));
    size_ = sizeof(tactiled_header) + aligned(sizeof(tactiled_sensor) * plan.sensors.size()) +
            sizeof(tactiled_link) * plan.links.size() + std::size_t(kAlign) * (plan.sensors.size() + 1) +
            std::size_t(node_slot) * plan.history + std::size_t(slot) * plan.history * plan.sensors.size();

    // Differs from every earlier start's, also where a clean end left no file to count on from: units of 17 ms since boot.
    timespec now{};
    ::clock_gettime(CLOCK_BOOTTIME, &now);
    auto epoch = std::uint32_t((std::uint64_t(now.tv_sec) * 1'000'000'000u + std::uint64_t(now.tv_nsec)) >> 24);
    for (;;) {
        if (const auto old = retire_predecessor(path_)) epoch = std::max(epoch, *old);
        if (fd_ < 0) {
            fd_ = ::open(kFolder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
            if (fd_ < 0) throw fail("cannot create");
            // Not ftruncate: that succeeds on a full file system and the first write is a SIGBUS.
            if (const int error = ::posix_fallocate(fd_, 0, off_t(size_))) {
                errno = error;
                throw fail("no room in shared memory");
            }
            void* map = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_, 0);
            if (map == MAP_FAILED) throw fail("mmap");
            base_ = static_cast<char*>(map);
            lay_out(plan, epoch + 1);
            if (!plan.group.empty()) {
                const group* found = ::getgrnam(plan.group.c_str());
                if (found == nullptr || ::fchown(fd_, uid_t(-1), found->gr_gid) != 0)
                    throw fail(fmt::format("group {}", plan.group).c_str());
            }
            if (::fchmod(fd_, 0640) != 0) throw fail("chmod");
            if (!lock(fd_)) throw fail("lock");
        }
        header().epoch = epoch + 1;
        const std::string nameless = fmt::format("/proc/self/fd/{}", fd_);
        if (::linkat(AT_FDCWD, nameless.c_str(), AT_FDCWD, path_.c_str(), AT_SYMLINK_FOLLOW) == 0) return;
        if (errno != EEXIST) throw fail("cannot name");  // EEXIST: another daemon was quicker; its lock decides
    }
}

SegmentWriter::~SegmentWriter() {
    set_state(TACTILED_STOPPED);
    if (is_still_named(fd_, path_)) ::unlink(path_.c_str());
    ::munmap(base_, size_);
    ::close(fd_);
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
    const auto ring = [&](std::size_t record_size) {
        tactiled_ring r{};
        r.record_size = std::uint32_t(record_size);
        r.slot_size = aligned(TACTILED_RECORD_OFFSET + record_size);
        r.slots = plan.history;
        r.head_offset = take(4);
        r.offset = take(std::uint64_t(r.slot_size) * r.slots);
        for (std::uint32_t i = 0; i < r.slots; ++i)  // odd: never written, readable by nobody
            *reinterpret_cast<std::uint32_t*>(base_ + r.offset + std::size_t(i) * r.slot_size) = 1;
        return r;
    };
    h.node = ring(sizeof(tactiled_node));
    auto* sensors = reinterpret_cast<tactiled_sensor*>(base_ + h.sensor_offset);
    for (std::size_t i = 0; i < plan.sensors.size(); ++i) {
        sensors[i] = plan.sensors[i];
        sensors[i].ring = ring(sizeof(tactiled_sample));
    }
    std::copy(plan.links.begin(), plan.links.end(), reinterpret_cast<tactiled_link*>(base_ + h.link_offset));
    assert(at == size_);
    set_state(TACTILED_STARTING);
}

void SegmentWriter::set_state(tactiled_state state) noexcept {
    __atomic_store_n(&header().state, std::uint32_t(state), __ATOMIC_RELEASE);
}

void SegmentWriter::publish(const tactiled_ring& ring, std::uint64_t number, const void* record, std::size_t size) noexcept {
#if defined(__SANITIZE_THREAD__)  // thread sanitizer models no fences: order by the stores themselves
    constexpr int kStore = __ATOMIC_RELEASE;
#else
    constexpr int kStore = __ATOMIC_RELAXED;
#endif
    const auto slot = [&](std::uint64_t n) {
        return base_ + ring.offset + std::size_t(n & (ring.slots - 1)) * ring.slot_size;
    };
    auto* lock_word = reinterpret_cast<std::uint32_t*>(slot(number));
    auto* words = reinterpret_cast<std::uint64_t*>(slot(number) + TACTILED_RECORD_OFFSET);
    const auto whole = std::uint32_t(2 * number + 2);
    __atomic_store_n(lock_word, whole - 1, __ATOMIC_RELAXED);
    __atomic_thread_fence(__ATOMIC_RELEASE);    // the odd lock before any word: pairs with the reader's acquire fence
    for (std::size_t i = size / 8; i-- > 0;) {  // the line of the lock last: readers wait on that one
        std::uint64_t word;
        std::memcpy(&word, static_cast<const char*>(record) + 8 * i, 8);
        __atomic_store_n(words + i, word, kStore);
    }
    __atomic_store_n(lock_word, whole, __ATOMIC_RELEASE);  // pairs with the reader's acquire of the lock
    auto* head = reinterpret_cast<std::uint32_t*>(base_ + ring.head_offset);
    __atomic_store_n(head, std::uint32_t(number + 1), __ATOMIC_RELEASE);
    // Open the next slot now: its line is fetched for writing while there is time, not at the next publish.
    __atomic_store_n(reinterpret_cast<std::uint32_t*>(slot(number + 1)), std::uint32_t(2 * number + 3), __ATOMIC_RELAXED);
}

void SegmentWriter::publish(std::uint32_t index, const tactiled_sample& sample) noexcept {
    const auto& sensor = reinterpret_cast<const tactiled_sensor*>(base_ + header().sensor_offset)[index];
    publish(sensor.ring, sample.sequence, &sample, sizeof sample);
}

void SegmentWriter::publish(const tactiled_node& node) noexcept {
    publish(header().node, node.sequence, &node, sizeof node);
}

void SegmentWriter::set_link_state(std::uint32_t index, tactiled_link_state state) noexcept {
    auto& link = reinterpret_cast<tactiled_link*>(base_ + header().link_offset)[index];
    __atomic_store_n(&link.state, std::uint32_t(state), __ATOMIC_RELAXED);
}

void SegmentWriter::set_link_count(std::uint32_t index, tactiled_link_count kind, std::uint32_t count) noexcept {
    auto& link = reinterpret_cast<tactiled_link*>(base_ + header().link_offset)[index];
    __atomic_store_n(&link.count[kind], count, __ATOMIC_RELAXED);
}

}  // namespace tactiled
