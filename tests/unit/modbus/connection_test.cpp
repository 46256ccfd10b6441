// One client's bytes, without a server: its answers, and its time limits.
#include "node/modbus/connection.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr std::size_t kAnswer = 259;  // 125 registers

Bytes requests(int n) {
    Bytes bytes;
    for (int i = 0; i < n; ++i) {
        const Bytes one{std::uint8_t(i >> 8), std::uint8_t(i), 0, 0, 0, 6, 1, 4, 0, 100, 0, 125};
        bytes.insert(bytes.end(), one.begin(), one.end());
    }
    return bytes;
}

// A client and the server's end of its connection, with the send buffer that the server sets.
class ConnectionTest : public testing::Test {
protected:
    ConnectionTest() { connect(); }
    ~ConnectionTest() override { ::close(client_); }
    void connect() {
        int pair[2];
        ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
        server_ = pair[0];
        client_ = pair[1];
        set_send_buffer(Connection::kSendBuffer);
    }
    // Sends on the connection last made, as libmodbus does: in one call that does not block.
    const Answer answer = [this](std::span<const std::uint8_t> request) {
        std::array<std::uint8_t, kAnswer> out{};
        std::copy_n(request.begin(), 8, out.begin());
        out[5] = kAnswer - 6;
        const ssize_t sent = ::send(server_, out.data(), out.size(), MSG_NOSIGNAL);
        return sent == ssize_t(out.size()) ? out.size() : 0;
    };
    // Sets the kernel's buffer of the server's end: as near to `bytes` as it allows.
    void set_send_buffer(int bytes) const { ::setsockopt(server_, SOL_SOCKET, SO_SNDBUF, &bytes, sizeof bytes); }
    void say(const Bytes& bytes) const { ASSERT_EQ(::send(client_, bytes.data(), bytes.size(), 0), ssize_t(bytes.size())); }
    std::size_t hear() const {
        std::array<char, 65536> buffer;
        std::size_t total = 0;
        for (ssize_t n; (n = ::recv(client_, buffer.data(), buffer.size(), 0)) > 0;) total += std::size_t(n);
        return total;
    }
    // Returns true if the server would be woken, with the events of ModbusServer.
    bool is_woken(const Connection& connection) const {
        pollfd p{server_, short(connection.interest()), 0};  // EPOLLIN and EPOLLOUT are POLLIN and POLLOUT
        return ::poll(&p, 1, 0) == 1 || connection.backlog_ns() != 0;
    }
    int server_, client_;
};

TEST_F(ConnectionTest, AClientThatPipelinesAndReadsLateGetsEveryAnswer) {
    Connection connection(server_, 1);
    say(requests(340));
    std::size_t heard = 0;
    for (std::uint64_t turn = 1, idle = 0; heard < 340 * kAnswer && idle < 20; ++turn) {
        idle = is_woken(connection) ? 0 : idle + 1;
        if (idle == 0) { ASSERT_STREQ(connection.serve(answer, turn * 1'000'000), ""); }
        if (turn % 15 == 0) heard += hear();  // slower than its socket fills
    }
    EXPECT_EQ(heard, 340 * kAnswer);
}

TEST_F(ConnectionTest, AClientThatHasSaidAllStillGetsItsAnswers) {
    Connection connection(server_, 1);
    say(requests(40));
    ::shutdown(client_, SHUT_WR);
    std::size_t heard = 0;
    std::string why;
    for (std::uint64_t turn = 1; turn < 200 && why.empty(); ++turn) {
        why = connection.serve(answer, turn);
        heard += hear();
    }
    EXPECT_EQ(heard, 40 * kAnswer);
    EXPECT_EQ(why, "closed by the client");
}

TEST_F(ConnectionTest, AboveItsRateAClientWaitsAndLosesNothing) {
    constexpr std::uint64_t kMs = 1'000'000;
    Connection connection(server_, 1, 1000);
    set_send_buffer(1 << 20);
    say(requests(300));
    std::size_t heard = 0;
    std::uint64_t at = 1000 * kMs;
    for (int i = 0; i < 40; ++i) ASSERT_STREQ(connection.serve(answer, at), "");
    heard += hear();
    EXPECT_EQ(heard, 65 * kAnswer);  // the one that is due, and a burst of 64
    EXPECT_GE(connection.backlog_ns(), at);
    for (; heard < 300 * kAnswer && at < 3000 * kMs; at += kMs) {
        ASSERT_STREQ(connection.serve(answer, at), "");
        heard += hear();
    }
    EXPECT_EQ(heard, 300 * kAnswer);
    EXPECT_NEAR(double(at) / kMs, 1000 + 235, 3);  // 1 a millisecond
}

TEST_F(ConnectionTest, WhatIsWrongWithALateClient) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    Connection connection(server_, 1);
    EXPECT_STREQ(connection.overdue(59 * kSecond), "");
    EXPECT_STREQ(connection.overdue(61 * kSecond), "idle");
    say({0, 1, 0, 0, 0, 6, 1});
    (void)connection.serve(answer, 10 * kSecond);
    EXPECT_STREQ(connection.overdue(10 * kSecond + kSecond), "");
    EXPECT_STREQ(connection.overdue(10 * kSecond + kSecond + 1), "half a request for a second");
    say({4, 0, 100, 0, 125});
    (void)connection.serve(answer, 12 * kSecond);
    EXPECT_EQ(hear(), kAnswer);
    EXPECT_STREQ(connection.overdue(14 * kSecond), "");
    say(requests(300));
    for (int i = 0; i < 20; ++i) (void)connection.serve(answer, 20 * kSecond);
    EXPECT_STREQ(connection.overdue(22 * kSecond + 1), "takes no answers");
}

TEST_F(ConnectionTest, AClientThatTakesItsAnswersSlowlyIsNotClosed) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    Connection connection(server_, 1);
    say(requests(340));
    for (int i = 0; i < 20; ++i) (void)connection.serve(answer, 20 * kSecond);
    ASSERT_EQ(connection.interest(), std::uint32_t(EPOLLOUT));
    EXPECT_GT(hear(), 0u);
    // some more is sent, and it is stuck again
    for (int i = 0; i < 20; ++i) (void)connection.serve(answer, 21 * kSecond);
    ASSERT_EQ(connection.interest(), std::uint32_t(EPOLLOUT));
    EXPECT_STREQ(connection.overdue(22 * kSecond + 1), "");
    EXPECT_STREQ(connection.overdue(23 * kSecond + 1), "takes no answers");
}

TEST_F(ConnectionTest, EachRequestHasItsOwnSecond) {
    constexpr std::uint64_t kMs = 1'000'000;
    Connection connection(server_, 1);
    const Bytes one = requests(1);
    const Bytes first(one.begin(), one.begin() + 5), rest(one.begin() + 5, one.end());
    say(first);
    (void)connection.serve(answer, 1000 * kMs);
    for (std::uint64_t at = 1600 * kMs; at < 4000 * kMs; at += 600 * kMs) {  // ends one, begins the next
        say(rest);
        say(first);
        (void)connection.serve(answer, at);
        EXPECT_EQ(hear(), kAnswer);
        EXPECT_STREQ(connection.overdue(at + 999 * kMs), "");
    }
}

TEST_F(ConnectionTest, WhoIsHeldBackIsNotIdle) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    Connection connection(server_, 1, 1);  // a request a second
    set_send_buffer(1 << 20);
    say(requests(200));
    for (int i = 0; i < 20; ++i) (void)connection.serve(answer, 100 * kSecond);
    ASSERT_NE(connection.backlog_ns(), 0u);
    EXPECT_STREQ(connection.overdue(161 * kSecond), "");
}

TEST_F(ConnectionTest, ForAClientThatTakesNoAnswersFewAreMade) {
    Connection connection(server_, 1);
    int asked = 0;
    const auto counted = [&](std::span<const std::uint8_t> request) {
        ++asked;
        return answer(request);
    };
    say(requests(340));
    for (int i = 0; i < 100; ++i) ASSERT_STREQ(connection.serve(counted, 1), "");
    EXPECT_LT(asked, 150);  // a third of the buffer is never used
    EXPECT_EQ(connection.interest(), std::uint32_t(EPOLLOUT));
    EXPECT_EQ(connection.backlog_ns(), 0u);
}

TEST_F(ConnectionTest, AnAnswerThatIsNotTakenWholeEndsTheConnection) {
    for (const std::size_t taken : {std::size_t(0), kAnswer}) {
        ASSERT_NO_FATAL_FAILURE(connect());
        Connection connection(server_, 1);
        int asked = 0;
        say(requests(3));
        const char* const why = connection.serve(
            [&](std::span<const std::uint8_t>) {
                ++asked;
                return taken;
            },
            1);
        EXPECT_STREQ(why, taken == 0 ? "takes no answers" : "");
        EXPECT_EQ(asked, taken == 0 ? 1 : 3);
        ::close(client_);
    }
    client_ = ::dup(0);  // for the destructor
}

TEST_F(ConnectionTest, AClientThatAsksOneByOneAndNeverReadsIsDroppedWhenItsSocketIsFull) {
    Connection connection(server_, 1);
    std::string why;
    int asked = 0;
    for (; why.empty() && asked < 5000; ++asked) {
        say(requests(1));
        why = connection.serve(answer, 1);
    }
    EXPECT_EQ(why, "takes no answers");
    EXPECT_LT(asked, 1000);
}

TEST_F(ConnectionTest, AClientThatIsDisconnectedIsNoticedWhileItIsReadAndWhileItIsAnswered) {
    {
        Connection connection(server_, 1);
        say(requests(1));
        ASSERT_STREQ(connection.serve(answer, 1), "");
        ::close(client_);  // with an answer that it has not read: a reset
        EXPECT_STREQ(connection.serve(answer, 2), "connection broken");
    }
    for (const int n : {1, 340}) {  // disconnected before its answer, and with some of them on the way
        ASSERT_NO_FATAL_FAILURE(connect());
        Connection connection(server_, 1);
        say(requests(n));
        for (int i = 0; n > 1 && i < 5; ++i) ASSERT_STREQ(connection.serve(answer, 1), "");
        (void)hear();
        ::close(client_);
        EXPECT_STREQ(connection.serve(answer, 2), "takes no answers") << n;
    }
    client_ = ::dup(0);  // for the destructor
}

TEST_F(ConnectionTest, IsReadOnlyWhileItHasSomethingToSayAndTakesItsAnswers) {
    Connection connection(server_, 1);
    EXPECT_EQ(connection.interest(), std::uint32_t(EPOLLIN));
    say(requests(340));
    for (int i = 0; i < 20; ++i) (void)connection.serve(answer, 1);
    EXPECT_EQ(connection.interest(), std::uint32_t(EPOLLOUT));
    EXPECT_STREQ(connection.overdue(2'000'000'002), "takes no answers");
    for (int i = 0; i < 200; ++i) {
        (void)hear();
        (void)connection.serve(answer, 1);
    }
    EXPECT_EQ(connection.interest(), std::uint32_t(EPOLLIN));
    say({0, 1, 0, 0, 0, 6, 1});  // half a request, and no more
    ::shutdown(client_, SHUT_WR);
    (void)connection.serve(answer, 1);
    (void)connection.serve(answer, 1);
    EXPECT_EQ(connection.interest(), 0u);
}

TEST_F(ConnectionTest, WhatIsNoModbusEndsItAfterWhatIsOwed) {
    Connection connection(server_, 1);
    Bytes bytes = requests(2);
    bytes.insert(bytes.end(), {0, 1, 0x50, 0x4F, 0, 6, 1, 3, 0, 0, 0, 1});  // another protocol
    say(bytes);
    EXPECT_STREQ(connection.serve(answer, 1), "not Modbus/TCP");
    EXPECT_EQ(hear(), 2 * kAnswer);
}

TEST_F(ConnectionTest, AFullBufferIsAnsweredBeforeMoreIsRead) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    Connection connection(server_, 1, 1);  // a request a second
    set_send_buffer(1 << 20);
    say(requests(5000));
    for (int i = 0; i < 200; ++i) ASSERT_STREQ(connection.serve(answer, 100 * kSecond), "");
    EXPECT_EQ(connection.interest(), 0u);  // its own buffer is full, and the next is not yet due
    EXPECT_EQ(hear(), 65 * kAnswer);
}

}  // namespace
}  // namespace tactiled::modbus
