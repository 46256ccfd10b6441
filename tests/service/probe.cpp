// Replaces the daemon under the daemon's unit: tries the actions of an attacker in the daemon's place, and the
// actions that the daemon needs. One line per attempt: NAME ok, or NAME refused REASON.
#include <fcntl.h>
#include <linux/bpf.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>

namespace {

template <class F>
void attempt(const char* name, F&& what) {
    errno = 0;
    if (what())
        std::printf("%s ok\n", name);
    else
        std::printf("%s refused %s\n", name, std::strerror(errno));
}

bool opens(const char* path, int flags) {
    const int fd = ::open(path, flags | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, 0600);
    if (fd >= 0) ::close(fd);
    return fd >= 0;
}

bool binds(int port) {
    const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    const bool bound = fd >= 0 && ::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    const int error = errno;
    if (fd >= 0) ::close(fd);
    errno = error;
    return bound;
}

bool makes_socket(int family, int type) {
    const int fd = ::socket(family, type | SOCK_CLOEXEC, 0);
    if (fd >= 0) ::close(fd);
    return fd >= 0;
}

bool runs(const char* program) {
    const pid_t child = ::fork();
    if (child < 0) return false;
    if (child == 0) {
        ::execl(program, program, "-c", ":", nullptr);
        ::_exit(errno);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    errno = WEXITSTATUS(status);
    return status == 0;
}

}  // namespace

int main() {
    // ---- forbidden actions
    attempt("open_a_disk", [] { return opens("/dev/disk", O_RDONLY); });
    attempt("open_physical_memory", [] { return opens("/dev/mem", O_RDONLY); });
    attempt("write_the_configuration", [] { return opens("/etc/tactiled/tactiled.toml", O_WRONLY); });
    attempt("write_the_programs", [] { return opens("/usr/bin/planted", O_WRONLY | O_CREAT); });
    attempt("read_a_home", [] { return opens("/home/secret", O_RDONLY); });
    attempt("read_the_passwords", [] { return opens("/etc/shadow", O_RDONLY); });
    attempt("read_another_process", [] { return opens("/proc/1/environ", O_RDONLY); });
    attempt("change_the_kernel", [] { return opens("/proc/sys/kernel/core_pattern", O_WRONLY); });
    attempt("run_a_shell", [] { return runs("/bin/sh"); });
    attempt("see_all_packets", [] { return makes_socket(AF_PACKET, SOCK_RAW); });
    attempt("ask_netlink", [] { return makes_socket(AF_NETLINK, SOCK_RAW); });
    attempt("make_raw_packets", [] { return makes_socket(AF_INET, SOCK_RAW); });
    attempt("bind_a_privileged_port", [] { return binds(502); });
    attempt("set_the_clock", [] {
        timespec now{};
        ::clock_gettime(CLOCK_REALTIME, &now);
        return ::clock_settime(CLOCK_REALTIME, &now) == 0;
    });
    attempt("make_a_namespace", [] { return ::unshare(CLONE_NEWUTS) == 0; });
    attempt("make_a_user_namespace", [] { return ::unshare(CLONE_NEWUSER) == 0; });
    attempt("map_memory_to_write_and_run", [] {
        return ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED;
    });
    attempt("trace_a_process", [] { return ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) == 0; });
    attempt("load_a_program_into_the_kernel", [] {
        bpf_attr map{};
        map.map_type = BPF_MAP_TYPE_ARRAY;
        map.key_size = map.value_size = 4;
        map.max_entries = 1;
        return ::syscall(SYS_bpf, BPF_MAP_CREATE, &map, sizeof map) >= 0;
    });
    attempt("mount", [] { return ::mount("none", "/tmp", "tmpfs", 0, nullptr) == 0; });
    attempt("change_the_root", [] { return ::chroot("/tmp") == 0; });
    attempt("become_root", [] { return ::geteuid() != 0 ? ::setuid(0) == 0 : true; });
    attempt("name_the_machine", [] { return ::sethostname("planted", 7) == 0; });
    attempt("make_a_setuid_file", [] {
        const int fd = ::open("/var/lib/tactiled/suid", O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        const bool made = fd >= 0 && ::fchmod(fd, 04755) == 0;
        const int error = errno;
        ::unlink("/var/lib/tactiled/suid");
        errno = error;
        return made;
    });
    // ---- actions that the daemon needs
    attempt("need_a_segment",
            [] { return opens("/dev/shm/tactiled.probe", O_RDWR | O_CREAT) && ::unlink("/dev/shm/tactiled.probe") == 0; });
    attempt("need_its_state",
            [] { return opens("/var/lib/tactiled/probe", O_WRONLY | O_CREAT) && ::unlink("/var/lib/tactiled/probe") == 0; });
    attempt("need_its_socket",
            [] { return opens("/run/tactiled/probe", O_WRONLY | O_CREAT) && ::unlink("/run/tactiled/probe") == 0; });
    attempt("need_a_pty", [] { return opens("/dev/ptmx", O_RDWR); });
    attempt("need_a_serial_port", [] { return opens("/dev/ttyS0", O_RDWR) || errno == EIO || errno == ENXIO; });
    attempt("need_the_modbus_port", [] { return binds(1502); });
    attempt("need_locked_memory", [] { return ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0; });
    attempt("need_real_time", [] {
        sched_param priority{};
        priority.sched_priority = 80;
        return ::sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
    });
    return 0;
}
