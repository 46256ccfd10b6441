// The server's answers to valid and invalid clients.
#include <modbus/modbus.h>

#include <algorithm>
#include <thread>

#include "server_fixture.hpp"
#include "tests/unit/stopwatch.hpp"

namespace tactiled::test {
namespace {

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
    EXPECT_GT(changes, 20);  // otherwise the writer was stopped and the test shows nothing
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
    ASSERT_TRUE(client.send({0, 4, 0, 0, 0, 2, 1, 17}));
    const Bytes id = client.answer();
    ASSERT_GT(id.size(), 10u);
    EXPECT_EQ(id[10], 0);  // the run indicator of the server id
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

TEST_F(ServerTest, TheFunctionsThatLibmodbusDoesNotKnowAreAnswered) {
    const auto server = serve();
    Client client(port_);
    const Bytes query{0, 1, 0, 0, 0, 6, 7, 8, 0, 0, 0xA5, 0x37};
    ASSERT_TRUE(client.send(query));
    EXPECT_EQ(client.answer(), query);
    ASSERT_TRUE(client.send({0, 2, 0, 0, 0, 2, 7, 17}));
    const Bytes id = client.answer();
    ASSERT_GT(id.size(), 12u);
    EXPECT_EQ(id[9], 'T');
    EXPECT_EQ(id[10], 0xFF);  // it runs
    ASSERT_TRUE(client.send({0, 3, 0, 0, 0, 5, 7, 43, 14, 4, 0}));
    const Bytes object = client.answer();
    ASSERT_GT(object.size(), 16u);
    EXPECT_EQ(std::string(object.begin() + 16, object.end()), "tactiled");
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
    const Stopwatch watch;
    const Bytes request = read_request(0, 0, 32);
    for (int i = 0; i < 600; ++i) {  // 3 s at 200 Hz
        if (i % 40 == 0) (void)drip.send({request[std::size_t(i / 40) % request.size()]});
        const std::uint64_t before_ns = watch.ns();
        ASSERT_TRUE(good.send(read_request(std::uint16_t(i), 0, 32)));
        ASSERT_EQ(good.answer().size(), 9u + 64u) << i;
        longest_ns = std::max(longest_ns, watch.ns() - before_ns);
        ::usleep(5000);
    }
    // libmodbus' own server makes it wait 20 s; a loaded test machine, tens of ms
    EXPECT_LT(longest_ns, 400'000'000u);
    EXPECT_TRUE(half.is_closed_within(100));     // half a request for a second
    EXPECT_TRUE(garbage.is_closed_within(100));  // not Modbus
    EXPECT_TRUE(drip.is_closed_within(100));     // 12 bytes at 5 a second
    EXPECT_GE(server->counts().closed, 4u);      // and the client that does not read
    ::shutdown(deaf.fd(), SHUT_RDWR);
    never_reads.join();
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

}  // namespace
}  // namespace tactiled::test
