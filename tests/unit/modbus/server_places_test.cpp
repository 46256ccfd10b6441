// The clients that may connect to the server, and those that keep a place if there are few.
#include <ifaddrs.h>
#include <sys/resource.h>

#include "server_fixture.hpp"

namespace tactiled::test {
namespace {

TEST_F(ServerTest, APollingClientKeepsItsPlaceAndAnIdleOneMakesRoom) {
    const auto server = serve(2);
    Client first(port_), second(port_);
    const auto asks = [&](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer(500).empty(); };
    EXPECT_TRUE(asks(first));
    EXPECT_TRUE(asks(second));
    for (int i = 0; i < 2; ++i) {
        ::sleep(2);
        EXPECT_TRUE(asks(first));
    }
    Client third(port_);
    EXPECT_FALSE(asks(third));  // second has been silent for 4 s only
    ::usleep(1'200'000);
    Client fourth(port_);  // and now for more than 5 s
    EXPECT_TRUE(asks(fourth));
    EXPECT_TRUE(asks(first));
    EXPECT_TRUE(second.is_closed_within(500));
}

TEST_F(ServerTest, AClientThatHasNeverAskedKeepsItsPlaceForFiveSeconds) {
    const auto server = serve(1);
    const auto asks = [](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer(500).empty(); };
    Client silent(port_);
    ::sleep(4);
    Client early(port_);
    EXPECT_FALSE(asks(early));
    ::usleep(1'200'000);
    Client later(port_);
    EXPECT_TRUE(asks(later));
    EXPECT_TRUE(silent.is_closed_within(500));
}

TEST_F(ServerTest, AFloodOfConnectionsPushesOutOnlyItself) {
    const auto server = serve(4);
    Client plc(port_);
    std::vector<std::unique_ptr<Client>> flood;
    for (int poll = 0; poll < 5; ++poll) {  // for longer than 5 s
        ASSERT_TRUE(plc.send(read_request(1, 0, 2)));
        ASSERT_FALSE(plc.answer().empty()) << "a PLC that polls every 2 s lost its place";
        for (int i = 0; i < 100; ++i) {
            flood.push_back(std::make_unique<Client>(port_));
            ::usleep(20'000);
        }
    }
}

// This remains possible without `plc`.
TEST_F(ServerTest, ClientsThatPollOnEveryPlaceKeepOthersOutUnlessThoseAreListed) {
    ModbusSettings settings{};
    settings.listen = "127.0.0.1:" + std::to_string(port_);
    settings.max_clients = 2;
    settings.allow = {"127.0.0.0/8"};
    settings.plc = {"127.0.0.9"};
    const ModbusServer server(plan_.name, settings, commands_);
    const auto asks = [](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer(500).empty(); };
    Client one(port_), two(port_);
    for (int i = 0; i < 4; ++i) {
        EXPECT_TRUE(asks(one) && asks(two));
        Client other(port_);
        EXPECT_FALSE(asks(other));
        Client plc(port_, "127.0.0.9");
        EXPECT_TRUE(asks(plc));
        ::sleep(2);
    }
}

TEST_F(ServerTest, RefusesAddressesThatAreNotAllowed) {
    const auto server = serve(8, {"127.0.0.5/32"});
    Client stranger(port_), friendly(port_, "127.0.0.5");
    EXPECT_TRUE(stranger.is_closed_within(1000));
    ASSERT_TRUE(friendly.send(read_request(1, 0, 2)));
    EXPECT_EQ(friendly.answer().size(), 13u);
}

TEST_F(ServerTest, RunningOutOfDescriptorsEndsNobody) {
    const auto server = serve(64);
    Client good(port_);
    ASSERT_TRUE(good.send(read_request(1, 0, 2)));
    ASSERT_FALSE(good.answer().empty());
    rlimit before{};
    ::getrlimit(RLIMIT_NOFILE, &before);
    const int next = ::dup(0);
    ::close(next);
    rlimit few = before;
    few.rlim_cur = rlim_t(next + 1);  // one more: the client's own end
    ::setrlimit(RLIMIT_NOFILE, &few);
    {
        Client refused(port_);
        ::usleep(200'000);
        ASSERT_TRUE(good.send(read_request(2, 0, 2)));
        EXPECT_FALSE(good.answer().empty());
        rusage start{}, end{};
        ::getrusage(RUSAGE_SELF, &start);
        ::usleep(300'000);
        ::getrusage(RUSAGE_SELF, &end);
        const auto cpu_us = [](const rusage& u) {
            return u.ru_utime.tv_sec * 1'000'000 + u.ru_utime.tv_usec + u.ru_stime.tv_sec * 1'000'000 + u.ru_stime.tv_usec;
        };
        EXPECT_LT(cpu_us(end) - cpu_us(start), 150'000);  // does not consume CPU for the client that waits
    }
    ::setrlimit(RLIMIT_NOFILE, &before);
    Client later(port_);  // waits at the port, which remained open, for up to a second
    ASSERT_TRUE(later.send(read_request(3, 0, 2)));
    EXPECT_FALSE(later.answer().empty());
}

TEST_F(ServerTest, WithoutACommandListWhoMayConnectMayWrite) {
    char own[INET_ADDRSTRLEN] = "";  // an address of this machine other than the loopback
    ifaddrs* all = nullptr;
    ASSERT_EQ(::getifaddrs(&all), 0);
    for (const ifaddrs* i = all; i != nullptr; i = i->ifa_next) {
        if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET) continue;
        const in_addr address = reinterpret_cast<const sockaddr_in*>(i->ifa_addr)->sin_addr;
        if (ntohl(address.s_addr) >> 24 != 127) ::inet_ntop(AF_INET, &address, own, sizeof own);
    }
    ::freeifaddrs(all);
    if (*own == 0) GTEST_SKIP() << "no network but the loopback";
    ModbusSettings settings{};
    settings.listen = "127.0.0.1:" + std::to_string(port_);
    settings.max_clients = 2;
    settings.allow = {own};
    settings.commands = true;
    const ModbusServer server(plan_.name, settings, commands_);
    Client client(port_, own);
    const Bytes request = read_request(1, 5023, 7, 6);
    ASSERT_TRUE(client.send(request));
    EXPECT_EQ(client.answer(), request);
}

TEST_F(ServerTest, EachPlcHasPlacesOfItsOwn) {
    ModbusSettings settings{};
    settings.listen = "127.0.0.1:" + std::to_string(port_);
    settings.max_clients = 1;
    settings.plc = {"127.0.0.9", "127.0.0.10"};
    const ModbusServer server(plan_.name, settings, commands_);
    const auto asks = [](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer(500).empty(); };
    std::vector<std::unique_ptr<Client>> first;
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(asks(*first.emplace_back(std::make_unique<Client>(port_, "127.0.0.9"))));
    Client other(port_, "127.0.0.10");
    EXPECT_TRUE(asks(other));
    for (const auto& c : first) EXPECT_TRUE(asks(*c));
}

}  // namespace
}  // namespace tactiled::test
