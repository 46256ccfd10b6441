// stall TID: stops one thread, and no other of its process, until the process dies, by ptrace, like a debugger. To
// other programs the thread seems to hang.
#include <sys/ptrace.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
    const pid_t thread = argc == 2 ? std::atoi(argv[1]) : 0;
    int status = 0;
    if (::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0 || ::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) != 0 ||
        ::waitpid(thread, &status, __WALL) != thread || !WIFSTOPPED(status)) {
        std::perror("stall");
        return 1;
    }
    std::puts("stopped");
    std::fflush(stdout);
    ::waitpid(thread, &status, __WALL);  // its end: the process cannot end until it is waited for
    return 0;
}
