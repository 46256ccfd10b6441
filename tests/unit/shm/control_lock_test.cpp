// The lock beside a control socket, and not an answer, shows that its daemon lives.
#include <sys/wait.h>

#include "segment_fixture.hpp"

namespace tactiled {
namespace {

class ControlLockTest : public SegmentTest {
protected:
    ControlLockTest() : control_("/tmp/tactiled-" + name_ + ".sock"), writer_(plan()) {
        writer_.set_state(TACTILED_RUNNING);
    }
    ~ControlLockTest() override {
        ::unlink(control_.c_str());
        ::unlink((control_ + ".lock").c_str());
    }
    std::unique_ptr<ControlSocket> open() {
        return std::make_unique<ControlSocket>(control_, "", name_, writer_, "", commands_);
    }
    bool answers() const {
        std::string why;
        return !ask_daemon(control_, "?", 300, why).empty();
    }
    // Starts another daemon of this socket, in a separate process that was stopped.
    pid_t stopped_daemon() {
        int ready[2];
        EXPECT_EQ(::pipe(ready), 0);
        const pid_t child = ::fork();
        if (child == 0) {
            const auto control = open();
            (void)!::write(ready[1], "1", 1);
            for (;;) ::pause();
        }
        char byte = 0;
        EXPECT_EQ(::read(ready[0], &byte, 1), 1);
        ::close(ready[0]);
        ::close(ready[1]);
        ::kill(child, SIGSTOP);
        ::waitpid(child, nullptr, WUNTRACED);
        return child;
    }
    const std::string control_;
    SegmentWriter writer_;
    CommandRing commands_{4};
};

TEST_F(ControlLockTest, AStoppedDaemonKeepsItsSocket) {
    const pid_t other = stopped_daemon();
    EXPECT_THROW(open(), SetupError);
    ::kill(other, SIGCONT);
    EXPECT_TRUE(answers());
    ::kill(other, SIGKILL);
    ::waitpid(other, nullptr, 0);
    const auto control = open();  // the files of a killed daemon are taken over
    EXPECT_TRUE(answers());
}

TEST_F(ControlLockTest, AnEndRemovesOnlyItsOwnSocket) {
    auto first = open();
    ::unlink(control_.c_str());  // by hand
    ::unlink((control_ + ".lock").c_str());
    const auto second = open();
    first.reset();
    EXPECT_TRUE(answers());
}

TEST_F(ControlLockTest, AnEndLeavesNothing) {
    open().reset();
    EXPECT_NE(::access(control_.c_str(), F_OK), 0);
    EXPECT_NE(::access((control_ + ".lock").c_str(), F_OK), 0);
}

TEST_F(ControlLockTest, AForeignLockFileStopsNoSocket) {
    if (::geteuid() != 0) GTEST_SKIP() << "only root can act as another user";
    const std::string lock_path = control_ + ".lock";
    const int fd = ::open(lock_path.c_str(), O_RDWR | O_CREAT, 0600);
    ASSERT_EQ(::fchown(fd, 65534, 65534), 0);
    ASSERT_TRUE(lock(fd));
    const auto control = open();
    EXPECT_TRUE(answers());
    ::close(fd);
}

}  // namespace
}  // namespace tactiled
