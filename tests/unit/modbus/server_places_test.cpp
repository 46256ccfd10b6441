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

TEST_F(ServerTest, AClientThatHasNeverAskedMakesRoomAtOnce) {
    const auto server = serve(2);
    Client asked(port_), silent(port_);
    ASSERT_TRUE(asked.send(read_request(1, 0, 2)));
    ASSERT_FALSE(asked.answer().empty());
    Client later(port_);
    ASSERT_TRUE(later.send(read_request(1, 0, 2)));
    EXPECT_FALSE(later.answer().empty());
    EXPECT_TRUE(silent.is_closed_within(2000));
    ASSERT_TRUE(asked.send(read_request(1, 0, 2)));
    EXPECT_FALSE(asked.answer().empty());
}

TEST_F(ServerTest, IdleClientsThatReconnectAtOnceKeepNoPlcOut) {
    const auto server = serve(24);
    std::atomic<bool> end{false};
    std::atomic<int> connected{0}, again{0};
    std::vector<std::thread> idle;
    for (int i = 0; i < 24; ++i)
        idle.emplace_back([&] {
            while (!end.load()) {
                Client client(port_);
                ++connected;
                while (!end.load() && !client.is_closed_within(20)) {}
                ++again;
            }
        });
    while (connected.load() < 24) ::usleep(1000);
    const auto asks = [](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer(5000).empty(); };
    for (int plc = 0; plc < 5; ++plc) {
        auto client = std::make_unique<Client>(port_);
        // A client that is held up between connecting and asking may be taken for an idle one, and connects again.
        int tries = 1;
        for (; tries < 100 && !asks(*client); ++tries) client = std::make_unique<Client>(port_);
        ASSERT_LT(tries, 100) << "PLC " << plc;
        for (int i = 0; i < 20; ++i) {
            ASSERT_TRUE(asks(*client)) << "PLC " << plc << ", request " << i << ": one that asks was displaced";
            ::usleep(10'000);
        }
    }
    end = true;
    for (std::thread& thread : idle) thread.join();
    EXPECT_GT(again.load(), 24) << "nothing was displaced";
}

// Hosts share the places evenly, whatever their clients do.
TEST_F(ServerTest, OneHostThatPollsOnEveryPlaceLeavesOneToAnother) {
    const auto server = serve(3, {"127.0.0.0/8"});
    const auto asks = [](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer().empty(); };
    std::vector<std::unique_ptr<Client>> many;
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(asks(*many.emplace_back(std::make_unique<Client>(port_))));
    Client plc(port_, "127.0.0.9");
    EXPECT_TRUE(asks(plc));
    EXPECT_TRUE(many[0]->is_closed_within(2000));
    for (int i = 0; i < 5; ++i) {
        Client more(port_);
        EXPECT_FALSE(asks(more)) << "it holds two of three";
        EXPECT_TRUE(asks(plc) && asks(*many[1]) && asks(*many[2]));
    }
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
