// libsuspend.so: preloaded into the release daemon, it moves CLOCK_BOOTTIME ahead of CLOCK_MONOTONIC as a suspended machine
// does. SUSPENDED is a file of one number of 64 bits, the nanoseconds, shared with the test that changes it.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>

namespace {

using Number = std::atomic<std::int64_t>;

Number* share() {
    const char* const path = std::getenv("SUSPENDED");
    const int fd = path != nullptr ? ::open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (fd < 0) return nullptr;
    void* const at = ::mmap(nullptr, sizeof(Number), PROT_READ, MAP_SHARED, fd, 0);
    ::close(fd);
    return at == MAP_FAILED ? nullptr : static_cast<Number*>(at);
}

Number* const suspended_ns = share();  // before main()

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
    if (::syscall(SYS_clock_gettime, clock, time) != 0) return -1;
    if (clock == CLOCK_BOOTTIME && suspended_ns != nullptr) {
        const std::int64_t ns = time->tv_nsec + *suspended_ns;
        time->tv_sec += ns / 1'000'000'000;
        time->tv_nsec = ns % 1'000'000'000;
    }
    return 0;
}
