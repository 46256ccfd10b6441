#include "node/sandbox.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <thread>

namespace tactiled {
namespace {

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

// Runs in a child process, because the restrictions are permanent. 0: `act` succeeded in a sandbox and outside of it
// as required.
template <class Act>
int in_sandbox(Act act) {
    const pid_t child = ::fork();
    if (child == 0) {
        if (!enter_sandbox().empty()) ::_exit(100);
        ::_exit(act());
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int run_true() {
    char name[] = "/bin/true";
    char* words[] = {name, nullptr};
    ::execve(name, words, nullptr);
    return errno;
}

// qemu-user offers no seccomp to its programs, so the test is skipped there. A kernel with filters answers 0, or 2 in
// a container that filters.
class Sandbox : public testing::Test {
protected:
    void SetUp() override {
        if (::prctl(PR_GET_SECCOMP, 0, 0, 0, 0) < 0) GTEST_SKIP() << "no seccomp here";
    }
};

TEST(SandboxOfThisProcessor, HasAFilter) { EXPECT_TRUE(has_system_call_filter()); }

TEST_F(Sandbox, RunsNoOtherProgram) { EXPECT_EQ(in_sandbox(run_true), EPERM); }

TEST_F(Sandbox, HoldsForThreadsThatRanBefore) {
    EXPECT_EQ(in_sandbox([] { return 0; }), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        std::atomic<bool> closed{false};
        int said = 0;
        std::thread before([&] {
            while (!closed) {}
            said = run_true();
        });
        if (!enter_sandbox().empty()) ::_exit(100);
        closed = true;
        before.join();
        ::_exit(said);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(WEXITSTATUS(status), EPERM);
}

TEST_F(Sandbox, TracesNobodyAndMakesNoCode) {
    EXPECT_EQ(in_sandbox([] { return ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) == 0 ? 0 : errno; }), EPERM);
    const auto page = [](int protection) { return ::mmap(nullptr, 4096, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0); };
    EXPECT_EQ(in_sandbox([&] { return page(PROT_READ | PROT_WRITE | PROT_EXEC) == MAP_FAILED ? errno : 0; }), EPERM);
    EXPECT_EQ(
        in_sandbox([&] { return ::mprotect(page(PROT_READ | PROT_WRITE), 4096, PROT_READ | PROT_EXEC) == 0 ? 0 : errno; }),
        EPERM);
    EXPECT_EQ(in_sandbox([&] { return ::mprotect(page(PROT_READ | PROT_WRITE), 4096, PROT_READ) == 0 ? 0 : errno; }), 0);
}

TEST_F(Sandbox, NewThreadsAndFilesAreFine) {
    EXPECT_EQ(in_sandbox([] {
                  int done = 1;
                  std::thread([&] { done = 0; }).join();
                  return done + ::access("/proc/self/exe", R_OK);
              }),
              0);
}

#endif

}  // namespace
}  // namespace tactiled
