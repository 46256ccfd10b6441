// Format "orca": a model of the hand on a pty, written from the facts of its public client, and damaged streams.
#include <gtest/gtest.h>
#include <pty.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>

#include <cmath>
#include <map>
#include <thread>

#include "drivers/driver.hpp"
#include "drivers/wire/stream_format.hpp"
#include "tests/unit/drivers/wire_bytes.hpp"

namespace tactiled::orca_test {
namespace {

// The hand: registers that are written with function 0x10, and a stream once register 0x0017 is 1.
class Hand {
public:
    static constexpr std::array<int, 5> kPads{51, 87, 87, 87, 51};

    // Takes bytes of the client. Returns the replies.
    Bytes take(const Bytes& bytes) {
        heard_.insert(heard_.end(), bytes.begin(), bytes.end());
        Bytes replies;
        while (heard_.size() >= 9) {
            const std::size_t address = heard_[4] | heard_[5] << 8, count = heard_[6] | heard_[7] << 8;
            EXPECT_EQ(heard_[0], 0x55);
            EXPECT_EQ(heard_[1], 0xAA);
            EXPECT_EQ(heard_[3], 0x10);
            if (heard_.size() < 9 + count) break;
            int sum = 0;  // with the LRC, the sum of a message is 0
            for (std::size_t i = 0; i < 9 + count; ++i) sum += heard_[i];
            EXPECT_EQ(sum % 256, 0);
            for (std::size_t i = 0; i < count; ++i) registers[address + i] = heard_[8 + i];
            append(replies, {0xAA, 0x55, 0, 0x10, heard_[4], heard_[5], 1, 0, 0});
            heard_.erase(heard_.begin(), heard_.begin() + std::ptrdiff_t(9 + count));
        }
        return replies;
    }
    // Returns the next frame of the stream; empty if it is off.
    Bytes frame() {
        if (registers[0x17] != 1 || registers[0x16] != 2) return {};
        Bytes message{0xAA, 0x56, 0, 0, 0, error};
        std::size_t taxel = 0;
        for (const int n : kPads)
            for (int i = 0; i < n; ++i, ++taxel)
                for (int v = 0; v < 3; ++v) message.push_back(std::uint8_t(force(taxel, v)));
        const std::size_t length = message.size() - 5;
        message[3] = std::uint8_t(length % 256);
        message[4] = std::uint8_t(length / 256);
        Bytes sent;
        append(sent, message);
        ++number;
        return sent;
    }
    // The force of a taxel in 0.1 N: Fx, Fy or Fz.
    int force(std::size_t taxel, int v) const {
        const int n = int(taxel) + number;
        return v == 0 ? n % 200 - 100 : v == 1 ? 50 - n % 100 : n % 250;
    }

    std::map<std::size_t, std::uint8_t> registers;
    std::uint8_t error = 0;
    int number = 0;

private:
    static void append(Bytes& out, Bytes message) {
        int sum = 0;
        for (const std::uint8_t byte : message) sum += byte;
        message.push_back(std::uint8_t((256 - sum % 256) % 256));
        out.insert(out.end(), message.begin(), message.end());
    }
    Bytes heard_;
};

std::unique_ptr<StreamDecoder> make(LinkCounts& counts, const std::string& keys = "") {
    Problems problems;
    Options options = Options::parse_text(keys, "test.toml", problems);
    auto decoder = StreamFormats::find("orca")->make(options, counts);
    options.finish();
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    return decoder;
}

Hand streaming() {
    LinkCounts counts;
    Hand hand;
    const auto decoder = make(counts);
    const auto start = decoder->start_bytes();
    (void)hand.take(Bytes(start.begin(), start.end()));
    return hand;
}

bool is_frame_of(const Hand& hand, int number, const Taxels& taxels) {
    Hand then = hand;
    then.number = number;
    bool is_right = taxels.shape == TaxelShape{363, 3};
    for (std::size_t i = 0; i < 363; ++i)
        for (int v = 0; v < 3; ++v) is_right &= taxels.value[std::size_t(v) * 363 + i] == float(then.force(i, v));
    return is_right;
}

TEST(OrcaFrame, AHandIsAskedReadAndStopped) {
    int master = -1, slave = -1;
    char name[128];
    ASSERT_EQ(::openpty(&master, &slave, name, nullptr, nullptr), 0);
    Problems problems;
    Options options = Options::parse_text("format = \"orca\"\nbaud = 921600\ndevice = \"" + std::string(name) + "\"",
                                          "test.toml", problems);
    const auto driver = Drivers::find("uart")->make(options);
    options.finish();
    EXPECT_EQ(problems.lines(), std::vector<std::string>{});
    EXPECT_EQ(driver->taxel_shape(), (TaxelShape{363, 3}));
    ASSERT_EQ(driver->open(), "");
    Hand hand;
    const auto listen = [&] {
        std::uint8_t heard[256];
        const ssize_t n = ::read(master, heard, sizeof heard);
        const Bytes replies = hand.take(Bytes(heard, heard + std::max<ssize_t>(n, 0)));
        EXPECT_EQ(::write(master, replies.data(), replies.size()), ssize_t(replies.size()));
    };
    while (hand.frame().empty()) listen();
    EXPECT_EQ(hand.number, 1);
    hand.number = 0;
    Frame frame;
    for (int n = 0; n < 3; ++n) {
        const Bytes sent = hand.frame();
        EXPECT_EQ(sent.size(), 1096u);
        ASSERT_EQ(::write(master, sent.data(), sent.size()), ssize_t(sent.size()));
        Status status = Status::timeout;
        for (int i = 0; i < 200 && status == Status::timeout; ++i) status = driver->read(frame, 10);
        ASSERT_EQ(status, Status::frame);
        EXPECT_EQ(frame.n_channels, 0);
        EXPECT_TRUE(is_frame_of(hand, n, driver->taxels()));
    }
    EXPECT_EQ(driver->counts[TACTILED_LINK_BAD_CHECKSUM] + driver->counts[TACTILED_LINK_BAD_LENGTH], 0u);
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED] % 10, 0u) << "the replies";
    driver->close();
    listen();
    EXPECT_EQ(hand.registers[0x17], 0);
    ::close(master);
    ::close(slave);
}

TEST(OrcaFrame, LimitsAreSaturatedAndAnErrorMakesAllMissing) {
    LinkCounts counts;
    const auto decoder = make(counts, "taxels = 2");
    const auto push = [&](Bytes bytes) {
        int sum = 0;
        for (const std::uint8_t byte : bytes) sum += byte;
        bytes.push_back(std::uint8_t(-sum));
        return decode(*decoder, bytes).size();
    };
    ASSERT_EQ(push({0xAA, 0x56, 0, 7, 0, 0, 0x80, 0x7F, 0xFF, 0xFF, 0x81, 0}), 1u);
    const auto inf = std::numeric_limits<float>::infinity();
    const std::vector<float> all{-inf, -1, inf, -127, inf, 0};
    EXPECT_TRUE(std::equal(all.begin(), all.end(), decoder->taxels().value.begin()));
    ASSERT_EQ(push({0xAA, 0x56, 0, 7, 0, 4, 1, 2, 3, 4, 5, 6}), 1u);
    for (const float value : decoder->taxels().value) EXPECT_TRUE(std::isnan(value));
    EXPECT_EQ(push({0xAA, 0x56, 0, 4, 0, 0, 1, 2, 3}), 0u) << "one pad less";
    EXPECT_EQ(counts[TACTILED_LINK_BAD_LENGTH], 1u);
}

// Noise, damage, and frames within the numbers of others: each intact frame is read, however the bytes are cut.
RC_GTEST_PROP(OrcaFrame, IntactFramesAreFoundBetweenDamagedOnes, ()) {
    Hand hand = streaming();
    Bytes bytes;
    std::vector<int> intact;
    std::size_t damaged = 0;
    for (int n = 0; n < 6; ++n) {
        Bytes one = hand.frame();
        const int kind = *rc::gen::inRange(0, 4);
        if (kind == 0) {
            const std::size_t at = *rc::gen::inRange<std::size_t>(6, one.size());
            one[at] = std::uint8_t(one[at] + *rc::gen::inRange(1, 256));
            ++damaged;
        } else if (kind == 1) {
            one.erase(one.begin() + *rc::gen::inRange<std::ptrdiff_t>(1, 5));  // one byte of its head
            ++damaged;
        } else {
            intact.push_back(n);
        }
        for (int noise = *rc::gen::inRange(0, 3); noise > 0; --noise)
            one.push_back(*rc::gen::element<std::uint8_t>(0, 0xAA, 0x56, 0x55));
        bytes.insert(bytes.end(), one.begin(), one.end());
    }
    LinkCounts counts;
    const auto decoder = make(counts);
    Frame frame;
    std::size_t found = 0;
    const std::size_t chunk = *rc::gen::inRange<std::size_t>(1, 3000);
    for (std::size_t at = 0; at < bytes.size(); at += chunk) {
        decoder->push({bytes.data() + at, std::min(chunk, bytes.size() - at)}, at + 1);
        while (decoder->next(frame)) {
            RC_ASSERT(found < intact.size());
            RC_ASSERT(is_frame_of(hand, intact[found++], decoder->taxels()));
        }
    }
    RC_ASSERT(found == intact.size());
    RC_ASSERT(counts[TACTILED_LINK_BAD_CHECKSUM] <= damaged);
}

}  // namespace
}  // namespace tactiled::orca_test
