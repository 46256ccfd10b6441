// The modbus driver over a pty and over loopback. The test is the slave: it takes each request and answers.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <pty.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <termios.h>
#include <unistd.h>

#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/driver.hpp"
#include "drivers/tcp.hpp"
#include "drivers/wire/modbus_message.hpp"

static std::function<void()> after_send;  // called once, before the call returns to the sender

extern "C" ssize_t send(int fd, const void* bytes, size_t size, int flags) {
    const ssize_t sent = ::syscall(SYS_sendto, fd, bytes, size, flags, nullptr, 0);
    if (const auto then = std::exchange(after_send, nullptr)) then();
    return sent;
}

namespace tactiled {
namespace {

using Bytes = std::vector<std::uint8_t>;
const std::string kValues = R"(registers = [{name = "a", at = 10}, {name = "b", at = 11}])";

class Slave : public testing::Test {
protected:
    ~Slave() override {
        driver_.reset();
        for (const int fd : {end_, other_, listener_})
            if (fd >= 0) ::close(fd);
    }
    void make(const std::string& link, const std::string& slaves) {
        Options options = Options::parse_text(link + "\n" + slaves, "test.toml", problems_);
        driver_ = Drivers::find("modbus")->make(options);
        options.finish();
        EXPECT_TRUE(problems_.empty()) << problems_.lines().front();
    }
    void open_pty(const std::string& link, const std::string& slaves) {
        char name[128];
        ASSERT_EQ(::openpty(&end_, &other_, name, nullptr, nullptr), 0);
        make(fmt::format("device = \"{}\"\nbaud = 115200\n{}", name, link), slaves);
        ASSERT_EQ(driver_->open(), "");
    }
    void listen_tcp() {
        listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
        ASSERT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
        ASSERT_EQ(::listen(listener_, 4), 0);
        socklen_t size = sizeof address;
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
        port_ = ::ntohs(address.sin_port);
    }
    void open_connection(const std::string& link, const std::string& slaves) {
        listen_tcp();
        make(fmt::format("address = \"127.0.0.1:{}\"\n{}", port_, link), slaves);
        ASSERT_EQ(driver_->open(), "");
        end_ = ::accept(listener_, nullptr, nullptr);
    }
    // Returns the driver's next request, which read() sends; read() has no frame yet.
    Bytes request() {
        Bytes bytes(64);
        for (int i = 0; i < 500; ++i) {
            EXPECT_EQ(driver_->read(frame_, 1), Status::timeout);
            pollfd waiting{end_, POLLIN, 0};
            if (::poll(&waiting, 1, 1) == 0) continue;
            bytes.resize(std::size_t(std::max<ssize_t>(0, ::read(end_, bytes.data(), bytes.size()))));
            return bytes;
        }
        ADD_FAILURE() << "no request came";
        return {};
    }
    void send(Bytes bytes) {
        ASSERT_EQ(::write(end_, bytes.data(), bytes.size()), ssize_t(bytes.size()));
        ::usleep(3000);  // a pty passes bytes on in a kernel thread
    }
    static Bytes rtu(Bytes bytes) {
        const std::uint16_t crc = modbus_crc(bytes);
        bytes.push_back(std::uint8_t(crc));
        bytes.push_back(std::uint8_t(crc >> 8));
        return bytes;
    }
    static Bytes two(std::uint8_t a, std::uint8_t b) { return rtu({1, 3, 4, 0, a, 0, b}); }
    static Bytes one(std::uint8_t a) { return rtu({1, 3, 2, 0, a}); }
    static Bytes ask(std::uint8_t at, std::uint8_t count, std::uint8_t unit = 1) { return rtu({unit, 3, 0, at, 0, count}); }
    static Bytes tcp(const Bytes& request, Bytes body) {
        Bytes bytes{request[0], request[1], 0, 0, 0, std::uint8_t(body.size())};
        bytes.insert(bytes.end(), body.begin(), body.end());
        return bytes;
    }
    Status read(int timeout_ms = 200) { return driver_->read(frame_, timeout_ms); }
    std::uint32_t count(tactiled_link_count kind) const { return driver_->counts[kind]; }

    Problems problems_;
    std::unique_ptr<Driver> driver_;
    Frame frame_;
    int end_ = -1, other_ = -1, listener_ = -1;
    unsigned port_ = 0;
};

TEST_F(Slave, ARtuUnitIsAskedForAnotherLengthFirstAndThenRead) {
    open_pty("timeout_ms = 2000", "[[slave]]\nunit = 1\n" + kValues);
    EXPECT_EQ(request(), ask(10, 1));
    send(one(77));
    EXPECT_EQ(request(), ask(10, 2));
    send(two(5, 6));
    ASSERT_EQ(read(), Status::frame);
    EXPECT_EQ(frame_.channel[0], 5);
    EXPECT_EQ(frame_.channel[1], 6);
    EXPECT_EQ(request(), ask(10, 2));  // no longer in doubt
    EXPECT_EQ(count(TACTILED_LINK_BUS_ERROR), 0u);
}

// The answer, or the thread: the driver cannot tell.
TEST_F(Slave, AnAnswerThatTakesLongHasTheTimeFromWhichItMayBe) {
    open_pty("timeout_ms = 2000", "[[slave]]\nunit = 1\n" + kValues);
    request();
    send(one(77));
    EXPECT_EQ(request(), ask(10, 2));
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    send(two(5, 6));
    ASSERT_EQ(read(), Status::frame);
    ASSERT_NE(frame_.since_ns, 0u);
    EXPECT_GE(frame_.taken_ns - frame_.since_ns, 150'000'000u);  // the bytes of both need less than 50 ms
    EXPECT_EQ(frame_.t_ns, frame_.taken_ns);
}

TEST_F(Slave, ALateRtuAnswerIsNeverTakenForANewOne) {
    open_pty("timeout_ms = 20\nparity = \"none\"", "[[slave]]\nrate_Hz = 20\n" + kValues);
    request();
    send(one(0));
    EXPECT_EQ(request(), ask(10, 2));
    while (count(TACTILED_LINK_BUS_ERROR) == 0) ASSERT_EQ(read(5), Status::timeout);
    EXPECT_EQ(request(), ask(10, 3));  // now, after the next request was sent, the old answer arrives
    send(two(66, 66));
    ASSERT_EQ(read(1), Status::timeout);
    send(rtu({1, 3, 6, 0, 0, 0, 0, 0, 0}));
    EXPECT_EQ(request(), ask(10, 2));
    send(two(5, 6));
    ASSERT_EQ(read(), Status::frame);
    EXPECT_EQ(frame_.channel[0], 5);
    EXPECT_EQ(count(TACTILED_LINK_FRAMES), 1u);
    EXPECT_EQ(count(TACTILED_LINK_SKIPPED), 9u);
}

TEST_F(Slave, ALateAnswerToAProbeDoesNotAnswerANewerOne) {
    open_pty("timeout_ms = 20", "[[slave]]\nrate_Hz = 20\n" + kValues);
    for (const std::uint8_t registers : Bytes{1, 3, 4, 5}) {
        EXPECT_EQ(request(), ask(10, registers));
        if (registers > 1) send(one(0));  // to the first one
        const std::uint32_t before = count(TACTILED_LINK_BUS_ERROR) + count(TACTILED_LINK_BAD_LENGTH);
        while (count(TACTILED_LINK_BUS_ERROR) + count(TACTILED_LINK_BAD_LENGTH) == before)
            ASSERT_EQ(read(5), Status::timeout);
    }
}

TEST_F(Slave, ALateAnswerToASetOfOtherRegistersIsNotTakenEither) {
    open_pty("timeout_ms = 200", "[[slave]]\nrate_Hz = 10\n" + kValues +
                                     "\n[[slave]]\ndevice = 1\nrate_Hz = 10\n"
                                     "registers = [{name = \"a\", at = 20}, {name = \"b\", at = 21}]");
    request();
    send(one(0));
    EXPECT_EQ(request(), ask(10, 2));
    while (count(TACTILED_LINK_BUS_ERROR) == 0) ASSERT_EQ(read(5), Status::timeout);
    EXPECT_EQ(request(), ask(20, 3));  // the unit is in doubt, for any of its registers
}

TEST_F(Slave, AUnitInDoubtIsAskedForALengthThatNoneOfItsSetsHas) {
    open_pty("timeout_ms = 2000",
             "[[slave]]\nregisters = [{name = \"a\", at = 10}]\n[[slave]]\ndevice = 1\n" + kValues +
                 "\n[[slave]]\ndevice = 2\nunit = 2\n" +
                 "registers = [{name = \"a\", at = 10}, {name = \"b\", at = 11}, {name = \"c\", at = 12}]");
    EXPECT_EQ(request(), ask(10, 3));
}

// It may refuse other lengths than that of its values.
TEST_F(Slave, AUnitThatRefusesAllProbesIsBelieved) {
    open_pty("timeout_ms = 2000", "[[slave]]\n" + kValues);
    for (const std::uint8_t registers : Bytes{1, 3, 5, 4}) {
        EXPECT_EQ(request(), ask(10, registers));
        send(rtu({1, 0x83, 2}));
    }
    EXPECT_EQ(request(), ask(10, 2));
    send(rtu({1, 0x83, 6}));
    EXPECT_EQ(read(1), Status::timeout);
    EXPECT_EQ(count(TACTILED_LINK_BUS_ERROR), 1u);
}

TEST_F(Slave, ASilentUnitLeavesTheLineToTheOthers) {
    open_pty("timeout_ms = 10", "[[slave]]\nunit = 1\nrate_Hz = 80\n" + kValues +
                                    "\n[[slave]]\nunit = 2\ndevice = 2\nrate_Hz = 80\n" + kValues);
    unsigned asked[3] = {}, frames = 0;
    for (int i = 0; i < 200 && frames < 100; ++i) {
        const Bytes r = request();
        ASSERT_LE(r[0], 2);
        ++asked[r[0]];
        if (r[0] == 1) continue;
        send(r[5] == 1 ? rtu({2, 3, 2, 0, 0}) : rtu({2, 3, 4, 0, 5, 0, 6}));
        if (r[5] == 2 && read() == Status::frame) {
            EXPECT_EQ(frame_.device, 2);
            ++frames;
        }
    }
    EXPECT_GE(frames, 60u);
    EXPECT_LE(asked[1], 20u);  // 10, 20, 40 .. 1000 ms apart
}

TEST_F(Slave, StartWritesComeBeforeTheFirstReadingAndAgainAfterASilence) {
    open_pty("timeout_ms = 500",
             "[[slave]]\nrate_Hz = 100\nstart = [{at = 1, value = 258}, {at = 2, value = 3, function = 16}]\n" + kValues);
    const Bytes first = rtu({1, 6, 0, 1, 1, 2}), second = rtu({1, 16, 0, 2, 0, 1, 2, 0, 3}),
                confirmed = rtu({1, 16, 0, 2, 0, 1});
    const auto set_up = [&](std::uint8_t probe, const Bytes& probed) {
        EXPECT_EQ(request(), ask(10, probe));
        send(probed);
        EXPECT_EQ(request(), first);
        send(first);
        EXPECT_EQ(request(), second);
        send(confirmed);
        EXPECT_EQ(request(), ask(10, 2));
    };
    set_up(1, one(0));
    send(two(5, 6));
    ASSERT_EQ(read(), Status::frame);
    EXPECT_EQ(count(TACTILED_LINK_RESTARTED), 0u);
    EXPECT_EQ(request(), ask(10, 2));
    while (count(TACTILED_LINK_BUS_ERROR) == 0) ASSERT_EQ(read(5), Status::timeout);  // one is enough: a reset is quick
    set_up(3, rtu({1, 3, 6, 0, 0, 0, 0, 0, 0}));
    EXPECT_EQ(count(TACTILED_LINK_RESTARTED), 1u);
    send(two(5, 6));
    EXPECT_EQ(read(), Status::frame);
}

TEST_F(Slave, WhatOneSetOfRegistersMissesIsSetUpForTheOthersOfItsUnit) {
    open_connection("timeout_ms = 500", "[[slave]]\nrate_Hz = 100\n" + kValues +
                                            "\n[[slave]]\ndevice = 1\nrate_Hz = 0.01\nstart = [{at = 1, value = "
                                            "258}]\nregisters = [{name = \"a\", at = 7}]");
    const auto is_start = [](const Bytes& r) { return r.size() == 12 && r[7] == 6 && r[9] == 1; };
    const Bytes confirmed{1, 6, 0, 1, 1, 2};
    const auto is_set_up_and_read = [&] {
        Bytes r = request();
        EXPECT_TRUE(is_start(r));
        send(tcp(r, confirmed));
        r = request();
        EXPECT_EQ(r[9], 10);
        send(tcp(r, {1, 3, 4, 0, 5, 0, 6}));
        EXPECT_EQ(read(), Status::frame);
    };
    is_set_up_and_read();
    Bytes r = request();
    EXPECT_EQ(r[9], 7);  // the second one, which was also due at the opening
    send(tcp(r, {1, 3, 2, 0, 5}));
    EXPECT_EQ(read(), Status::frame);
    request();
    while (count(TACTILED_LINK_BUS_ERROR) == 0) ASSERT_EQ(read(5), Status::timeout);
    is_set_up_and_read();
    EXPECT_EQ(count(TACTILED_LINK_RESTARTED), 1u);
}

TEST_F(Slave, AHangUpIsDisconnected) {
    open_pty("timeout_ms = 100", "[[slave]]\n" + kValues);
    request();
    ::close(end_);
    end_ = -1;
    EXPECT_EQ(read(), Status::disconnected);
    driver_->close();
    EXPECT_NE(driver_->open(), "");
}

TEST_F(Slave, OverTcpALateAnswerIsPassedOverByItsTransaction) {
    open_connection("timeout_ms = 20", "[[slave]]\nrate_Hz = 20\n" + kValues);
    const Bytes before = request();
    EXPECT_EQ(before.size(), 12u);
    while (count(TACTILED_LINK_BUS_ERROR) == 0) ASSERT_EQ(read(5), Status::timeout);
    const Bytes now = request();
    send(tcp(before, {1, 3, 4, 0, 66, 0, 66}));
    EXPECT_EQ(read(1), Status::timeout);
    send(tcp(now, {1, 3, 4, 0, 5, 0, 6}));
    ASSERT_EQ(read(), Status::frame);
    EXPECT_EQ(frame_.channel[0], 5);
    EXPECT_EQ(count(TACTILED_LINK_FRAMES), 1u);
}

TEST_F(Slave, AnAnswerInPiecesIsWaitedForByReadsThatReturnInTime) {
    for (const bool over_tcp : {false, true}) {
        if (over_tcp)
            open_connection("timeout_ms = 2000", "[[slave]]\n" + kValues);
        else
            open_pty("timeout_ms = 2000", "[[slave]]\n" + kValues);
        Bytes r = request();
        if (!over_tcp) {
            send(one(0));
            r = request();
        }
        const Bytes answer = over_tcp ? tcp(r, {1, 3, 4, 0, 5, 0, 6}) : two(5, 6);
        for (std::size_t i = 0; i + 1 < answer.size(); ++i) {
            send({answer[i]});
            ASSERT_EQ(read(1), Status::timeout) << i;
        }
        send({answer.back()});
        ASSERT_EQ(read(), Status::frame);
        EXPECT_EQ(frame_.channel[0], 5);
        EXPECT_EQ(frame_.channel[1], 6);
        EXPECT_EQ(count(TACTILED_LINK_SKIPPED), 0u);
        if (!over_tcp) ::close(std::exchange(end_, -1));
    }
}

TEST_F(Slave, AnAnswerThatLayThereWhileTheProcessStoodStillIsNotTaken) {
    open_connection("timeout_ms = 20", "[[slave]]\nrate_Hz = 20\n" + kValues);
    const Bytes asked = request();
    send(tcp(asked, {1, 3, 4, 0, 66, 0, 66}));
    ::usleep(50'000);  // represents hours of suspension
    EXPECT_EQ(read(1), Status::timeout);
    EXPECT_EQ(count(TACTILED_LINK_BUS_ERROR), 1u);
    send(tcp(request(), {1, 3, 4, 0, 5, 0, 6}));
    ASSERT_EQ(read(), Status::frame);
    EXPECT_EQ(frame_.channel[0], 5);
}

TEST_F(Slave, AnAnswerThatCameWhileTheProcessStoodStillInSendIsNotTakenEither) {
    open_connection("timeout_ms = 20", "[[slave]]\nrate_Hz = 20\n" + kValues);
    after_send = [this] {
        Bytes asked(12);
        ASSERT_EQ(::read(end_, asked.data(), asked.size()), 12);
        send(tcp(asked, {1, 3, 4, 0, 66, 0, 66}));
        ::usleep(50'000);  // represents any time
    };
    while (count(TACTILED_LINK_BUS_ERROR) == 0) ASSERT_EQ(read(5), Status::timeout);
    EXPECT_EQ(count(TACTILED_LINK_FRAMES), 0u);
}

TEST_F(Slave, AServerThatClosesOrSpeaksSomethingElseIsDisconnected) {
    open_connection("timeout_ms = 5000", "[[slave]]\n" + kValues);
    request();
    send({'H', 'T', 'T', 'P', '/', '1', '.', '1', ' ', '4'});
    EXPECT_EQ(read(), Status::disconnected);
    ::close(end_);
    ASSERT_EQ(driver_->open(), "");
    end_ = ::accept(listener_, nullptr, nullptr);
    request();
    ::close(end_);
    end_ = -1;
    EXPECT_EQ(read(), Status::disconnected);
    ::close(listener_);
    listener_ = -1;
    EXPECT_NE(driver_->open().find("no program listens on this port"), std::string::npos);
}

TEST_F(Slave, ReadsNoLongerThanAskedFor) {
    open_connection("timeout_ms = 5000", "[[slave]]\n" + kValues);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(read(1), Status::timeout);  // would hang here for 5 s each
    EXPECT_EQ(count(TACTILED_LINK_BUS_ERROR), 0u);
}

TEST(ModbusKeys, TellWhatIsWrongWithALink) {
    const auto wrong = [](const std::string& text, const std::string& expected) {
        Problems problems;
        Options options = Options::parse_text(text, "test.toml", problems);
        (void)Drivers::find("modbus")->make(options);
        options.finish();
        std::string all;
        for (const auto& line : problems.lines()) all += line + "\n";
        EXPECT_NE(all.find(expected), std::string::npos) << all;
    };
    const std::string slave = "\n[[slave]]\n" + kValues;
    wrong("device = \"/dev/null\"", "there is no [[link.slave]]");
    wrong("address = \"sensor.local\"" + slave, "test.toml:1: address = \"sensor.local\" should be a numeric address");
    wrong("address = \"10.0.0.1:70000\"" + slave, "should be a numeric address");
    wrong("address = \"10.0.0.1\"\nbaud = 9600" + slave, "baud is of a serial line");
    wrong("device = \"/dev/null\"\nbaud = 9600" + slave + "\nrate_Hz = 200", "of what 9600 baud can carry");
    wrong("device = \"/dev/null\"\nbaud = 9600" + slave + "\nrate_Hz = 1000", "or rate_Hz divided by 27.");
    wrong("device = \"/dev/null\"" + slave + slave, "device = 0 is another [[link.slave]] already");
}

TEST(ModbusKeys, TheExampleOfTactiledTomlIsGoodOnceItIsTakenOutOfItsComment) {
    std::ifstream file(std::string(TACTILED_SOURCE_DIR) + "/config/tactiled.toml");
    std::string text;
    bool in_it = false;
    for (std::string line; std::getline(file, line);) {
        in_it = line == "# [[link]]" || (in_it && line.starts_with("#"));
        if (in_it) text += (line.size() > 2 ? line.substr(2) : "") + "\n";
    }
    Problems problems;
    Options root = Options::parse_text(text, std::string(TACTILED_SOURCE_DIR) + "/config/tactiled.toml", problems);
    unsigned found = 0;
    for (auto& link : root.tables("link")) {
        link.text("name");
        if (link.text("driver") != "modbus") continue;
        ++found;
        (void)Drivers::find("modbus")->make(link);
        link.finish();
    }
    EXPECT_EQ(found, 1u);
    EXPECT_TRUE(problems.empty()) << problems.lines().front();
}

TEST(TcpAddress, TakesIpv4AndIpv6WithAndWithoutAPort) {
    for (const char* good : {"10.0.0.1", "10.0.0.1:1502", "[::1]:502", "[::1]"})
        EXPECT_EQ(tcp_address(good, 502).fault, "") << good;
    for (const char* bad : {"", ":", "10.0.0.1:", "10.0.0.1:0", "10.0.0.1:5x", "::1", "[::1", "localhost"})
        EXPECT_NE(tcp_address(bad, 502).fault, "") << bad;
}

}  // namespace
}  // namespace tactiled
