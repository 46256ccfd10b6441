// Driver "tcp": a stream over loopback.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fmt/format.h>

#include "drivers/driver.hpp"

namespace {
thread_local int starved_after_poll_ms = 0;
}
// Instead of the C library's. The calling thread gets no time to run after its wait.
extern "C" int poll(pollfd* watched, nfds_t count, int timeout_ms) {
    const timespec timeout{timeout_ms / 1000, timeout_ms % 1000 * 1'000'000};
    const int ready = ::ppoll(watched, count, timeout_ms < 0 ? nullptr : &timeout, nullptr);
    if (starved_after_poll_ms > 0) ::usleep(useconds_t(starved_after_poll_ms) * 1000);
    return ready;
}

namespace tactiled {
namespace {

class TcpStream : public testing::Test {
protected:
    TcpStream() {
        listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
        EXPECT_EQ(::listen(listener_, 4), 0);
        socklen_t size = sizeof address;
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
        port_ = ::ntohs(address.sin_port);
    }
    ~TcpStream() override { ::close(listener_); }
    std::unique_ptr<Driver> make(const std::string& keys) {
        Options options =
            Options::parse_text(fmt::format("address = \"127.0.0.1:{}\"\n{}", port_, keys), "test.toml", problems_);
        auto driver = Drivers::find("tcp")->make(options);
        options.finish();
        EXPECT_TRUE(problems_.empty()) << problems_.lines().front();
        return driver;
    }
    static std::string heard(int fd, std::size_t size) {
        std::string text(size, 0);
        text.resize(std::size_t(std::max<ssize_t>(0, ::recv(fd, text.data(), size, MSG_WAITALL))));
        return text;
    }

    int listener_;
    unsigned port_ = 0;
    Problems problems_;
};

TEST_F(TcpStream, AKms40IsAskedReadAndStopped) {
    const auto driver = make("format = \"kms40\"");
    ASSERT_EQ(driver->open(), "");
    const int device = ::accept(listener_, nullptr, nullptr);
    EXPECT_EQ(heard(device, 5), "L1()\n");
    const std::string text = "L1\nF={1,2,3,4,5,6},7\n";
    ASSERT_EQ(::send(device, text.data(), text.size(), 0), ssize_t(text.size()));
    Frame frame;
    Status status = Status::timeout;
    for (int i = 0; i < 10 && status == Status::timeout; ++i) status = driver->read(frame, 100);
    ASSERT_EQ(status, Status::frame);
    EXPECT_EQ(frame.channel[5], 6);
    driver->close();
    EXPECT_EQ(heard(device, 5), "L0()\n");
    ::close(device);
}

TEST_F(TcpStream, AConnectionThatEndsIsADisconnectionAndMadeAnew) {
    const auto driver = make("format = \"lines\"\nchannels = 1");
    Frame frame;
    for (int step = 0; step < 3; ++step) {
        ASSERT_EQ(driver->open(), "");
        ::close(::accept(listener_, nullptr, nullptr));
        EXPECT_EQ(driver->read(frame, 1000), Status::disconnected);
    }
    ::close(listener_);
    EXPECT_NE(driver->open().find("no program listens on this port"), std::string::npos);
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
}

// No earlier frame may get a present timestamp; data that wait at the other end are discarded with the connection,
// too.
TEST_F(TcpStream, WhatWaitedWhileTheReaderStoodStillGivesNoFrame) {
    const auto driver = make("format = \"lines\"\nchannels = 1");
    ASSERT_EQ(driver->open(), "");
    const int device = ::accept(listener_, nullptr, nullptr);
    const std::string old = "1\n2\n3\n", fresh = "4\n5\n";
    ASSERT_EQ(::send(device, old.data(), old.size(), 0), ssize_t(old.size()));
    ::usleep(1'050'000);  // longer than 1 s
    Frame frame;
    EXPECT_EQ(driver->read(frame, 1), Status::disconnected);
    EXPECT_FALSE(driver->has_more());
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], old.size());
    ASSERT_EQ(driver->open(), "");
    const int again = ::accept(listener_, nullptr, nullptr);
    ASSERT_EQ(::send(again, fresh.data(), fresh.size(), 0), ssize_t(fresh.size()));
    Status status = Status::timeout;
    for (int i = 0; i < 10 && status == Status::timeout; ++i) status = driver->read(frame, 1000);
    ASSERT_EQ(status, Status::frame);
    EXPECT_EQ(frame.channel[0], 5);  // the first line may have lost its beginning
    ::close(device);
    ::close(again);
}

TEST_F(TcpStream, BytesThatCameWhileTheOpeningThreadHadNoTimeAreThatOld) {
    const auto driver = make("format = \"lines\"\nchannels = 1");
    const std::jthread device([&] {
        const int client = ::accept(listener_, nullptr, nullptr);
        EXPECT_EQ(::send(client, "1\n2\n", 4, 0), 4);
        ::usleep(1'500'000);
        ::close(client);
    });
    starved_after_poll_ms = 400;
    const std::string fault = driver->open();
    starved_after_poll_ms = 0;
    ASSERT_EQ(fault, "");
    Frame frame;
    ASSERT_EQ(driver->read(frame, 50), Status::frame);
    EXPECT_GT(frame.t_ns, frame.since_ns + 350'000'000);
    EXPECT_GT(frame.since_ns, 0u);
}

TEST_F(TcpStream, AReaderThatWaitsInTimeReadsASlowStream) {
    const auto driver = make("format = \"lines\"\nchannels = 1");
    ASSERT_EQ(driver->open(), "");
    const int device = ::accept(listener_, nullptr, nullptr);
    Frame frame;
    ASSERT_EQ(::send(device, "0\n", 2, 0), 2);
    ASSERT_EQ(driver->read(frame, 1000), Status::timeout);
    for (int step = 0; step < 3; ++step) {
        for (int i = 0; i < 3; ++i) ASSERT_EQ(driver->read(frame, 100), Status::timeout);
        ASSERT_EQ(::send(device, "7\n", 2, 0), 2);
        ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    }
    ::close(device);
}

TEST_F(TcpStream, ADeviceThatVanishesWithoutAWordIsDisconnected) {
    const auto driver = make("format = \"lines\"\nchannels = 1");
    ASSERT_EQ(driver->open(), "");
    const int device = ::accept(listener_, nullptr, nullptr);
    ASSERT_EQ(::send(device, "1\n2\n", 4, 0), 4);
    Frame frame;
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    sock_filter nothing{BPF_RET | BPF_K, 0, 0, 0};
    const sock_fprog deaf{1, &nothing};  // a filter that drops all its packets, so that it does not answer
    ASSERT_EQ(::setsockopt(device, SOL_SOCKET, SO_ATTACH_FILTER, &deaf, sizeof deaf), 0);
    Status status = Status::timeout;
    for (int i = 0; i < 40 && status == Status::timeout; ++i) status = driver->read(frame, 500);
    EXPECT_EQ(status, Status::disconnected);
    ::close(device);
}

}  // namespace
}  // namespace tactiled
