// The uart driver over real ptys.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <thread>

#include "drivers/clock.hpp"
#include "drivers/driver.hpp"
#include "drivers/tty.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "tests/unit/drivers/ft300_bytes.hpp"

namespace tactiled {
namespace {

class UartTest : public testing::Test {
protected:
    UartTest() {
        char name[128];
        EXPECT_EQ(::openpty(&master_, &slave_, name, nullptr, nullptr), 0);
        port_ = name;
    }
    ~UartTest() override {
        hang_up();
        if (slave_ >= 0) ::close(slave_);
    }
    void hang_up() {
        if (master_ >= 0) ::close(master_);
        master_ = -1;
    }
    std::unique_ptr<Driver> make(const std::string& keys) {
        Options options = Options::parse_text("device = \"" + port_ + "\"\n" + keys, "test.toml", problems_);
        auto driver = Drivers::find("uart")->make(options);
        options.finish();
        return driver;
    }
    void send(const void* bytes, std::size_t size) { ASSERT_EQ(::write(master_, bytes, size), ssize_t(size)); }
    // A pty passes its bytes on in a kernel thread.
    void wait_until_waiting(int bytes) {
        int waiting = 0;
        for (int i = 0; i < 2000 && waiting < bytes; ++i) {
            ASSERT_EQ(::ioctl(slave_, FIONREAD, &waiting), 0);
            ::usleep(500);
        }
        ASSERT_EQ(waiting, bytes);
    }
    void send_frame(std::uint32_t n) {
        Frame f;
        f.sequence = n;
        f.n_channels = 2;
        f.channel[1] = double(n) * 2;
        std::array<std::uint8_t, kCobsMaxEncoded> out;
        frame_bytes_ = int(encode_cobs(f, 24, out));
        send(out.data(), std::size_t(frame_bytes_));
    }

    std::string port_;
    int master_ = -1, slave_ = -1;
    Problems problems_;
    int frame_bytes_ = 0;
};

TEST_F(UartTest, ReadsFramesInOrderOneACall) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    for (std::uint32_t n = 0; n < 5; ++n) send_frame(n);
    wait_until_waiting(5 * frame_bytes_);
    Frame frame;
    for (std::uint32_t n = 0; n < 5; ++n) {
        ASSERT_EQ(driver->read(frame, 1000), Status::frame);
        EXPECT_EQ(frame.sequence, n);
        EXPECT_EQ(frame.channel[1], double(n) * 2);
        EXPECT_EQ(driver->has_more(), n < 4);
    }
    EXPECT_EQ(driver->read(frame, 1), Status::timeout);
    EXPECT_EQ(driver->counts[TACTILED_LINK_FRAMES], 5u);
}

TEST_F(UartTest, APseudoTerminalIsANetworkUnlessItIsDeclaredACable) {
    for (const auto& [keys, path] : {std::pair{"", Route::Path::network},
                                     {"\npath = \"direct\"", Route::Path::direct},
                                     {"\npath = \"network\"\nclock_ppm = 5000", Route::Path::network}}) {
        const auto driver = make(std::string("format = \"cobs\"") + keys);
        ASSERT_TRUE(problems_.empty()) << problems_.lines().front();
        ASSERT_EQ(driver->open(), "");
        const Route route = driver->route();
        EXPECT_EQ(route.path, path) << keys;
        EXPECT_FALSE(route.reopening_discards) << "what is behind it does not notice";
        EXPECT_EQ(route.clock_ppm, std::string(keys).find("5000") == std::string::npos ? 200 : 5000);
        EXPECT_EQ(driver->freshness().starts_with("cable"), path == Route::Path::direct);
    }
    (void)make("format = \"cobs\"\npath = \"cable\"");
    EXPECT_EQ(problems_.lines().size(), 1u);
}

TEST_F(UartTest, BytesThatWaitedForAThreadThatStoodStillMayHaveComeAtOnce) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    Frame frame;
    send_frame(1);
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    EXPECT_EQ(frame.since_ns, 0u) << "it was read when it came";
    EXPECT_GE(frame.taken_ns, frame.t_ns);
    send_frame(2);
    ::usleep(150'000);
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    EXPECT_NEAR(double(frame.taken_ns - frame.since_ns), 150e6, 60e6);
}

// A wait of one piece would leave open for 150 ms when the bytes came.
TEST_F(UartTest, AFrameAfterAPauseIsDatedByTheSliceInWhichItCame) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    std::thread device([this] {
        ::usleep(150'000);
        send_frame(1);
    });
    Frame frame;
    const Status status = driver->read(frame, 1000);
    device.join();
    ASSERT_EQ(status, Status::frame);
    EXPECT_TRUE(frame.since_ns == 0 || frame.taken_ns - frame.since_ns < 100'000'000) << frame.taken_ns - frame.since_ns;
}

// A slice is a fortieth of the silence: 50 ms after 2 s, 10 ms until 0.4 s after the last byte.
TEST_F(UartTest, ASliceGrowsWithTheSilence) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    const auto waits = [&] {
        rusage before{}, after{};
        ::getrusage(RUSAGE_THREAD, &before);
        Frame frame;
        EXPECT_EQ(driver->read(frame, 250), Status::timeout);
        ::getrusage(RUSAGE_THREAD, &after);
        return after.ru_nvcsw - before.ru_nvcsw;
    };
    EXPECT_GE(waits(), 20);
    ::usleep(2'000'000);
    EXPECT_LE(waits(), 6);
    send_frame(1);
    Frame frame;
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    EXPECT_GE(waits(), 20);
}

TEST_F(UartTest, AHangUpIsDisconnectedAndNotReadAgain) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    send_frame(1);
    Frame frame;
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    hang_up();
    EXPECT_EQ(driver->read(frame, 1000), Status::disconnected);
    driver->close();
    EXPECT_NE(driver->open(), "");  // the pty is dead: reports it, and does not throw
}

TEST_F(UartTest, WhatLayInTheBufferBeforeOpeningIsNotGivenANewTimestamp) {
    const auto driver = make("format = \"cobs\"");
    termios raw{};  // in canonical mode no bytes would be counted
    ASSERT_EQ(::tcgetattr(slave_, &raw), 0);
    ::cfmakeraw(&raw);
    ASSERT_EQ(::tcsetattr(slave_, TCSANOW, &raw), 0);
    send_frame(1);
    wait_until_waiting(frame_bytes_);
    ASSERT_EQ(driver->open(), "");
    send_frame(2);
    Frame frame;
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    EXPECT_EQ(frame.sequence, 2u);
}

TEST_F(UartTest, WhatLayThereWhileTheReaderStoodStillIsNotGivenANewTimestampEither) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    send_frame(1);
    wait_until_waiting(frame_bytes_);
    ::usleep(1'050'000);  // longer than 1 s
    Frame frame;
    EXPECT_EQ(driver->read(frame, 1), Status::disconnected);
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], std::uint32_t(frame_bytes_));
    ASSERT_EQ(driver->open(), "");
    send_frame(2);
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    EXPECT_EQ(frame.sequence, 2u);
}

TEST_F(UartTest, FramesThatWaitedWhileTheReaderStoodStillAreAsFarApartAsTheyWereSent) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    Frame frame;
    send_frame(0);
    ASSERT_EQ(driver->read(frame, 1000), Status::frame);
    const std::uint64_t began_ns = frame.t_ns;
    constexpr unsigned kFrames = 10;
    for (unsigned n = 1; n <= kFrames; ++n) {
        ::usleep(20'000);
        send_frame(n);
    }
    wait_until_waiting(int(kFrames) * frame_bytes_);
    std::vector<std::uint64_t> steps_ns;
    for (std::uint64_t last_ns = began_ns; steps_ns.size() < kFrames; last_ns = frame.t_ns) {
        ASSERT_EQ(driver->read(frame, 1000), Status::frame);
        steps_ns.push_back(frame.t_ns - last_ns);
    }
    for (std::size_t n = 2; n < kFrames; ++n) EXPECT_NEAR(double(steps_ns[n]), double(steps_ns[1]), 1e3);
    EXPECT_GT(steps_ns[1], 15'000'000u);
    EXPECT_GE(frame.t_ns - began_ns, kFrames * std::uint64_t{20'000'000});
}

TEST_F(UartTest, WhatAnFt300SentBeforeItWasStoppedIsNoReading) {
    const auto driver = make("format = \"ft300\"\nbaud = 600");  // a pty accepts it; the pause is 853 ms then
    std::array<std::uint8_t, kFt300Bytes> out;
    Frame old, read;
    old.channel[0] = 1;
    encode_ft300(old, out);
    std::thread device([&] {  // answers the stop bytes, in the pause before the start
        char heard[61];
        for (std::size_t n = 0; n < 50;) n += std::size_t(std::max<ssize_t>(0, ::read(master_, heard, 50 - n)));
        (void)!::write(master_, out.data(), out.size());
    });
    ASSERT_EQ(driver->open(), "");
    device.join();
    encode_ft300(Frame{}, out);
    send(out.data(), out.size());
    ASSERT_EQ(driver->read(read, 1000), Status::frame);
    EXPECT_EQ(read.channel[0], 0);
}

TEST_F(UartTest, ADeviceThatIsOnlyLateAtTheFirstOpeningWasNotRestarted) {
    const auto driver = make("format = \"ft300\"");
    ASSERT_EQ(driver->open(), "");
    Frame read;
    EXPECT_EQ(driver->read(read, 1050), Status::timeout);
    EXPECT_EQ(driver->read(read, 1), Status::timeout);  // the request is repeated
    std::array<std::uint8_t, kFt300Bytes> out;
    encode_ft300(Frame{}, out);
    send(out.data(), out.size());
    ASSERT_EQ(driver->read(read, 1000), Status::frame);
    EXPECT_EQ(driver->counts[TACTILED_LINK_RESTARTED], 0u);
}

TEST_F(UartTest, AHexStreamIsAskedForReadAndStoppedAsConfigured) {
    const auto driver =
        make("format = \"hex\"\nchannels = 2\nmost = 0x3FFF\ndigit = \"ignored\"\nstart = \"S\"\nstop = \"E\"");
    ASSERT_TRUE(problems_.empty());
    ASSERT_EQ(driver->open(), "");
    char heard[3] = {};
    for (int at = 0; at < 2; ++at) ASSERT_EQ(::read(master_, heard + at, 1), 1);
    EXPECT_STREQ(heard, "ES");  // first a device that is still sending is stopped
    send("12001200a\r\n", 11);
    Frame read;
    ASSERT_EQ(driver->read(read, 1000), Status::frame);
    EXPECT_EQ(read.channel[1], 0x200A);
    driver->close();
    ASSERT_EQ(::read(master_, heard, 1), 1);
    EXPECT_EQ(heard[0], 'E');
    (void)make("format = \"hex\"\nchannels = 2\ndigits = 2\nmost = 256");
    ASSERT_EQ(problems_.lines().size(), 1u);
    EXPECT_NE(problems_.lines()[0].find("most = 256 is outside 1 .. 255"), std::string::npos) << problems_.lines()[0];
}

// The number of the last request that the device has received.
std::string last_request(int master) {
    char text[512] = {};
    pollfd waiting{master, POLLIN, 0};
    const ssize_t size = ::poll(&waiting, 1, 1000) == 1 ? ::read(master, text, sizeof text - 1) : 0;
    const std::string all(text, std::size_t(std::max<ssize_t>(0, size)));
    const std::size_t at = all.rfind('?');
    EXPECT_TRUE(at != all.npos && all.back() == '\n') << all;
    return at == all.npos ? "" : all.substr(at + 1, all.size() - at - 2);
}

TEST_F(UartTest, AsksForAnEchoAndGivesTheAnswerToTheNextFrameOnce) {
    const auto driver = make("format = \"lines\"\nchannels = 1\necho = true");
    ASSERT_TRUE(problems_.empty()) << problems_.lines().front();
    ASSERT_EQ(driver->open(), "");
    const auto read_after = [&](const std::string& text) {
        send(text.data(), text.size());
        Frame frame;
        Status status = Status::timeout;
        for (int i = 0; i < 100 && status == Status::timeout; ++i) status = driver->read(frame, 10);
        EXPECT_EQ(status, Status::frame) << text;
        return frame;
    };
    Frame none;
    EXPECT_EQ(driver->read(none, 250), Status::timeout);
    const std::uint64_t began_ns = now_ns();
    EXPECT_EQ(read_after("\n1\n").asked_ns, 0u);
    const std::string number = last_request(master_);
    EXPECT_EQ(read_after("!" + number + "0,77\n2\n").asked_ns, 0u) << "another number";
    const Frame answered = read_after("!" + number + ",77\n3\n");
    EXPECT_GT(answered.asked_ns, began_ns - 4'000'000'000);
    EXPECT_LT(answered.asked_ns, answered.t_ns);
    EXPECT_EQ(answered.answered_us, 77u);
    EXPECT_EQ(read_after("!" + number + ",78\n4\n").asked_ns, 0u) << "it was answered";
    EXPECT_EQ(driver->read(none, 100), Status::timeout);
    const std::string next = last_request(master_);
    EXPECT_NE(next, number);
    const std::string early = "!" + next + ",79\n";
    send(early.data(), early.size());
    EXPECT_EQ(driver->read(none, 20), Status::timeout);
    ASSERT_EQ(driver->open(), "");
    EXPECT_EQ(read_after("\n5\n").asked_ns, 0u) << "an answer of the opening before";
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], 0u);
}

TEST_F(UartTest, AnArrayAndItsAnswersAreReadBesideFramesOfChannels) {
    constexpr TaxelShape kShape{300, 2};
    const auto driver = make("format = \"cobs\"\ntaxels = 300\nvalues = 2\necho = true");
    ASSERT_TRUE(problems_.empty()) << problems_.lines().front();
    EXPECT_EQ(driver->taxel_shape(), kShape);
    ASSERT_EQ(driver->open(), "");
    const auto send_message = [&](const std::vector<std::uint8_t>& message) {
        std::vector<std::uint8_t> coded(message.size() + message.size() / 254 + 2);
        send(coded.data(), put_cobs(message, coded.data()));
    };
    const auto read = [&] {
        Frame frame;
        Status status = Status::timeout;
        for (int i = 0; i < 200 && status == Status::timeout; ++i) status = driver->read(frame, 10);
        EXPECT_EQ(status, Status::frame);
        return frame;
    };
    std::vector<float> values(kShape.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = float(i);
    const auto piece = [&](std::uint32_t n, std::uint16_t first) {
        return encode_array_piece({.type = ArrayType::i16, .sequence = n, .shape = kShape, .first = first, .count = 150},
                                  values);
    };
    Frame none;
    EXPECT_EQ(driver->read(none, 50), Status::timeout);
    const auto number = std::uint32_t(std::stoul(last_request(master_)));
    send_message(piece(1, 150));
    send_message(encode_array_echo(0, number, 77));  // within a frame
    send_message(piece(1, 0));
    const Frame open = read();
    EXPECT_EQ(open.asked_ns, 0u) << "it was measured before the answer";
    EXPECT_TRUE(std::equal(values.begin(), values.end(), driver->taxels().value.begin()));
    send_frame(5);
    EXPECT_EQ(read().n_channels, 2);
    EXPECT_TRUE(driver->taxels().value.empty());
    send_message(piece(2, 0));
    send_message(piece(2, 150));
    const Frame proved = read();
    EXPECT_EQ(proved.sequence, 2u);
    EXPECT_GT(proved.asked_ns, 0u);
    EXPECT_EQ(proved.answered_us, 77u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], 0u);
}

TEST_F(UartTest, ADeviceThatNeverReadsItsRequestsIsReadOn) {
    const auto driver = make("format = \"lines\"\nchannels = 1\necho = true");
    ASSERT_EQ(driver->open(), "");
    const int other = ::open(port_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK);
    ASSERT_GE(other, 0);
    const std::string noise(4096, 'x');
    while (::write(other, noise.data(), noise.size()) > 0) {}
    ::close(other);
    send("\n1\n", 3);
    Frame frame;
    EXPECT_EQ(driver->read(frame, 1000), Status::frame);
}

TEST_F(UartTest, OnlyAFormatWithEchoLinesCanBeAskedForThem) {
    (void)make("format = \"cobs\"\necho = true");
    ASSERT_EQ(problems_.lines().size(), 1u);
    EXPECT_NE(problems_.lines()[0].find("format = \"lines\""), std::string::npos) << problems_.lines()[0];
}

TEST_F(UartTest, SetsRawModeAndAnyRate) {
    const auto driver = make("format = \"cobs\"\nbaud = 123456");
    ASSERT_EQ(driver->open(), "");
    send("\x03\x04\r\x00", 4);  // no character is translated or raises a signal
    termios settings{};
    ASSERT_EQ(::tcgetattr(slave_, &settings), 0);
    EXPECT_EQ(settings.c_lflag & unsigned(ICANON | ECHO | ISIG), 0u);
    EXPECT_EQ(settings.c_iflag & unsigned(ICRNL | IXON), 0u);
    EXPECT_EQ(settings.c_cflag & unsigned(CLOCAL | CREAD | CS8), unsigned(CLOCAL | CREAD | CS8));
}

TEST_F(UartTest, SurvivesAFloodOfNoiseAndFindsTheNextFrame) {
    const auto driver = make("format = \"cobs\"");
    ASSERT_EQ(driver->open(), "");
    std::mt19937 random(3);
    Frame frame;
    std::uint32_t good = 0;
    for (std::uint32_t round = 0; round < 100; ++round) {
        std::array<std::uint8_t, 2000> noise;
        for (auto& byte : noise) byte = std::uint8_t(random());
        noise.back() = 0;
        send(noise.data(), noise.size());
        send_frame(round);
        for (int reads = 0; reads < 100 && good <= round; ++reads)
            if (driver->read(frame, 1000) == Status::frame) {
                EXPECT_EQ(frame.channel[1], double(frame.sequence) * 2);
                ++good;
            }
    }
    EXPECT_EQ(good, 100u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_BYTES], 100u * (2000u + unsigned(frame_bytes_)));
}

TEST_F(UartTest, SaysWhatIsWrongWithAPort) {
    std::string why;
    EXPECT_EQ(open_tty("/nonexistent/tty", TtySettings{.baud = 9600}, why), -1);
    EXPECT_NE(why.find("is it plugged in?"), std::string::npos) << why;
    EXPECT_EQ(open_tty("nonexistent/tty", TtySettings{.baud = 9600}, why), -1);
    EXPECT_NE(why.find("write the full path"), std::string::npos) << why;
    EXPECT_EQ(open_tty("/dev/null", TtySettings{.baud = 9600}, why), -1);
    EXPECT_NE(why.find("no serial port"), std::string::npos) << why;
}

TEST_F(UartTest, AsksAnFt300ForItsStreamAtOpeningAndAgainWhenItFellSilentAndStopsItAtTheEnd) {
    const auto driver = make("format = \"ft300\"");
    const std::string stop(50, '\xFF'), start("\x09\x10\x01\x9A\x00\x01\x02\x02\x00\xCD\xCA", 11);
    const auto sent = [&](std::size_t size) {
        std::string bytes(size, 0);
        std::size_t have = 0;
        for (ssize_t n = 1; have < size && n > 0; have += std::size_t(n)) n = ::read(master_, &bytes[have], size - have);
        return bytes;
    };
    const auto frame = [&](Frame& read) {
        std::array<std::uint8_t, kFt300Bytes> out;
        encode_ft300(Frame{}, out);
        send(out.data(), out.size());
        return driver->read(read, 1000);
    };
    ASSERT_EQ(driver->open(), "");
    EXPECT_EQ(sent(61), stop + start);
    Frame read;
    EXPECT_EQ(frame(read), Status::frame);
    EXPECT_EQ(driver->counts[TACTILED_LINK_RESTARTED], 0u);
    EXPECT_EQ(driver->read(read, 1050), Status::timeout);
    EXPECT_EQ(driver->read(read, 1), Status::timeout);
    EXPECT_EQ(sent(11), start);
    EXPECT_EQ(frame(read), Status::frame);
    EXPECT_EQ(driver->counts[TACTILED_LINK_RESTARTED], 1u);
    driver->close();
    EXPECT_EQ(sent(50), stop);
}

TEST_F(UartTest, ChecksItsKeys) {
    (void)make("format = \"cobbs\"\nbaud = 49");
    (void)make("format = \"cobs\"\nbits = 8");
    std::string all;
    for (const auto& line : problems_.lines()) all += line + "\n";
    EXPECT_NE(all.find("did you mean \"cobs\""), std::string::npos) << all;
    EXPECT_NE(all.find("baud = 49 is outside 50 .. 12000000"), std::string::npos) << all;
    EXPECT_NE(all.find("unknown key \"bits\""), std::string::npos) << all;
}

}  // namespace
}  // namespace tactiled
