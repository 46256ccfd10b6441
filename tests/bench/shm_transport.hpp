// Messages of a bench in a segment of shared memory: one ring that is the node ring, too, written and read by the very
// functions of the daemon and of its readers. shm_bench measures it alone, shm_peer beside other transports.
#pragma once
#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <climits>
#include <cstdint>
#include <cstdlib>

#include "node/shm/publish.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::testing {

// Two processes use it: before_fork() in both, init_pub() in the one that publishes, init_sub() in the one that reads.
template <class Message>
class ShmTransport {
public:
    // A planted error: the reader has no head, so that the futex returns at once and the reader polls.
    bool plant_busy_reader = false;

    void before_fork() {
        fd_ = ::memfd_create("bench", 0);
        if (::ftruncate(fd_, kSize) != 0) std::abort();
        writable_ = static_cast<char*>(::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd_, 0));
        wake_ = static_cast<std::uint32_t*>(
            ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0));
        ring_ = {4096, kSlot, kSlots, sizeof(Message), 1024};
        reinterpret_cast<tactiled_header*>(writable_)->node = ring_;
        for (std::uint32_t i = 0; i < kSlots; ++i)
            *reinterpret_cast<std::uint32_t*>(writable_ + ring_.offset + i * kSlot) = 1;
    }
    void init_pub() { ::syscall(SYS_membarrier, MEMBARRIER_CMD_REGISTER_GLOBAL_EXPEDITED, 0, 0); }
    void init_sub() {
        segment_.base = static_cast<const char*>(::mmap(nullptr, kSize, PROT_READ, MAP_SHARED | MAP_POPULATE, fd_, 0));
        segment_.size = kSize;
        if (!plant_busy_reader) segment_.node = ring_;
    }
    template <class F>
    bool publish(F&& fill) {
        Message message;
        fill(&message);
        publish_record(writable_, ring_, number_++, &message, sizeof message);
        const std::uint32_t ahead = __atomic_load_n(wake_, __ATOMIC_RELAXED) - std::uint32_t(number_);  // like SegmentWriter
        if (ahead != 0 && ahead <= TACTILED_WAKE_RECORDS)
            ::syscall(SYS_futex, writable_ + ring_.head_offset, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
        return true;
    }
    template <class F>
    bool try_read(F&& use) {
        Message message;
        if (!tactiled_ring_next(segment_.base, &ring_, &cursor_, &message, sizeof message)) return false;
        use(&message);
        return true;
    }
    template <class F>
    bool wait_read(F&& use, int ms) {
        if (try_read(use)) return true;
        const std::uint64_t now_ns = tactiled_now_ns();
        tactiled_sleep_on_node(&segment_, wake_, cursor_.next, now_ns, now_ns + std::uint64_t(ms) * 1'000'000u);
        return try_read(use);
    }
    template <class F>
    bool predict_read(F&& use, int) {
        const auto learn = [&](const Message* message) {
            use(message);
            const std::uint64_t now_ns = tactiled_now_ns();
            if (rhythm_.last_ns != 0 && now_ns - rhythm_.last_ns < 3'000'000u) tactiled_rhythm_learn(&rhythm_, now_ns);
            rhythm_.last_ns = now_ns;
            spin_until_ns_ = 0;
        };
        for (int i = 0; i < 64; ++i)
            if (try_read(learn)) return true;
        const std::uint64_t now_ns = tactiled_now_ns();
        if (now_ns < spin_until_ns_) return false;
        const std::uint64_t wake_ns = tactiled_rhythm_wake_ns(&rhythm_, now_ns);
        tactiled_sleep_until(wake_ns);
        spin_until_ns_ = wake_ns + 3 * tactiled_rhythm_early_ns(&rhythm_);
        return false;
    }

private:
    static constexpr std::uint32_t kSlots = 1024, kSlot = 384;
    static constexpr std::size_t kSize = 4096 + kSlots * kSlot;
    char* writable_ = nullptr;
    tactiled_segment segment_{};
    std::uint32_t* wake_ = nullptr;
    tactiled_cursor cursor_{};
    tactiled_rhythm rhythm_{};
    std::uint64_t number_ = 0, spin_until_ns_ = 0;
    tactiled_ring ring_{};
    int fd_ = -1;
};

}  // namespace tactiled::testing
