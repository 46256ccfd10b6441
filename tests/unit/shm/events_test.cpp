// A program that uses epoll is notified of each node record, and of none after it has disconnected.
#include "node/shm/events.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>

#include "node/shm/folder.hpp"
#include "node/shm/writer.hpp"

namespace tactiled {
namespace {

class EventsTest : public testing::Test {
protected:
    EventsTest() : writer_(plan()), events_(plan().name, writer_.wake_page()) { writer_.set_state(TACTILED_RUNNING); }
    static SegmentPlan plan() {
        SegmentPlan p;
        p.name = "events-test-" + std::to_string(::getpid());
        p.history = 64;
        p.sensors.resize(1);
        return p;
    }
    // Returns the subscriber's end of a connection, and the descriptor to watch (-1: refused).
    std::pair<int, int> subscribe() {
        int pair[2];
        EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair), 0);
        const int event = events_.subscribe(pair[0]);
        ::close(pair[0]);
        return {pair[1], event};
    }
    void publish(int n) {
        for (int i = 0; i < n; ++i) {
            tactiled_node node{};
            node.sequence = number_++;
            node.t_ns = monotonic_ns();
            writer_.publish(node);
        }
        writer_.wake_readers(INT_MAX);
    }
    static std::uint64_t reported(int event, int ms) {
        std::uint64_t sum = 0, news = 0;
        for (pollfd p{event, POLLIN, 0}; ::poll(&p, 1, ms) == 1 && ::read(event, &news, sizeof news) == sizeof news;)
            sum += news;
        return sum;
    }
    SegmentWriter writer_;
    EventFanOut events_;
    std::uint64_t number_ = 0;
};

static int descriptors() {
    return int(std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator()));
}

TEST_F(EventsTest, EveryRecordIsCounted) {
    const auto [connection, event] = subscribe();
    for (int i = 0; i < 100 && reported(event, 100) == 0; ++i) publish(1);  // until the thread sleeps
    publish(10);                                                            // at once: one wake-up
    EXPECT_EQ(reported(event, 300), 10u);
    ::close(connection);
    ::close(event);
}

TEST_F(EventsTest, WhoDoesNotReadFindsTheTotal) {
    const auto [connection, event] = subscribe();
    for (int i = 0; i < 100 && reported(event, 100) == 0; ++i) publish(1);
    for (int i = 0; i < 500; ++i) {
        publish(1);
        ::usleep(200);
    }
    ::usleep(50'000);
    std::uint64_t sum = 0, news = 0;
    int packets = 0;
    for (; ::read(event, &news, sizeof news) == sizeof news; ++packets) sum += news;
    EXPECT_LT(packets, 20);
    EXPECT_EQ(sum + reported(event, 300), 500u);
    ::close(connection);
    ::close(event);
}

TEST_F(EventsTest, ARecordFromBeforeItsThreadRanIsReportedToo) {
    const auto [connection, event] = subscribe();
    EXPECT_GT(reported(event, 300), 0u);
    ::close(connection);
    ::close(event);
}

TEST_F(EventsTest, WhoIsDisconnectedLeavesNoDescriptor) {
    const int before = descriptors();
    const auto [connection, event] = subscribe();
    // Counts both ends of the pair and, until the daemon's thread has closed it, the descriptor that it sent.
    int with = descriptors();
    for (int i = 0; i < 100 && with != before + 4; ++i) ::usleep(10'000), with = descriptors();
    EXPECT_EQ(with, before + 4);
    ::close(connection);
    std::uint64_t news = 0;
    pollfd p{event, POLLIN, 0};
    for (int i = 0; i < 100 && (p.revents & POLLHUP) == 0; ++i) {
        ::usleep(20'000);
        (void)::poll(&p, 1, 0);
    }
    while (::read(event, &news, sizeof news) == sizeof news) {}
    EXPECT_EQ(::read(event, &news, sizeof news), 0);
    ::close(event);
    EXPECT_EQ(descriptors(), before);
}

TEST_F(EventsTest, NothingThatASubscriberDoesKeepsAnotherFromBeingNotified) {
    const auto [hostile_connection, hostile] = subscribe();
    for (int i = 0; i < 100 && reported(hostile, 100) == 0; ++i) publish(1);
    ASSERT_EQ(::fcntl(hostile, F_SETFL, ::fcntl(hostile, F_GETFL) & ~O_NONBLOCK), 0);
    const std::uint64_t full = ~std::uint64_t(0) - 1;
    (void)!::write(hostile, &full, sizeof full);  // a full eventfd: the next write to it would block
    publish(1);
    ::usleep(50'000);
    const auto [connection, event] = subscribe();
    for (int i = 0; i < 400; ++i) {  // more than any queue can hold
        publish(1);
        ::usleep(200);
    }
    EXPECT_GE(reported(event, 300), 400u);
    for (const int fd : {hostile_connection, hostile, connection, event}) ::close(fd);
}

TEST_F(EventsTest, ASegmentThatCannotBeMappedYetIsTriedAgain) {
    const std::string path = runtime_folder() + "/tactiled." + plan().name;
    ASSERT_EQ(::rename(path.c_str(), (path + "-away").c_str()), 0);
    const auto [connection, event] = subscribe();
    ::usleep(50'000);
    ASSERT_EQ(::rename((path + "-away").c_str(), path.c_str()), 0);
    std::uint64_t sum = 0;
    for (int i = 0; i < 20 && sum == 0; ++i) {
        publish(1);
        sum = reported(event, 50);
    }
    EXPECT_GT(sum, 0u);
    ::close(connection);
    ::close(event);
}

TEST_F(EventsTest, ThereIsRoomForThirtyTwo) {
    std::vector<int> connections;
    for (std::size_t i = 0; i < EventFanOut::kMax; ++i) {
        const auto [connection, event] = subscribe();
        EXPECT_NE(event, -1) << i;
        connections.push_back(connection);
        ::close(event);
    }
    const auto [connection, event] = subscribe();
    EXPECT_EQ(event, -1);
    connections.push_back(connection);
    for (const int c : connections) ::close(c);
}

}  // namespace
}  // namespace tactiled
