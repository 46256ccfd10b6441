// While an object exists no thread can be started, like in a service that has reached its TasksMax.
#pragma once
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

namespace tactiled::test {

class NoThreads {
public:
    NoThreads() {
        EXPECT_EQ(::getrlimit(RLIMIT_NPROC, &was_), 0);
        const rlimit none{0, was_.rlim_max};
        EXPECT_EQ(::setrlimit(RLIMIT_NPROC, &none), 0);
        if (user_ == 0) { EXPECT_EQ(::setresuid(65534, 65534, 0), 0); }  // root has no such limit
    }
    ~NoThreads() {
        if (user_ == 0) { EXPECT_EQ(::setresuid(0, 0, 0), 0); }
        EXPECT_EQ(::setrlimit(RLIMIT_NPROC, &was_), 0);
    }
    NoThreads(const NoThreads&) = delete;
    NoThreads& operator=(const NoThreads&) = delete;

private:
    const uid_t user_ = ::getuid();
    rlimit was_{};
};

}  // namespace tactiled::test
