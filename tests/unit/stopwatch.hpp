// A clock for tests whose claim is a bound in time.
#pragma once
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <thread>

namespace tactiled {

// The time that passed, less the time by which this machine delayed a thread that sleeps for 5 ms again and again: a busy
// machine delays the threads that are measured as it delays that one.
class Stopwatch {
public:
    Stopwatch() : began_ns_(now_ns()), due_ns_(began_ns_ + kNap_ns), thread_([this] { run(); }) {}
    Stopwatch(const Stopwatch&) = delete;
    Stopwatch& operator=(const Stopwatch&) = delete;
    ~Stopwatch() {
        ended_ = true;
        thread_.join();
    }

    [[nodiscard]] std::uint64_t ns() const {
        const std::lock_guard lock(mutex_);
        return std::uint64_t(std::min(now_ns(), due_ns_) - began_ns_ - late_ns_);
    }

private:
    static constexpr std::int64_t kNap_ns = 5'000'000;

    static std::int64_t now_ns() {
        return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
            .count();
    }
    void run() {
        while (!ended_) {
            std::this_thread::sleep_for(std::chrono::nanoseconds(kNap_ns));
            const std::lock_guard lock(mutex_);
            const std::int64_t now = now_ns();
            late_ns_ += std::max(std::int64_t{0}, now - due_ns_);
            due_ns_ = now + kNap_ns;
        }
    }

    const std::int64_t began_ns_;
    std::int64_t late_ns_ = 0, due_ns_;
    mutable std::mutex mutex_;  // guards both
    std::atomic<bool> ended_{false};
    std::thread thread_;
};

}  // namespace tactiled
