// What reaches libmodbus, and what the wall answers itself. Sections: MODBUS Application Protocol Specification 1.1b3 ("P"),
// MODBUS Messaging on TCP/IP Implementation Guide 1.0b ("G").
#include "node/modbus/wall.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes adu(Bytes pdu, std::uint8_t unit = 1) {
    Bytes bytes{0x12, 0x34, 0, 0, 0, std::uint8_t(pdu.size() + 1), unit};
    bytes.insert(bytes.end(), pdu.begin(), pdu.end());
    return bytes;
}

struct Case {
    const char* what;
    Bytes pdu;
    int exception;
};

TEST(Wall, AnswersWrongRequestsWithTheRightException) {
    Bytes long_write{16, 0, 0, 0, 123, 246};
    long_write.resize(6 + 246);
    Bytes longer_write{16, 0, 0, 0, 124, 248};
    longer_write.resize(6 + 247);
    const Case cases[] = {
        // P 6.3, 6.4: read registers
        {"a good read", {3, 0, 0, 0, 32}, 0},
        {"the same by FC 4", {4, 0, 0, 0, 32}, 0},
        {"five sensor blocks", {4, 0, 100, 0, 125}, 0},
        {"the last sensor register", {3, 1, 0xF3, 0, 1}, 0},
        {"constants", {3, 0x23, 0x28, 0, 12}, 0},
        {"no registers", {3, 0, 0, 0, 0}, 3},
        {"126 registers", {3, 0, 100, 0, 126}, 3},
        {"65535 registers", {3, 0, 0, 0xFF, 0xFF}, 3},
        {"too many and at a wrong address: quantity is checked first", {3, 0xFF, 0xFF, 0, 126}, 3},
        {"one beyond the global block", {3, 0, 0, 0, 33}, 2},
        {"between the blocks", {3, 0, 50, 0, 1}, 2},
        {"across the hole", {3, 0, 31, 0, 70}, 2},
        {"beyond the sensors", {4, 1, 0xF4, 0, 1}, 2},
        {"wraps at 65536", {4, 0xFF, 0xFF, 0, 2}, 2},
        {"the last address", {4, 0xFF, 0xFF, 0, 1}, 2},
        {"beyond the constants", {3, 0x23, 0x34, 0, 1}, 2},
        {"a read one byte short", {3, 0, 0, 0}, 3},
        {"a read with no address", {3}, 3},
        {"a read one byte long", {3, 0, 0, 0, 1, 0}, 3},
        // P 6.6, 6.12: writes; nothing is writable
        {"write one register", {6, 0, 0, 0, 1}, 2},
        {"write one at a free address", {6, 0x13, 0x88, 0, 1}, 2},
        {"write one, short: its data would be the next header", {6, 0, 0}, 3},
        {"write one, long", {6, 0, 0, 0, 1, 2}, 3},
        {"write two", {16, 0, 0, 0, 2, 4, 0, 1, 0, 2}, 2},
        {"write 123", long_write, 2},
        {"write 124", longer_write, 3},
        {"write none", {16, 0, 0, 0, 0, 0}, 3},
        {"write, byte count too small", {16, 0, 0, 0, 2, 2, 0, 1}, 3},
        {"write, byte count too large", {16, 0, 0, 0, 1, 4, 0, 1, 0, 2}, 3},
        {"write, data missing", {16, 0, 0, 0, 2, 4, 0, 1}, 3},
        {"write, header only", {16, 0, 0, 0, 2}, 3},
        {"write, data too many", {16, 0, 0, 0, 1, 2, 0, 1, 9}, 3},
        // P 6.1, 6.2, 6.5, 6.15 and others: functions that are not served
        {"read coils", {1, 0, 0, 0, 1}, 1},
        {"read discrete inputs", {2, 0, 0, 0, 1}, 1},
        {"write one coil", {5, 0, 0, 0xFF, 0}, 1},
        {"exception status", {7}, 1},
        {"diagnostics", {8, 0, 0, 0, 0}, 1},
        {"write coils", {15, 0, 0, 0, 1, 1, 1}, 1},
        {"server id", {17}, 1},
        {"mask write", {22, 0, 0, 0, 0, 0, 0}, 1},
        {"read and write", {23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 1}, 1},
        {"identification", {43, 14, 1, 0}, 1},
        {"function 0", {0}, 1},
        {"user-defined function", {65, 1, 2, 3}, 1},
        {"function 128: libmodbus wraps it", {0x80}, 1},
        {"function 0x83: libmodbus answers it as a read", {0x83, 0, 0, 0, 1}, 1},
        {"function 255", {0xFF}, 1},
    };
    for (const Case& c : cases) {
        const Bytes request = adu(c.pdu);
        const Request found = check_adu(request);
        EXPECT_EQ(int(found.exception), c.exception) << c.what;
        if (found.exception == kNone) continue;
        std::array<std::uint8_t, kMostAdu> out;
        ASSERT_EQ(exception_adu(request, found.exception, out), 9u);  // P 7: function | 0x80, code
        const std::uint8_t expected[9] = {
            0x12, 0x34, 0, 0, 0, 3, 1, std::uint8_t(c.pdu[0] | 0x80), std::uint8_t(c.exception)};
        EXPECT_TRUE(std::equal(std::begin(expected), std::end(expected), out.begin())) << c.what;
    }
}

TEST(Wall, EchoesAnyUnit) {  // G 4.4.2.5: 0xFF, 0 and others alike
    for (const int unit : {0, 1, 9, 247, 255}) {
        const Bytes request = adu({99}, std::uint8_t(unit));
        std::array<std::uint8_t, kMostAdu> out;
        exception_adu(request, kIllegalFunction, out);
        EXPECT_EQ(out[6], unit);
    }
}

TEST(Wall, CutsTheStreamIntoRequests) {  // G 3.1.3: transaction, protocol 0, length of what follows
    const auto cut = [](Bytes bytes) {
        std::size_t size = 0;
        const Cut c = cut_adu(bytes, size);
        return std::pair(c, c == Cut::adu ? size : 0);
    };
    const Bytes good = adu({3, 0, 0, 0, 1});
    for (std::size_t n = 0; n < good.size(); ++n)
        EXPECT_EQ(cut(Bytes(good.begin(), good.begin() + long(n))).first, Cut::more) << n;
    EXPECT_EQ(cut(good), std::pair(Cut::adu, good.size()));
    Bytes two = good;
    two.insert(two.end(), good.begin(), good.end());
    EXPECT_EQ(cut(two), std::pair(Cut::adu, good.size()));
    EXPECT_EQ(cut({0, 1, 0, 1}).first, Cut::close);              // protocol 1
    EXPECT_EQ(cut({0, 1, 0x80, 0, 0, 6}).first, Cut::close);     // protocol 32768
    EXPECT_EQ(cut({0, 1, 0, 0, 0, 0}).first, Cut::close);        // no unit
    EXPECT_EQ(cut({0, 1, 0, 0, 0, 1, 1}).first, Cut::close);     // no function
    EXPECT_EQ(cut({0, 1, 0, 0, 0, 255}).first, Cut::close);      // longer than any request
    EXPECT_EQ(cut({0, 1, 0, 0, 0xFF, 0xFF}).first, Cut::close);  // 65535: libmodbus answers it
    EXPECT_EQ(cut({0, 1, 0, 0, 0, 254}).first, Cut::more);       // the longest there is
    const std::string http = "GET / HTTP/1.1\r\n";
    EXPECT_EQ(cut(Bytes(http.begin(), http.end())).first, Cut::close);
}

TEST(Wall, LetsThroughOnlyWhatTheTableHas) {
    std::mt19937 random(7);
    int good = 0;
    for (int i = 0; i < 2'000'000; ++i) {
        Bytes pdu(1 + random() % 8);
        for (auto& byte : pdu) byte = std::uint8_t(random() % (random() % 3 == 0 ? 256 : 8));
        const Request r = check_adu(adu(pdu));
        if (r.exception != kNone) continue;
        ++good;
        ASSERT_TRUE(r.function == 3 || r.function == 4);
        ASSERT_GE(r.count, 1);
        ASSERT_LE(r.count, 125);
        ASSERT_TRUE((r.at + r.count <= 32) || (r.at >= 100 && r.at + r.count <= 500) ||
                    (r.at >= 9000 && r.at + r.count <= 9012));
    }
    EXPECT_GT(good, 100);
}

}  // namespace
}  // namespace tactiled::modbus
