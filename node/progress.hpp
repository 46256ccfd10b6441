// Liveness counters of the real-time threads. Each thread counts its cycles. From these counts an observer thread detects a
// thread that makes no progress, because it hangs in the kernel or in an endless loop, or a debugger has stopped it.
#pragma once
#include <atomic>
#include <cstdint>
#include <list>
#include <mutex>
#include <string>
#include <string_view>

namespace tactiled {

class Progress {
    struct Entry {
        std::string name;
        std::uint64_t limit_ns;
        std::atomic<std::uint64_t> cycles{0};
        std::uint64_t seen_cycles = 0, seen_ns = 0;  // used by the observer only
    };

public:
    // The list entry of one thread, for as long as the thread runs.
    class Liveness {
    public:
        // `limit_ns`: a longer cycle counts as a standstill. setup: may wait for a lock
        Liveness(Progress& progress, std::string name, std::uint64_t limit_ns) : progress_(progress) {
            const std::lock_guard lock(progress_.mutex_);
            auto& entry = progress_.entries_.emplace_back();
            entry.name = std::move(name);
            entry.limit_ns = limit_ns;
            entry_ = &entry;
        }
        ~Liveness() {
            const std::lock_guard lock(progress_.mutex_);
            progress_.entries_.remove_if([this](const Entry& e) { return &e == entry_; });
        }
        Liveness(const Liveness&) = delete;
        Liveness& operator=(const Liveness&) = delete;

        // rt: wait-free. One writer, so no read-modify-write.
        void count() noexcept {
            entry_->cycles.store(entry_->cycles.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        }

    private:
        Progress& progress_;
        Entry* entry_;
    };

    // Returns "" if each thread has finished a cycle within its limit, with the resolution of the interval between calls.
    // Otherwise returns the name of the first thread that has not, which is valid until its Liveness ends.
    std::string_view look(std::uint64_t now_ns) noexcept {
        const std::lock_guard lock(mutex_);
        std::string_view stuck;
        for (auto& entry : entries_) {
            const std::uint64_t cycles = entry.cycles.load(std::memory_order_relaxed);
            if (cycles != entry.seen_cycles || entry.seen_ns == 0) {
                entry.seen_cycles = cycles;
                entry.seen_ns = now_ns;
            } else if (now_ns - entry.seen_ns > entry.limit_ns && stuck.empty()) {
                stuck = entry.name;
            }
        }
        return stuck;
    }

private:
    std::mutex mutex_;  // guards the list, which changes when threads begin and end; never taken by count()
    std::list<Entry> entries_;
};

}  // namespace tactiled
