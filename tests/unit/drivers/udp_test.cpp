// Driver "udp": datagrams over loopback. The device has the address 127.0.0.2.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fmt/format.h>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/wire/array_frame.hpp"

namespace tactiled::udp_test {
namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr TaxelShape kShape{4, 2};

// A UDP socket of an address of loopback, with any free port or that one.
class Socket {
public:
    explicit Socket(const char* address, unsigned at = 0) : fd_(::socket(AF_INET, SOCK_DGRAM, 0)) {
        sockaddr_in local = address_of(address, at);
        EXPECT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&local), sizeof local), 0);
        socklen_t size = sizeof local;
        ::getsockname(fd_, reinterpret_cast<sockaddr*>(&local), &size);
        port = ::ntohs(local.sin_port);
    }
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;
    ~Socket() { ::close(fd_); }
    void send(const Bytes& bytes, unsigned to) const {
        const sockaddr_in local = address_of("127.0.0.1", to);
        ASSERT_EQ(::sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&local), sizeof local),
                  ssize_t(bytes.size()));
    }
    // Returns all that has come.
    std::string heard() const {
        std::string all;
        char text[64];
        for (ssize_t n = 0; (n = ::recv(fd_, text, sizeof text, MSG_DONTWAIT)) > 0;) all.append(text, std::size_t(n));
        return all;
    }
    static sockaddr_in address_of(const char* address, unsigned at) {
        sockaddr_in result{};
        result.sin_family = AF_INET;
        result.sin_port = ::htons(std::uint16_t(at));
        ::inet_pton(AF_INET, address, &result.sin_addr);
        return result;
    }
    unsigned port = 0;

private:
    int fd_;
};

unsigned free_port() { return Socket("127.0.0.1").port; }

std::vector<float> values_of(std::uint32_t n, std::size_t size) {
    std::vector<float> values(size);
    for (std::size_t i = 0; i < size; ++i) values[i] = float(n * 100 + i);
    return values;
}

Bytes piece_of(std::uint32_t n, unsigned first, unsigned count, TaxelShape shape = kShape, bool has_time = true) {
    return encode_array_piece({.sequence = n,
                               .time_us = has_time ? std::optional(1000 * n) : std::nullopt,
                               .shape = shape,
                               .first = std::uint16_t(first),
                               .count = std::uint16_t(count)},
                              values_of(n, shape.size()));
}

class UdpTest : public testing::Test {
protected:
    std::unique_ptr<Driver> make(const std::string& keys = "", TaxelShape shape = kShape) {
        Options options =
            Options::parse_text(fmt::format("address = \"127.0.0.2:{}\"\nlisten = {}\ntaxels = {}\nvalues = {}\n{}",
                                            device_.port, listen_, shape.taxels, shape.values, keys),
                                "test.toml", problems_);
        auto driver = Drivers::find("udp")->make(options);
        options.finish();
        EXPECT_TRUE(problems_.empty()) << problems_.lines().front();
        return driver;
    }
    void send(const Bytes& bytes) const { device_.send(bytes, listen_); }
    // Reads until a frame comes.
    static Status read(Driver& driver, Frame& frame, int times = 200) {
        Status status = Status::timeout;
        for (int i = 0; i < times && status == Status::timeout; ++i) status = driver.read(frame, 10);
        return status;
    }
    static std::vector<float> values(const Driver& driver) {
        return {driver.taxels().value.begin(), driver.taxels().value.end()};
    }

    Socket device_{"127.0.0.2"};
    unsigned listen_ = free_port();
    Problems problems_;
};

TEST_F(UdpTest, PutsTheDatagramsOfAFrameTogether) {
    const auto driver = make();
    ASSERT_EQ(driver->open(), "");
    EXPECT_EQ(driver->taxel_shape(), kShape);
    Frame frame;
    for (std::uint32_t n = 0; n < 5; ++n) {
        send(piece_of(n, 1, 3));
        EXPECT_EQ(read(*driver, frame, 3), Status::timeout);
        const std::uint64_t before_ns = now_ns();
        send(piece_of(n, 0, 1));
        ASSERT_EQ(read(*driver, frame), Status::frame);
        EXPECT_EQ(frame.sequence, n);
        EXPECT_EQ(frame.n_channels, 0);
        EXPECT_EQ(frame.device_time_us, 1000 * n);
        EXPECT_GE(frame.t_ns + 1'000'000, before_ns);
        EXPECT_LT(frame.since_ns, before_ns) << "the first piece came before";
        EXPECT_EQ(values(*driver), values_of(n, kShape.size()));
    }
    EXPECT_EQ(driver->counts[TACTILED_LINK_FRAMES], 5u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_LOST], 0u);
}

TEST_F(UdpTest, ABurstIsReadInOrderOneFrameACall) {
    const auto driver = make();
    ASSERT_EQ(driver->open(), "");
    constexpr std::uint32_t kFrames = 48;  // three batches
    for (std::uint32_t n = 0; n < kFrames; ++n)
        for (const unsigned first : {0u, 2u}) send(piece_of(n, first, 2));
    Frame frame;
    unsigned more = 0;
    for (std::uint32_t n = 0; n < kFrames; ++n) {
        ASSERT_EQ(read(*driver, frame), Status::frame);
        EXPECT_EQ(frame.sequence, n);
        EXPECT_EQ(values(*driver), values_of(n, kShape.size()));
        more += driver->has_more() ? 1 : 0;
    }
    EXPECT_GE(more, 40u);
    const std::uint64_t before_ns = now_ns();
    for (int i = 0; i < 2; ++i) EXPECT_EQ(driver->read(frame, 50), Status::timeout);
    EXPECT_GT(now_ns() - before_ns, 40'000'000u) << "it waits again after a full batch";
}

TEST_F(UdpTest, OnlyTheAddressAndPortOfTheDeviceAreHeard) {
    const auto driver = make();
    ASSERT_EQ(driver->open(), "");
    const Socket other_port("127.0.0.2"), other_address("127.0.0.3", device_.port);
    const Bytes false_one = piece_of(9, 0, 4);
    other_port.send(false_one, listen_);
    other_address.send(false_one, listen_);
    send(piece_of(1, 0, 4));
    Frame frame;
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_EQ(frame.sequence, 1u);
    EXPECT_FALSE(driver->has_more());
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], 2 * false_one.size());
    EXPECT_EQ(driver->counts[TACTILED_LINK_BYTES], 3 * false_one.size());
}

TEST_F(UdpTest, DatagramsThatAreNoMessagesAreCounted) {
    const auto driver = make();
    ASSERT_EQ(driver->open(), "");
    Bytes damaged = piece_of(1, 0, 4), twice = piece_of(1, 0, 4);
    damaged[25] ^= 1;
    twice.insert(twice.end(), damaged.begin(), damaged.end());  // longer than any message: the kernel cuts it
    send(damaged);
    send(twice);
    send({});
    send(piece_of(1, 0, 4, {5, 2}));
    send(piece_of(2, 0, 4));
    Frame frame;
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_EQ(frame.sequence, 2u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_BAD_CHECKSUM], 1u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_BAD_LENGTH], 3u);
}

TEST_F(UdpTest, ADatagramThatWaitedHasTheTimeOfItsArrival) {
    const auto driver = make();
    ASSERT_EQ(driver->open(), "");
    Frame frame;
    const std::uint64_t before_ns = now_ns();
    send(piece_of(1, 0, 4));
    const std::uint64_t sent_ns = now_ns();
    ::usleep(150'000);
    send(piece_of(2, 0, 4));
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_GE(frame.t_ns + 1'000'000, before_ns);
    EXPECT_LE(frame.t_ns, sent_ns + 1'000'000);
    EXPECT_GE(frame.taken_ns, frame.t_ns + 140'000'000);
    EXPECT_EQ(frame.since_ns, frame.t_ns);
    EXPECT_EQ(frame.slice_ns, 0u);
    ASSERT_EQ(driver->read(frame, 0), Status::frame);
    EXPECT_GE(frame.t_ns, sent_ns + 140'000'000) << "each one has its own";
}

TEST_F(UdpTest, WhatWaitedWhileTheReaderStoodStillGivesNoFrame) {
    const auto driver = make();
    ASSERT_EQ(driver->open(), "");
    const Bytes old = piece_of(1, 0, 4);
    send(old);
    ::usleep(1'050'000);  // longer than 1 s
    Frame frame;
    EXPECT_EQ(driver->read(frame, 1), Status::disconnected);
    EXPECT_FALSE(driver->has_more());
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], old.size());
    ASSERT_EQ(driver->open(), "");
    send(piece_of(2, 0, 4));
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_EQ(frame.sequence, 2u);
}

std::uint32_t last_request(const Socket& device) {
    std::string text;
    for (int i = 0; i < 1000 && text.empty(); ++i) {
        text = device.heard();
        if (text.empty()) ::usleep(1000);
    }
    const std::size_t at = text.rfind('?');
    EXPECT_TRUE(at != text.npos && text.back() == '\n') << text;
    return at == text.npos ? 0 : std::uint32_t(std::stoul(text.substr(at + 1)));
}

TEST_F(UdpTest, AsksForAnEchoAndGivesTheAnswerToTheNextFrameWithATime) {
    const auto driver = make("echo = true");
    ASSERT_EQ(driver->open(), "");
    EXPECT_TRUE(driver->route().has_echo);
    Frame frame;
    EXPECT_EQ(driver->read(frame, 50), Status::timeout);
    const std::uint32_t number = last_request(device_);
    send(encode_array_echo(0, number + 2, 70));  // another number
    send(piece_of(1, 0, 4));
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_EQ(frame.asked_ns, 0u);
    send(encode_array_echo(0, number, 77));
    send(piece_of(2, 0, 4, kShape, false));
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_EQ(frame.asked_ns, 0u) << "without a time it may have been overtaken";
    send(piece_of(3, 0, 4));
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_GT(frame.asked_ns, 0u);
    EXPECT_LT(frame.asked_ns, frame.t_ns);
    EXPECT_EQ(frame.answered_us, 77u);
    send(piece_of(4, 0, 4));
    ASSERT_EQ(read(*driver, frame), Status::frame);
    EXPECT_EQ(frame.asked_ns, 0u) << "once";
}

// The requests to a port without a program are answered by ICMP.
TEST_F(UdpTest, ADeviceThatIsNotThereIsASilentOne) {
    auto device = std::make_unique<Socket>("127.0.0.4");
    const unsigned port = device->port;
    device.reset();
    Options options = Options::parse_text(
        fmt::format("address = \"127.0.0.4:{}\"\nlisten = {}\ntaxels = 4\nvalues = 2\necho = true", port, listen_),
        "test.toml", problems_);
    const auto driver = Drivers::find("udp")->make(options);
    ASSERT_EQ(driver->open(), "");
    Frame frame;
    for (int i = 0; i < 20; ++i) ASSERT_EQ(driver->read(frame, 10), Status::timeout);
    const Socket again("127.0.0.4", port);
    again.send(piece_of(1, 0, 4), listen_);
    EXPECT_EQ(read(*driver, frame), Status::frame);
}

TEST_F(UdpTest, WhatTheSocketBufferDoesNotHoldIsAnOverrun) {
    constexpr TaxelShape kLarge{4096, 2};
    const auto driver = make("", kLarge);
    ASSERT_EQ(driver->open(), "");
    constexpr std::uint32_t kSent = 2000;
    const auto piece = piece_of(0, 0, 1500, kLarge);  // made once: what waits for a second is dropped
    for (std::uint32_t n = 0; n < kSent; ++n) send(piece);
    Frame frame;
    Status status = Status::timeout;
    std::uint32_t before = 0;
    do {  // until nothing more comes
        before = driver->counts[TACTILED_LINK_BYTES];
        status = driver->read(frame, 10);
    } while (status == Status::timeout && driver->counts[TACTILED_LINK_BYTES] != before);
    EXPECT_EQ(status, Status::timeout);
    driver->close();
    const auto bytes = std::uint32_t(piece.size());
    EXPECT_GT(driver->counts[TACTILED_LINK_OVERRUN], 100u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_OVERRUN] + driver->counts[TACTILED_LINK_BYTES] / bytes, kSent);
}

TEST_F(UdpTest, TheRouteIsANetworkUnlessItIsDeclaredDirect) {
    EXPECT_EQ(make()->route().path, Route::Path::network);
    EXPECT_FALSE(make()->route().reopening_discards);
    EXPECT_EQ(make("path = \"direct\"")->route().path, Route::Path::direct);
    EXPECT_EQ(make("clock_ppm = 50")->route().clock_ppm, 50);
}

TEST_F(UdpTest, APortThatIsTakenIsNamedWithTheRemedy) {
    const Socket other("0.0.0.0", listen_);
    const std::string why = make()->open();
    EXPECT_NE(why.find(fmt::format("UDP port {}", listen_)), std::string::npos) << why;
    EXPECT_NE(why.find("key listen"), std::string::npos) << why;
}

TEST_F(UdpTest, TheKeysAreChecked) {
    for (const auto& [keys, fault] : {std::pair{"address = \"device:5000\"\ntaxels = 4", "should be a numeric address"},
                                      {"address = \"10.0.0.1\"", "taxels"},
                                      {"address = \"10.0.0.1\"\ntaxels = 4\nlisten = 0", "listen = 0 is outside"},
                                      {"address = \"10.0.0.1\"\ntaxels = 4\nformat = \"cobs\"", "format"}}) {
        Problems problems;
        Options options = Options::parse_text(keys, "test.toml", problems);
        (void)Drivers::find("udp")->make(options);
        options.finish();
        ASSERT_EQ(problems.lines().size(), 1u) << keys;
        EXPECT_NE(problems.lines()[0].find(fault), std::string::npos) << problems.lines()[0];
    }
}

}  // namespace
}  // namespace tactiled::udp_test
