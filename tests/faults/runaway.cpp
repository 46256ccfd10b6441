// runaway TID: makes one thread of another program run endlessly without a system call, like a thread in an endless
// loop. It uses ptrace, like a debugger: the next instruction becomes a jump to itself. For x86-64.
#include <sys/ptrace.h>
#include <sys/user.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
    const pid_t thread = argc == 2 ? std::atoi(argv[1]) : 0;
    int status = 0;
    user_regs_struct registers{};
    const auto refused = [] {
        std::perror("runaway");
        return 1;
    };
    if (::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0 || ::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) != 0 ||
        ::waitpid(thread, &status, __WALL) != thread || !WIFSTOPPED(status) ||
        ::ptrace(PTRACE_GETREGS, thread, nullptr, &registers) != 0)
        return refused();
    constexpr long kTwoBytes = 0xFFFF, kJumpToItself = 0xFEEB;
    const long text = ::ptrace(PTRACE_PEEKTEXT, thread, registers.rip, nullptr);
    registers.orig_rax = ~0ull;  // the interrupted system call is not restarted
    if (::ptrace(PTRACE_SETREGS, thread, nullptr, &registers) != 0 ||
        ::ptrace(PTRACE_POKETEXT, thread, registers.rip, (text & ~kTwoBytes) | kJumpToItself) != 0 ||
        ::ptrace(PTRACE_DETACH, thread, nullptr, nullptr) != 0)
        return refused();
    return 0;
}
