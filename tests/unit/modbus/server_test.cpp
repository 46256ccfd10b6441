// The server over real loopback sockets, on a real segment that a writer fills at full speed.
#include "node/modbus/server.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmath>

#include "node/shm/writer.hpp"

namespace tactiled {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::uint16_t free_port() {
    const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), size), 0);
    ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
    ::close(fd);
    return ntohs(address.sin_port);
}

// A client that says just what it is told.
class Client {
public:
    explicit Client(std::uint16_t port, const char* from = "127.0.0.1", int receive_buffer = 0) {
        fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (receive_buffer != 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        ::inet_pton(AF_INET, from, &address.sin_addr);
        ::bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address);
        ::inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
        address.sin_port = htons(port);
        connected_ = ::connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    }
    ~Client() { ::close(fd_); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    bool send(const Bytes& bytes) const {
        return ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == ssize_t(bytes.size());
    }
    int fd() const { return fd_; }
    // One whole answer, or nothing: closed, or silent for `ms`.
    Bytes answer(int ms = 2000) {
        Bytes bytes;
        while (bytes.size() < 6 || bytes.size() < 6u + std::size_t(bytes[4] << 8 | bytes[5])) {
            pollfd p{fd_, POLLIN, 0};
            const std::size_t want =
                bytes.size() < 6 ? 6 - bytes.size() : 6u + std::size_t(bytes[4] << 8 | bytes[5]) - bytes.size();
            std::uint8_t buffer[300];
            if (::poll(&p, 1, ms) != 1) return {};
            const ssize_t size = ::recv(fd_, buffer, want, 0);
            if (size <= 0) {
                closed_ = true;
                return {};
            }
            bytes.insert(bytes.end(), buffer, buffer + size);
        }
        return bytes;
    }
    bool is_closed_within(int ms) {
        const std::uint64_t until = monotonic_ns() + std::uint64_t(ms) * 1'000'000u;
        while (!closed_ && monotonic_ns() < until) (void)answer(10);
        return closed_;
    }

private:
    int fd_ = -1;
    bool connected_ = false, closed_ = false;
};

Bytes read_request(std::uint16_t transaction, std::uint16_t at, std::uint16_t count, std::uint8_t function = 4) {
    return {std::uint8_t(transaction >> 8),
            std::uint8_t(transaction),
            0,
            0,
            0,
            6,
            1,
            function,
            std::uint8_t(at >> 8),
            std::uint8_t(at),
            std::uint8_t(count >> 8),
            std::uint8_t(count)};
}
std::uint16_t register_at(const Bytes& answer, std::size_t i) {
    return std::uint16_t(answer[9 + 2 * i] << 8 | answer[10 + 2 * i]);
}

class ServerTest : public testing::Test {
protected:
    ServerTest() : writer_((fill_plan(), plan_)), port_(free_port()) {
        writer_.set_state(TACTILED_RUNNING);
        publish(0);
    }
    ~ServerTest() override {
        stop_ = true;
        if (flood_.joinable()) flood_.join();
    }
    void fill_plan() {
        plan_.name = "server-test-" + std::to_string(::getpid());
        plan_.history = 64;
        plan_.sensors.resize(2);
        for (auto& s : plan_.sensors) s.stale_ms = 10'000;
    }
    // Frame n: every force of every sensor is n mod 30000, in steps of the register.
    void publish(std::uint64_t n) {
        tactiled_node node{};
        for (std::uint32_t i = 0; i < 2; ++i) {
            tactiled_sample s{};
            s.sequence = n;
            s.t_ns = monotonic_ns();
            s.quality = TACTILED_GOOD;
            for (int k = 0; k < 3; ++k) {
                s.force_S_N[k] = 0.01 * double(n % 30000);
                s.torque_S_Nm[k] = 0.001 * double(n % 30000);
            }
            writer_.publish(i, s);
            node.count[i] = n + 1;
        }
        node.sequence = n;
        node.t_ns = monotonic_ns();
        node.heartbeat = 7;
        node.status = TACTILED_READY;
        writer_.publish(node);
    }
    // The pipeline at 4 kHz, or as fast as it goes.
    void run_pipeline(unsigned pause_us) {
        flood_ = std::thread([this, pause_us] {
            for (std::uint64_t n = 1; !stop_; ++n) {
                publish(n);
                if (pause_us != 0) ::usleep(pause_us);
            }
        });
    }
    std::unique_ptr<ModbusServer> serve(int max_clients = 8, const std::vector<std::string>& allow = {}) {
        ModbusSettings settings{};
        settings.listen = "127.0.0.1:" + std::to_string(port_);
        settings.allow = allow;
        settings.max_clients = max_clients;
        return std::make_unique<ModbusServer>(plan_.name, settings, commands_);
    }

    SegmentPlan plan_;
    SegmentWriter writer_;
    Ring<Command> commands_{16};
    std::uint16_t port_;
    std::thread flood_;
    std::atomic<bool> stop_{false};
};

TEST_F(ServerTest, OneAnswerIsOneFrame) {
    run_pipeline(0);
    const auto server = serve();
    Client client(port_);
    std::uint16_t last = 0;
    int changes = 0;
    for (std::uint16_t i = 0; i < 5000; ++i) {
        ASSERT_TRUE(client.send(read_request(i, 100, 50)));
        const Bytes a = client.answer();
        ASSERT_EQ(a.size(), 9u + 100u);
        ASSERT_EQ(a[0] << 8 | a[1], i);
        const std::uint16_t seq = register_at(a, 0), force = register_at(a, 4);
        changes += seq != last;
        last = seq;
        for (const unsigned at : {24u, 25u, 49u}) ASSERT_EQ(register_at(a, at), seq);
        for (const unsigned at : {5u, 6u, 7u, 8u, 9u, 29u, 30u, 34u}) ASSERT_EQ(register_at(a, at), force);
    }
    EXPECT_GT(changes, 20);  // else the writer stood still and nothing was shown
}

TEST_F(ServerTest, AHangingPipelineShowsSentinelsAndAStandingHeartbeat) {
    const auto server = serve();
    Client client(port_);
    ASSERT_TRUE(client.send(read_request(1, 100, 25)));
    EXPECT_EQ(register_at(client.answer(), 4), 0);  // 0 N, and good
    ::usleep(300'000);                              // longer than watchdog_ms
    ASSERT_TRUE(client.send(read_request(2, 100, 25)));
    const Bytes sensor = client.answer();
    EXPECT_EQ(register_at(sensor, 4), 0x8000);
    EXPECT_EQ(register_at(sensor, 1) & 1, 0);
    ASSERT_TRUE(client.send(read_request(3, 0, 32)));
    const Bytes global = client.answer();
    EXPECT_EQ(register_at(global, 10), 0);       // OK
    EXPECT_EQ(register_at(global, 7) & 1, 0);    // ready
    EXPECT_NE(register_at(global, 7) >> 15, 0);  // fault
    EXPECT_EQ(register_at(global, 5), 7);        // heartbeat
}

TEST_F(ServerTest, AnswersAHundredPipelinedRequestsInOrder) {
    const auto server = serve();
    Client client(port_);
    Bytes all;
    for (std::uint16_t i = 0; i < 100; ++i) {
        const Bytes one = i % 10 == 9 ? read_request(i, 32, 1) : read_request(i, 0, 32);
        all.insert(all.end(), one.begin(), one.end());
    }
    ASSERT_TRUE(client.send(all));
    for (std::uint16_t i = 0; i < 100; ++i) {
        const Bytes a = client.answer();
        ASSERT_GE(a.size(), 9u) << i;
        EXPECT_EQ(a[0] << 8 | a[1], i);
        EXPECT_EQ(a[7], i % 10 == 9 ? 0x84 : 4);
    }
}

TEST_F(ServerTest, ServesByteByByteAndLibmodbusAsAClient) {
    const auto server = serve();
    Client slow(port_);
    for (const auto byte : read_request(5, 0, 2)) {
        ASSERT_TRUE(slow.send({byte}));
        ::usleep(10'000);
    }
    EXPECT_EQ(register_at(slow.answer(), 0), 0x5441);
    modbus_t* context = modbus_new_tcp("127.0.0.1", port_);
    ASSERT_EQ(modbus_connect(context), 0);
    std::uint16_t registers[32];
    EXPECT_EQ(modbus_read_registers(context, 9000, 12, registers), 12);
    EXPECT_EQ(registers[0], 0x1234);
    EXPECT_EQ(modbus_read_input_registers(context, 0, 32, registers), 32);
    EXPECT_EQ(registers[0], 0x5441);
    EXPECT_EQ(modbus_write_register(context, 0, 1), -1);
    EXPECT_EQ(errno, EMBXILADD);
    modbus_close(context);
    modbus_free(context);
}

TEST_F(ServerTest, ABadNeighbourDelaysNobody) {
    run_pipeline(250);
    const auto server = serve();
    Client good(port_), half(port_), drip(port_), garbage(port_), deaf(port_, "127.0.0.1", 2048);
    ASSERT_TRUE(half.send({0, 1, 0, 0, 0, 6, 1}));
    (void)garbage.send(Bytes(200, 0xFF));
    Bytes flood;
    for (std::uint16_t i = 0; i < 2000; ++i) {
        const Bytes one = read_request(i, 100, 125);
        flood.insert(flood.end(), one.begin(), one.end());
    }
    std::thread never_reads([&] { (void)deaf.send(flood); });
    std::uint64_t longest_ns = 0;
    const Bytes request = read_request(0, 0, 32);
    for (int i = 0; i < 600; ++i) {  // 3 s at 200 Hz
        if (i % 40 == 0) (void)drip.send({request[std::size_t(i / 40) % request.size()]});
        const std::uint64_t before = monotonic_ns();
        ASSERT_TRUE(good.send(read_request(std::uint16_t(i), 0, 32)));
        ASSERT_EQ(good.answer().size(), 9u + 64u) << i;
        longest_ns = std::max(longest_ns, monotonic_ns() - before);
        ::usleep(5000);
    }
    EXPECT_LT(longest_ns, 400'000'000u);      // libmodbus' own server makes it wait 20 s; a loaded test machine, tens of ms
    EXPECT_TRUE(half.is_closed_within(100));  // half a request for a second
    EXPECT_TRUE(garbage.is_closed_within(100));  // not Modbus
    EXPECT_TRUE(drip.is_closed_within(100));     // 12 bytes at 5 a second
    EXPECT_GE(server->counts().closed, 4u);      // and the deaf one
    ::shutdown(deaf.fd(), SHUT_RDWR);
    never_reads.join();
}

TEST_F(ServerTest, APollingClientKeepsItsPlaceAndAnIdleOneMakesRoom) {
    const auto server = serve(2);
    Client first(port_), second(port_);
    const auto asks = [&](Client& c) { return c.send(read_request(1, 0, 2)) && !c.answer(500).empty(); };
    EXPECT_TRUE(asks(first));
    EXPECT_TRUE(asks(second));
    Client third(port_);
    EXPECT_FALSE(asks(third));  // both polled within the last second
    for (int i = 0; i < 12; ++i) {
        EXPECT_TRUE(asks(first));
        ::usleep(100'000);
    }
    Client fourth(port_);  // second has been silent for a second
    EXPECT_TRUE(asks(fourth));
    EXPECT_TRUE(asks(first));
    EXPECT_TRUE(second.is_closed_within(500));
}

TEST_F(ServerTest, AFloodOfConnectionsPushesOutOnlyItself) {
    const auto server = serve(4);
    Client plc(port_);
    ASSERT_TRUE(plc.send(read_request(1, 0, 2)));
    ASSERT_FALSE(plc.answer().empty());
    std::vector<std::unique_ptr<Client>> flood;
    for (int i = 0; i < 300; ++i) {  // for longer than a polling client's protection lasts
        flood.push_back(std::make_unique<Client>(port_));
        ::usleep(5000);
    }
    ASSERT_TRUE(plc.send(read_request(2, 0, 2)));
    EXPECT_FALSE(plc.answer().empty()) << "a PLC that polls every 1.5 s lost its place";
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
        EXPECT_LT(cpu_us(end) - cpu_us(start), 150'000);  // does not spin on the client that waits
    }
    ::setrlimit(RLIMIT_NOFILE, &before);
    Client later(port_);  // waits at the port, which stayed ours, for up to a second
    ASSERT_TRUE(later.send(read_request(3, 0, 2)));
    EXPECT_FALSE(later.answer().empty());
}

TEST_F(ServerTest, SettingsThatThePipelineHadNoRoomForAreSentLater) {
    ModbusSettings settings{};
    settings.listen = "127.0.0.1:" + std::to_string(port_);
    settings.max_clients = 2;
    settings.commands = true;
    while (Command* const slot = commands_.claim()) {
        *slot = Command{};
        commands_.push();
    }
    commands_.commit();
    const ModbusServer server(plan_.name, settings, commands_);
    Client client(port_);
    const auto put = [&](std::uint16_t at, std::uint16_t value) {
        const Bytes request = read_request(1, at, value, 6);
        return client.send(request) && client.answer() == request;
    };
    EXPECT_TRUE(put(5090, 0x5AFE));
    EXPECT_TRUE(put(5030, 20));
    while (commands_.front() != nullptr) commands_.pop();
    const Command* sent = nullptr;
    for (int i = 0; i < 50 && (sent = commands_.front()) == nullptr; ++i) ::usleep(10'000);
    ASSERT_NE(sent, nullptr);
    EXPECT_EQ(sent->kind, Command::Kind::set);
    EXPECT_EQ(sent->settable.filter_Hz, 20);
}

TEST_F(ServerTest, WithoutACommandListWhoMayConnectMayWrite) {
    char own[INET_ADDRSTRLEN] = "";  // an address of this machine that is not the loopback
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
}  // namespace tactiled
