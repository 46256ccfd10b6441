#include "node/realtime.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

#include <cerrno>
#include <cstring>

#include "config/options.hpp"
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace tactiled {
namespace {
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr std::size_t kStackBytes = 8 * 1024 * 1024;  // the sanitizers need additional stack
#else
constexpr std::size_t kStackBytes = 256 * 1024;
#endif
constexpr std::size_t kTouchedBytes = 128 * 1024;

void touch_stack() noexcept {
    volatile unsigned char page[kTouchedBytes];
    for (std::size_t i = 0; i < kTouchedBytes; i += 4096) page[i] = 0;
    (void)page;
}

// Filters that decay to 0 reach denormals, which take a hundred times as long as a normal operation.
void flush_denormals() noexcept {
#if defined(__x86_64__)
    _mm_setcsr(_mm_getcsr() | 0x8040u);  // flush to zero, denormals are zero
#endif
}
}  // namespace

std::string lock_memory() {
    ::mallopt(M_TRIM_THRESHOLD, -1);
    ::mallopt(M_MMAP_MAX, 0);
    ::mallopt(M_ARENA_MAX, 1);  // each further arena would reserve and lock 64 MiB
    if (::mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return "";
    return fmt::format("mlockall: {} (raise LimitMEMLOCK, or set lock_memory = false)", std::strerror(errno));
}

std::string RtThread::start(const char* name, int priority, int cpu, std::function<void()> body) {
    body_ = std::move(body);
    name_ = name;
    has_loop_ = priority > 0;
    pthread_attr_t attributes;
    ::pthread_attr_init(&attributes);
    ::pthread_attr_setstacksize(&attributes, kStackBytes);
    const auto entry = [](void* self) -> void* {
        auto& thread = *static_cast<RtThread*>(self);
        ::prctl(PR_SET_TIMERSLACK, 1);  // has an effect only if SCHED_FIFO was refused
        touch_stack();
        flush_denormals();
        if (rtguard_thread != nullptr && thread.has_loop_) rtguard_thread(thread.name_);
        thread.body_();
        return nullptr;
    };
    const int failed = ::pthread_create(&thread_, &attributes, entry, this);
    ::pthread_attr_destroy(&attributes);
    if (failed != 0) throw SetupError(fmt::format("thread {}: {}", name, std::strerror(failed)));
    running_ = true;
    ::pthread_setname_np(thread_, name);

    std::string refused;
    if (cpu >= 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET(std::size_t(cpu), &set);
        if (const int error = ::pthread_setaffinity_np(thread_, sizeof set, &set))
            refused = fmt::format("CPU {}: {}", cpu, std::strerror(error));
    }
    sched_param parameters{};
    parameters.sched_priority = priority;
    if (priority == 0) return refused;
    if (const int error = ::pthread_setschedparam(thread_, SCHED_FIFO, &parameters))
        refused += fmt::format("{}SCHED_FIFO {}: {} (raise LimitRTPRIO; a cgroup with CPU limits refuses it too)",
                               refused.empty() ? "" : "; ", priority, std::strerror(error));
    return refused;
}

void RtThread::join() noexcept {
    if (running_) ::pthread_join(thread_, nullptr);
    running_ = false;
}

void sleep_until(std::uint64_t deadline_ns) noexcept {
    const timespec deadline{time_t(deadline_ns / 1'000'000'000u), long(deadline_ns % 1'000'000'000u)};
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {}
}

}  // namespace tactiled
