#include "node/sandbox.hpp"

#include <fmt/format.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <iterator>

namespace tactiled {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kMachine = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kMachine = AUDIT_ARCH_AARCH64;
#elif defined(__arm__) && defined(__ARM_EABI__)
constexpr std::uint32_t kMachine = AUDIT_ARCH_ARM;
#else
constexpr std::uint32_t kMachine = 0;  // The filter was not tested on other processors and is empty there.
#endif

constexpr int kForbidden[] = {
    SYS_execve, SYS_execveat,
    // other processes, and more of the kernel than a daemon needs
    SYS_ptrace, SYS_process_vm_readv, SYS_process_vm_writev, SYS_pidfd_getfd, SYS_memfd_create, SYS_bpf, SYS_perf_event_open,
    SYS_userfaultfd, SYS_io_uring_setup, SYS_io_uring_enter, SYS_io_uring_register,
    // the machine
    SYS_init_module, SYS_finit_module, SYS_delete_module, SYS_kexec_load, SYS_kexec_file_load, SYS_reboot, SYS_swapon,
    SYS_swapoff, SYS_settimeofday, SYS_clock_settime, SYS_clock_adjtime, SYS_adjtimex, SYS_personality,
    // mounts and namespaces
    SYS_mount, SYS_umount2, SYS_move_mount, SYS_mount_setattr, SYS_open_tree, SYS_fsopen, SYS_fspick, SYS_pivot_root,
    SYS_chroot, SYS_unshare, SYS_setns, SYS_open_by_handle_at,
#if defined(__arm__)  // further calls with 16-bit identities or 32-bit times
    SYS_setuid32, SYS_setgid32, SYS_setreuid32, SYS_setregid32, SYS_setresuid32, SYS_setresgid32, SYS_setfsuid32,
    SYS_setfsgid32, SYS_setgroups32, SYS_clock_settime64, SYS_clock_adjtime64,
#endif
    // user, group, capabilities and keys
    SYS_setuid, SYS_setgid, SYS_setreuid, SYS_setregid, SYS_setresuid, SYS_setresgid, SYS_setfsuid, SYS_setfsgid,
    SYS_setgroups, SYS_capset, SYS_add_key, SYS_request_key, SYS_keyctl};

#if defined(__arm__)
constexpr int kMmap = SYS_mmap2;  // The EABI has only mmap2. The protection is its third argument, too.
#else
constexpr int kMmap = SYS_mmap;
#endif

// A call that must not make memory executable. The call is refused if its third argument has all bits of `protection`.
struct Restricted {
    int call;
    std::uint32_t protection;
};
// Only memory mapped from a file, such as a library, may be executable; written memory may not.
constexpr Restricted kRestricted[] = {
    {SYS_mprotect, PROT_EXEC}, {SYS_pkey_mprotect, PROT_EXEC}, {kMmap, PROT_WRITE | PROT_EXEC}};

constexpr sock_filter load(std::size_t at) { return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, std::uint32_t(at)); }
constexpr sock_filter unless_equal(std::uint32_t value, std::uint8_t skip) {
    return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, skip);
}
constexpr sock_filter end_with(std::uint32_t action) { return BPF_STMT(BPF_RET | BPF_K, action); }

// The filter is computed at compile time. For its language see linux/filter.h and seccomp(2).
constexpr auto kFilter = [] {
    constexpr sock_filter refuse = end_with(SECCOMP_RET_ERRNO | EPERM), allow = end_with(SECCOMP_RET_ALLOW);
    constexpr std::size_t third = offsetof(seccomp_data, args) + 2 * sizeof(std::uint64_t);  // its low half: little endian
    std::array<sock_filter, 6 + 2 * std::size(kForbidden) + 6 * std::size(kRestricted) + 1> filter{};
    std::size_t n = 0;
    const auto add = [&](sock_filter step) { filter[n++] = step; };
    add(load(offsetof(seccomp_data, arch)));
    add(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kMachine, 1, 0));
    add(refuse);
    add(load(offsetof(seccomp_data, nr)));
    add(BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, 0x40000000, 0, 1));  // x32 has the same calls with other numbers
    add(refuse);
    for (const int call : kForbidden) {
        add(unless_equal(std::uint32_t(call), 1));
        add(refuse);
    }
    for (const Restricted& each : kRestricted) {
        add(unless_equal(std::uint32_t(each.call), 5));
        add(load(third));
        add(BPF_STMT(BPF_ALU | BPF_AND | BPF_K, each.protection));
        add(unless_equal(each.protection, 1));
        add(refuse);
        add(allow);
    }
    add(allow);
    return filter;
}();

}  // namespace

bool has_system_call_filter() noexcept { return kMachine != 0; }

std::string enter_sandbox() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return "";  // the sanitizers use ptrace on their own process at its end
#else
    if (!has_system_call_filter())
        return "seccomp: no filter of system calls for this processor: the daemon runs without its own sandbox";
    sock_fprog program{std::uint16_t(kFilter.size()), const_cast<sock_filter*>(kFilter.data())};  // only read by the kernel
    long refused = ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    if (refused == 0) refused = ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program);
    if (refused == 0) return "";
    return fmt::format("seccomp: {}: the daemon runs without its own sandbox",
                       refused > 0 ? "a thread has another filter" : std::strerror(errno));
#endif
}

}  // namespace tactiled
