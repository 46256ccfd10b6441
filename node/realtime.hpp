// The real-time rights of the daemon, and its threads. A refused right is reported and is not fatal: the caller decides.
#pragma once
#include <pthread.h>

#include <cstdint>
#include <functional>
#include <string>

// Defined by the library of tests/guard if it is preloaded; null otherwise. The part of a real-time thread between arm and
// disarm must not allocate, lock, fault or make a system call that is not on its list.
extern "C" {
void rtguard_thread(const char* name) __attribute__((weak));
void rtguard_arm() __attribute__((weak));
void rtguard_disarm() __attribute__((weak));
void rtguard_plant() __attribute__((weak));  // breaks a rule on purpose, to test the guard
}

namespace tactiled {

// The armed part of a loop, as a scope. rt: wait-free
class Armed {
public:
    Armed() noexcept {
        if (rtguard_arm != nullptr) rtguard_arm();
        if (rtguard_plant != nullptr) rtguard_plant();
    }
    ~Armed() {
        if (rtguard_disarm != nullptr) rtguard_disarm();
    }
    Armed(const Armed&) = delete;
    Armed& operator=(const Armed&) = delete;
};

// Locks all memory, present and future, and keeps the heap from returning pages. Returns "", or the refused right with the
// remedy.
std::string lock_memory();

// A thread with a small stack whose pages are touched at the start. The default stack of 8 MiB would be locked completely.
// join() waits until `body` returns.
class RtThread {
public:
    RtThread() = default;
    ~RtThread() { join(); }
    RtThread(const RtThread&) = delete;
    RtThread& operator=(const RtThread&) = delete;

    // Sets SCHED_FIFO at `priority` (0: ordinary scheduling) on `cpu` (-1: any). Returns "" or the refused right; the
    // thread runs in any case.
    // setup: throws SetupError where no thread can be made
    std::string start(const char* name, int priority, int cpu, std::function<void()> body);
    void join() noexcept;

private:
    pthread_t thread_{};
    bool running_ = false, has_loop_ = false;
    std::function<void()> body_;
    const char* name_ = "";
};

// Sleeps until `deadline_ns` of CLOCK_MONOTONIC. rt: blocks, one clock_nanosleep
void sleep_until(std::uint64_t deadline_ns) noexcept;

}  // namespace tactiled
