// librtguard.so: preloaded into the unchanged release daemon, it detects forbidden actions of a real-time thread
// between rtguard_arm() and rtguard_disarm(): allocations, locks, system calls, page faults. x86-64 Linux >= 5.11.
// README.md explains the method and its limits.
#include <dlfcn.h>
#include <execinfo.h>
#include <linux/futex.h>
#include <pthread.h>
#include <semaphore.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <threads.h>
#include <ucontext.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>

#include "tests/guard/guard.hpp"

#ifndef PR_SET_SYSCALL_USER_DISPATCH
#define PR_SET_SYSCALL_USER_DISPATCH 59
#define PR_SYS_DISPATCH_ON 1
#endif

// Code between these two labels may enter the kernel while a thread is armed. The kernel compares the address after the
// `syscall` instruction, so each one is followed by something. The return is spelt with %rax, as libc's is: by these very
// bytes the unwinder knows a signal's frame and shows who made the system call.
asm(R"(
.text
.globl rtguard_range_begin, rtguard_range_end, rtguard_sigreturn, rtguard_syscall
.hidden rtguard_range_begin, rtguard_range_end, rtguard_sigreturn, rtguard_syscall
rtguard_range_begin:
rtguard_sigreturn:
    mov $15, %rax
    syscall
    ud2
rtguard_syscall:
    mov %rdi, %rax
    mov %rsi, %rdi
    mov %rdx, %rsi
    mov %rcx, %rdx
    mov %r8, %r10
    mov %r9, %r8
    mov 8(%rsp), %r9
    syscall
    ret
    ud2
rtguard_range_end:
)");
extern "C" {
extern char rtguard_range_begin[], rtguard_range_end[];
void rtguard_sigreturn();
long rtguard_syscall(long number, long a, long b, long c, long d, long e, long f);
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void* __libc_valloc(std::size_t);
void* __libc_pvalloc(std::size_t);
void __libc_free(void*);
}

namespace rtguard {
namespace {

constexpr int kThreads = 64, kSyscalls = 512, kFrames = 16;

struct Stack {
    void* address[kFrames];
    int depth;
};

// One line a thread; written by that thread alone, read when the process ends.
struct ThreadReport {
    char name[16];
    bool reads_device;  // may call those of kDeviceCalls
    unsigned long sections;
    unsigned long count[kKinds];
    unsigned long forbidden[kSyscalls], allowed[kSyscalls];
    Stack first[kKinds];
};
ThreadReport reports[kThreads];
std::atomic<int> threads{0};

struct ThreadState {
    char selector = 0;  // read by the kernel at each system call: 0 lets it pass, 1 sends SIGSYS
    bool dispatched = false;
    volatile bool armed = false;
    bool counting = false;  // armed, and the warm-up is over
    ThreadReport* report = nullptr;
    long minor = 0, major = 0;
};
// Initial-exec: the first use of a dynamic thread-local would allocate.
thread_local ThreadState state __attribute__((tls_model("initial-exec")));

// Waiting for a device, reading and asking it: ttys; CAN sockets; I2C and GPIO; Modbus as libmodbus calls. A sleep is
// a wait, too: for the next frame of a recording or a scene.
constexpr int kDeviceCalls[] = {SYS_ppoll,  SYS_read,     SYS_recvmsg,  SYS_recvmmsg, SYS_ioctl,          SYS_write,
                                SYS_select, SYS_pselect6, SYS_recvfrom, SYS_sendto,   SYS_clock_nanosleep};

unsigned long warm_up = 10;

void note(Kind kind) {
    if (!state.armed || !state.counting) return;
    if (state.report->count[kind]++ != 0) return;
    const int error = errno;
    const char selector = state.selector;
    state.armed = false;  // calls by backtrace() are not the program's
    state.selector = 0;
    rusage before, after;
    ::getrusage(RUSAGE_THREAD, &before);
    state.report->first[kind].depth = backtrace(state.report->first[kind].address, kFrames);
    ::getrusage(RUSAGE_THREAD, &after);
    state.minor += after.ru_minflt - before.ru_minflt;
    state.major += after.ru_majflt - before.ru_majflt;
    state.selector = selector;
    state.armed = true;
    errno = error;
}

// These change the caller's own stack, mask or thread, so that they cannot be carried out in its place.
bool must_run_in_place(int number) {
    for (const int each :
         {SYS_rt_sigreturn, SYS_rt_sigprocmask, SYS_sigaltstack, SYS_clone, SYS_clone3, SYS_fork, SYS_vfork})
        if (number == each) return true;
    return false;
}

void on_sigsys(int, siginfo_t* info, void* context) {
    auto* registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
    const int number = info->si_syscall;
    const bool asks_device = state.report->reads_device &&
                             std::find(std::begin(kDeviceCalls), std::end(kDeviceCalls), number) != std::end(kDeviceCalls) &&
                             (number != SYS_write || registers[REG_RDI] > STDERR_FILENO);  // a log line is not a device
    const bool wakes = number == SYS_futex && registers[REG_RSI] == FUTEX_WAKE;  // libc's own have FUTEX_PRIVATE_FLAG
    const bool allowed = asks_device || wakes;
    const int index = number >= 0 && number < kSyscalls ? number : kSyscalls - 1;
    if (state.counting && allowed) ++state.report->allowed[index];
    if (state.counting && !allowed) ++state.report->forbidden[index];
    if (!allowed) note(kSyscall);
    // again, without the guard, and with it the other system calls of this armed section
    if (must_run_in_place(number)) {
        state.selector = 0;
        registers[REG_RAX] = number;
        registers[REG_RIP] -= 2;
        return;
    }
    registers[REG_RAX] = rtguard_syscall(number, registers[REG_RDI], registers[REG_RSI], registers[REG_RDX],
                                         registers[REG_R10], registers[REG_R8], registers[REG_R9]);
}

void install_handler() {
    struct {  // the kernel's own structure: glibc's sigaction would put its sigreturn in place of ours
        void (*handler)(int, siginfo_t*, void*);
        unsigned long flags;
        void (*restorer)();
        unsigned long mask;
    } action{on_sigsys, SA_SIGINFO | SA_NODEFER | 0x04000000UL /* SA_RESTORER */, rtguard_sigreturn, 0};
    if (::syscall(SYS_rt_sigaction, SIGSYS, &action, nullptr, 8L) != 0) std::abort();
}

void print_report() {
    if (threads == 0) return;  // a shell or timeout around the daemon: it must not empty the daemon's report
    const char* path = std::getenv("RTGUARD_REPORT");
    std::FILE* out = path != nullptr ? std::fopen(path, "w") : stderr;
    if (out == nullptr) return;
    for (int t = 0; t < threads; ++t) {
        const ThreadReport& r = reports[t];
        std::fprintf(out, "{\"thread\": \"%s\", \"sections\": %lu", r.name, r.sections);
        for (int k = 0; k < kKinds; ++k) std::fprintf(out, ", \"%s\": %lu", kKindName[k], r.count[k]);
        for (const auto* list : {&r.forbidden, &r.allowed}) {
            std::fprintf(out, ", \"%s\": {", list == &r.forbidden ? "forbidden_calls" : "allowed_calls");
            const char* comma = "";
            for (int n = 0; n < kSyscalls; ++n)
                if ((*list)[n] != 0) std::fprintf(out, "%s\"%d\": %lu", comma, n, (*list)[n]), comma = ", ";
            std::fprintf(out, "}");
        }
        std::fprintf(out, "}\n");
        for (int k = 0; k < kKinds; ++k)
            if (r.count[k] != 0) {
                std::fprintf(stderr, "rtguard: thread %s: first %s:\n", r.name, kKindName[k]);
                backtrace_symbols_fd(r.first[k].address, r.first[k].depth, STDERR_FILENO);
            }
    }
    std::fflush(out);
}

__attribute__((constructor)) void begin() {
    if (const char* text = std::getenv("RTGUARD_WARMUP")) warm_up = std::strtoul(text, nullptr, 10);
    void* once[2];
    backtrace(once, 2);  // loads what it needs now
    install_handler();
}

__attribute__((destructor)) void end() {
    state.armed = false;
    print_report();
    for (int t = 0; t < threads; ++t)
        for (int k = 0; k < kKinds; ++k)
            if (reports[t].count[k] != 0) ::_exit(97);
}

template <class Function>
Function* next(Function*& cache, const char* name) {
    if (cache == nullptr) cache = reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
    return cache;
}

}  // namespace
}  // namespace rtguard

using namespace rtguard;

extern "C" {

void rtguard_thread(const char* name) {
    const int index = threads.fetch_add(1);
    if (index >= kThreads) std::abort();
    state.report = &reports[index];
    for (unsigned i = 0; i < sizeof reports[index]; i += 1024)  // no page fault of the guard's own later
        reinterpret_cast<volatile char*>(state.report)[i] = 0;
    reinterpret_cast<volatile char*>(state.report)[sizeof reports[index] - 1] = 0;
    std::strncpy(state.report->name, name, sizeof state.report->name - 1);
    state.report->reads_device = std::strncmp(name, "link", 4) == 0;
}

void rtguard_arm() {
    if (state.report == nullptr) rtguard_thread("unnamed");
    if (!state.dispatched) {
        state.dispatched = true;
        if (::prctl(PR_SET_SYSCALL_USER_DISPATCH, PR_SYS_DISPATCH_ON, rtguard_range_begin,
                    rtguard_range_end - rtguard_range_begin, &state.selector) != 0)
            std::abort();
    }
    state.counting = ++state.report->sections > warm_up;
    rusage usage;
    ::getrusage(RUSAGE_THREAD, &usage);
    state.minor = usage.ru_minflt;
    state.major = usage.ru_majflt;
    state.armed = true;
    state.selector = 1;
}

void rtguard_disarm() {
    state.selector = 0;
    state.armed = false;
    rusage usage;
    ::getrusage(RUSAGE_THREAD, &usage);
    if (!state.counting) return;
    state.report->count[kMinorFault] += static_cast<unsigned long>(usage.ru_minflt - state.minor);
    state.report->count[kMajorFault] += static_cast<unsigned long>(usage.ru_majflt - state.major);
}

bool rtguard_is_planting_time() { return state.counting && state.report->sections % 500 == 0; }
const char* rtguard_thread_name() { return state.report->name; }

void* malloc(std::size_t size) {
    note(kMalloc);
    return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
    note(kMalloc);
    return __libc_calloc(n, size);
}
void* realloc(void* old, std::size_t size) {
    note(kMalloc);
    return __libc_realloc(old, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
    note(kMalloc);
    return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) { return memalign(alignment, size); }
void* valloc(std::size_t size) {
    note(kMalloc);
    return __libc_valloc(size);
}
void* pvalloc(std::size_t size) {
    note(kMalloc);
    return __libc_pvalloc(size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
    if (alignment % sizeof(void*) != 0 || alignment == 0 || (alignment & (alignment - 1)) != 0) return EINVAL;
    void* memory = memalign(alignment, size);
    if (memory == nullptr) return ENOMEM;
    *out = memory;
    return 0;
}
void free(void* memory) {
    if (memory != nullptr) note(kFree);
    __libc_free(memory);
}

#define GUARDED_LOCK(name, contract, parameters, ...) \
    int name parameters contract {                    \
        static int(*real) parameters = nullptr;       \
        note(kLock);                                  \
        return next(real, #name)(__VA_ARGS__);        \
    }
using Until = const timespec*;
GUARDED_LOCK(pthread_mutex_lock, noexcept, (pthread_mutex_t * m), m)
GUARDED_LOCK(pthread_mutex_trylock, noexcept, (pthread_mutex_t * m), m)
GUARDED_LOCK(pthread_mutex_timedlock, noexcept, (pthread_mutex_t * m, Until t), m, t)
GUARDED_LOCK(pthread_mutex_clocklock, noexcept, (pthread_mutex_t * m, clockid_t c, Until t), m, c, t)
GUARDED_LOCK(pthread_rwlock_rdlock, noexcept, (pthread_rwlock_t * l), l)
GUARDED_LOCK(pthread_rwlock_wrlock, noexcept, (pthread_rwlock_t * l), l)
GUARDED_LOCK(pthread_rwlock_tryrdlock, noexcept, (pthread_rwlock_t * l), l)
GUARDED_LOCK(pthread_rwlock_trywrlock, noexcept, (pthread_rwlock_t * l), l)
GUARDED_LOCK(pthread_rwlock_timedrdlock, noexcept, (pthread_rwlock_t * l, Until t), l, t)
GUARDED_LOCK(pthread_rwlock_timedwrlock, noexcept, (pthread_rwlock_t * l, Until t), l, t)
GUARDED_LOCK(pthread_rwlock_clockrdlock, noexcept, (pthread_rwlock_t * l, clockid_t c, Until t), l, c, t)
GUARDED_LOCK(pthread_rwlock_clockwrlock, noexcept, (pthread_rwlock_t * l, clockid_t c, Until t), l, c, t)
GUARDED_LOCK(pthread_spin_lock, noexcept, (pthread_spinlock_t * l), l)
GUARDED_LOCK(pthread_spin_trylock, noexcept, (pthread_spinlock_t * l), l)
GUARDED_LOCK(pthread_cond_signal, noexcept, (pthread_cond_t * v), v)
GUARDED_LOCK(pthread_cond_broadcast, noexcept, (pthread_cond_t * v), v)
GUARDED_LOCK(pthread_cond_wait, , (pthread_cond_t * v, pthread_mutex_t* m), v, m)
GUARDED_LOCK(pthread_cond_timedwait, , (pthread_cond_t * v, pthread_mutex_t* m, Until t), v, m, t)
GUARDED_LOCK(pthread_cond_clockwait, , (pthread_cond_t * v, pthread_mutex_t* m, clockid_t c, Until t), v, m, c, t)
GUARDED_LOCK(sem_wait, , (sem_t * s), s)
GUARDED_LOCK(sem_trywait, noexcept, (sem_t * s), s)
GUARDED_LOCK(sem_timedwait, , (sem_t * s, Until t), s, t)
GUARDED_LOCK(sem_clockwait, , (sem_t * s, clockid_t c, Until t), s, c, t)
GUARDED_LOCK(sem_post, noexcept, (sem_t * s), s)
GUARDED_LOCK(mtx_lock, , (mtx_t * m), m)
GUARDED_LOCK(mtx_trylock, , (mtx_t * m), m)
GUARDED_LOCK(mtx_timedlock, , (mtx_t * m, Until t), m, t)

}  // extern "C"
