// Clients of the control socket that send nothing delay and refuse none that asks.
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <atomic>
#include <thread>

#include "segment_fixture.hpp"

namespace tactiled {
namespace {

class ControlPlacesTest : public SegmentTest {
protected:
    ControlPlacesTest() : path_("/tmp/tactiled-" + name_ + ".sock"), writer_(plan()) {
        writer_.set_state(TACTILED_RUNNING);
        control_ = std::make_unique<ControlSocket>(path_, "", name_, writer_, "", commands_, "/the/config");
    }
    ~ControlPlacesTest() override {
        control_.reset();
        ::unlink((path_ + ".lock").c_str());
    }
    // Connects, and waits if the listener has no room.
    Descriptor connect() const {
        Descriptor client(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
        const sockaddr_un address = address_of(path_);
        EXPECT_EQ(::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        return client;
    }
    std::string ask() const {
        std::string why;
        return ask_daemon(path_, name_ + " config-file", 5000, why);
    }
    static bool is_closed(int client) {
        char byte;
        return ::recv(client, &byte, 1, MSG_DONTWAIT) == 0;
    }
    const std::string path_;
    SegmentWriter writer_;
    CommandRing commands_{4};
    std::unique_ptr<ControlSocket> control_;
};

TEST_F(ControlPlacesTest, SilentClientsDelayNoneThatAsks) {
    std::vector<Descriptor> silent;
    for (int i = 0; i < 60; ++i) silent.push_back(connect());
    for (int i = 0; i < 20; ++i) EXPECT_EQ(ask(), "/the/config") << i;
    for (const Descriptor& client : silent) EXPECT_FALSE(is_closed(client)) << "there was room";
    const std::string late = name_ + " config-file";
    char answer[64];
    ASSERT_EQ(::send(silent[0], late.data(), late.size(), 0), ssize_t(late.size()));  // it may ask at any time
    EXPECT_EQ(::recv(silent[0], answer, sizeof answer, 0), 11);
}

TEST_F(ControlPlacesTest, ANewcomerTakesThePlaceOfTheOneThatHasBeenSilentForLongest) {
    std::vector<Descriptor> silent;
    for (int i = 0; i < 70; ++i) silent.push_back(connect());
    EXPECT_EQ(ask(), "/the/config");
    for (std::size_t i = 0; i < silent.size(); ++i) EXPECT_EQ(is_closed(silent[i]), i < 7) << i;  // 64 places
}

TEST_F(ControlPlacesTest, IdleClientsThatReconnectAtOnceRefuseNoRequest) {
    std::atomic<bool> end{false};
    std::atomic<int> again{0};
    std::vector<std::thread> idle;
    for (int i = 0; i < 80; ++i)
        idle.emplace_back([&] {
            while (!end.load()) {
                const Descriptor client = connect();
                pollfd p{client, POLLIN, 0};
                while (!end.load() && ::poll(&p, 1, 20) == 0) {}
                ++again;
            }
        });
    for (int i = 0; i < 100; ++i) EXPECT_EQ(ask(), "/the/config") << i;
    end = true;
    for (std::thread& thread : idle) thread.join();
    EXPECT_GT(again.load(), 80) << "nothing was displaced";
}

}  // namespace
}  // namespace tactiled
