// Work in parts on all processors. The parts do not depend on each other, so the result is the same as in turn.
#pragma once
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace tactiled {

// Calls work(0) .. work(n - 1), each once, unless one of them throws. setup: throws the exception of a part
template <class Work>
void in_parallel(std::size_t n, const Work& work) {
    std::atomic<std::size_t> next{0};
    std::exception_ptr failed;
    std::mutex one;
    const auto run = [&] {
        for (std::size_t i; (i = next++) < n;) {
            try {
                work(i);
            } catch (...) {
                const std::lock_guard lock(one);
                failed = std::current_exception();
                next = n;
            }
        }
    };
    std::vector<std::thread> others;
    for (std::size_t i = 1; i < std::min<std::size_t>(std::thread::hardware_concurrency(), n); ++i) others.emplace_back(run);
    run();
    for (auto& thread : others) thread.join();
    if (failed) std::rethrow_exception(failed);
}

}  // namespace tactiled
