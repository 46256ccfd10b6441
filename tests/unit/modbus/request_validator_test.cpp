// The requests that reach libmodbus, and the exceptions of all others. Sections: MODBUS Application Protocol
// Specification 1.1b3 ("P"), MODBUS Messaging on TCP/IP Implementation Guide 1.0b ("G").
#include "node/modbus/request_validator.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "node/modbus/table.hpp"

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes adu(Bytes pdu) {
    pdu.insert(pdu.begin(), {0x12, 0x34, 0, 0, 0, std::uint8_t(pdu.size() + 1), 1});
    return pdu;
}

struct RequestCase {
    const char* what;
    Bytes pdu;
    int exception;
};

TEST(RequestValidator, AnswersWrongRequestsWithTheRightException) {
    Bytes long_write{16, 0, 0, 0, 123, 246};
    long_write.resize(6 + 246);
    Bytes longer_write{16, 0, 0, 0, 124, 248};
    longer_write.resize(6 + 247);
    const RequestCase cases[] = {
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
        {"one beyond the global block", {3, 0, 0, 0, 33}, 0},
        {"a whole scan", {4, 0, 0, 0, 125}, 0},
        {"the view of a gripper", {4, 2, 0x58, 0, 125}, 0},
        {"from the sensors into the view", {4, 1, 0xF3, 0, 102}, 0},
        {"from the hole before the commands into them", {3, 0x13, 0x87, 0, 2}, 0},
        {"the same by FC 4", {4, 0x13, 0x87, 0, 2}, 2},
        {"from a page of an array into the next one", {3, 0x2A, 0xF9, 0, 125}, 2},
        {"from a hole into the first page", {3, 0x2A, 0xF7, 0, 2}, 2},
        {"from the last head into the hole", {3, 0x28, 0x0F, 0, 2}, 2},
        {"from the hole before the heads into them", {3, 0x27, 0x0F, 0, 17}, 2},
        {"between the blocks", {3, 0, 35, 0, 1}, 2},
        {"across the hole", {3, 0, 31, 0, 70}, 0},
        {"all of a hole", {3, 0, 88, 0, 12}, 2},
        {"beyond the sensors", {4, 1, 0xF4, 0, 1}, 2},
        {"wraps at 65536", {4, 0xFF, 0xFF, 0, 2}, 2},
        {"the last address", {4, 0xFF, 0xFF, 0, 1}, 2},
        {"beyond the constants", {3, 0x23, 0x34, 0, 1}, 2},
        {"a read one byte short", {3, 0, 0, 0}, 3},
        {"a read with no address", {3}, 3},
        {"a read one byte long", {3, 0, 0, 0, 1, 0}, 3},
        // P 6.6, 6.12: writes
        {"write one register that is read-only", {6, 0, 0, 0, 1}, 2},
        {"write the command", {6, 0x13, 0x88, 0, 1}, 0},
        {"write a reserved cell", {6, 0x13, 0x8D, 0, 1}, 2},
        {"write scratch", {6, 0x13, 0xEC, 0, 1}, 0},
        {"write beyond scratch", {6, 0x14, 0x6C, 0, 1}, 2},
        {"input registers are not what can be written", {4, 0x13, 0x88, 0, 1}, 2},
        {"nor what is a copy of it", {4, 0x14, 0xB4, 0, 15}, 2},
        {"read the registers of a cycle", {3, 0x14, 0xB4, 0, 15}, 0},
        {"write the last register of a cycle", {6, 0x14, 0xC2, 0, 1}, 0},
        {"write beyond the registers of a cycle", {16, 0x14, 0xC2, 0, 2, 4, 0, 1, 0, 2}, 2},
        {"write into the view of a gripper", {6, 2, 0x59, 0, 1}, 2},
        {"write one, short: its data would be the next header", {6, 0, 0}, 3},
        {"write one, long", {6, 0, 0, 0, 1, 2}, 3},
        {"write two that are read-only", {16, 0, 0, 0, 2, 4, 0, 1, 0, 2}, 2},
        {"write two of scratch", {16, 0x13, 0xEC, 0, 2, 4, 0, 1, 0, 2}, 0},
        {"write from the controls into scratch", {16, 0x13, 0xEB, 0, 2, 4, 0, 1, 0, 2}, 2},
        {"write 123", long_write, 2},
        {"write 124", longer_write, 3},
        {"write none", {16, 0, 0, 0, 0, 0}, 3},
        {"write, byte count too small", {16, 0, 0, 0, 2, 2, 0, 1}, 3},
        {"write, byte count too large", {16, 0, 0, 0, 1, 4, 0, 1, 0, 2}, 3},
        {"write, data missing", {16, 0, 0, 0, 2, 4, 0, 1}, 3},
        {"write, header only", {16, 0, 0, 0, 2}, 3},
        {"write, data too many", {16, 0, 0, 0, 1, 2, 0, 1, 9}, 3},
        // P 6.1, 6.2, 6.5, 6.11: bits
        {"read all coils", {1, 0, 0, 0, 34}, 0},
        {"read one coil too many", {1, 0, 0, 0, 35}, 2},
        {"read no coils", {1, 0, 0, 0, 0}, 3},
        {"read 2001 coils", {1, 0, 0, 7, 0xD1}, 3},
        {"read all discrete inputs", {2, 0, 0, 0, 68}, 0},
        {"read a discrete input too many", {2, 0, 1, 0, 68}, 2},
        {"write one coil", {5, 0, 0, 0xFF, 0}, 0},
        {"write one coil, neither on nor off", {5, 0, 0, 0, 1}, 3},
        {"write a coil that is not there", {5, 0, 34, 0xFF, 0}, 2},
        {"write coils", {15, 0, 0, 0, 9, 2, 1, 0}, 0},
        {"write coils, byte count of another quantity", {15, 0, 0, 0, 9, 1, 1}, 3},
        {"write coils beyond the last", {15, 0, 33, 0, 2, 1, 3}, 2},
        // P 6.16, 6.17: mask write; read and write
        {"mask write scratch", {22, 0x13, 0xEC, 0, 0, 0, 0}, 0},
        {"mask write what is read-only", {22, 0, 0, 0, 0, 0, 0}, 2},
        {"mask write, short", {22, 0x13, 0xEC, 0, 0, 0}, 3},
        {"read 25 and write 5000", {23, 0, 25, 0, 3, 0x13, 0x88, 0, 1, 2, 0, 1}, 0},
        {"read nothing, write scratch", {23, 0, 25, 0, 0, 0x13, 0xEC, 0, 1, 2, 0, 1}, 3},
        {"read the view, write the registers of a cycle", {23, 2, 0x58, 0, 125, 0x14, 0xB4, 0, 1, 2, 0, 1}, 0},
        {"read outside, write scratch", {23, 0, 35, 0, 1, 0x13, 0xEC, 0, 1, 2, 0, 1}, 2},
        {"read 25, write what is read-only", {23, 0, 25, 0, 3, 0, 0, 0, 1, 2, 0, 1}, 2},
        {"read and write, byte count odd", {23, 0, 25, 0, 3, 0x13, 0xEC, 0, 1, 1, 0}, 3},
        // P 6.21: identification
        {"identification", {43, 14, 1, 0}, 0},
        {"identification, short", {43, 14, 1}, 3},
        {"identification, of no code", {43, 14, 0, 0}, 3},
        {"identification, of a code after the last", {43, 14, 5, 0}, 3},
        {"identification, the last object", {43, 14, 4, 6}, 0},
        {"identification, an object after the last", {43, 14, 4, 7}, 2},
        {"another encapsulated interface", {43, 13, 1, 0}, 1},
        // P 6.8, 6.13: diagnostics and server id
        {"return query data", {8, 0, 0, 0xA5, 0x37}, 0},
        {"return query data of two words", {8, 0, 0, 1, 2, 3, 4}, 0},
        {"return query data, half a word", {8, 0, 0, 1}, 3},
        {"return query data, no data", {8, 0, 0}, 3},
        {"diagnostics, half a sub-function", {8, 0}, 3},
        {"diagnostics, restart", {8, 0, 1, 0, 0}, 1},
        {"diagnostics, force listen only", {8, 0, 4, 0, 0}, 1},
        {"diagnostics, sub-function 256", {8, 1, 0, 0, 0}, 1},
        {"server id", {17}, 0},
        {"server id, long", {17, 0}, 3},
        // Annex B and others: functions that are not served
        {"exception status", {7}, 1},
        {"function 0", {0}, 1},
        {"user-defined function", {65, 1, 2, 3}, 1},
        {"function 128: libmodbus wraps it", {0x80}, 1},
        {"function 0x83: libmodbus answers it as a read", {0x83, 0, 0, 0, 1}, 1},
        {"function 255", {0xFF}, 1},
    };
    for (const RequestCase& c : cases) EXPECT_EQ(int(check_pdu(c.pdu, true).exception), c.exception) << c.what;
}

TEST(RequestValidator, CutsTheStreamIntoRequests) {  // G 3.1.3: transaction, protocol 0, length of the rest
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

TEST(RequestValidator, LetsThroughOnlyWhatTheTableHas) {
    std::mt19937 random(7);
    int good = 0;
    for (int i = 0; i < 2'000'000; ++i) {
        Bytes pdu(1 + random() % 8);
        for (auto& byte : pdu) byte = std::uint8_t(random() % (random() % 3 == 0 ? 256 : 8));
        const Request r = check_pdu(pdu, false);
        if (r.exception != kNone) continue;
        ++good;
        const bool bits = r.function == 1 || r.function == 2 || r.function == 5 || r.function == 15;
        if (bits) {
            ASSERT_LE(r.read.at + r.read.count, 68);
            ASSERT_LE(r.write.at + r.write.count, 34);
        } else if (r.read.count != 0) {
            ASSERT_LE(r.read.count, 125);
            const auto read = areas_in(r.read.at, r.read.count);
            ASSERT_FALSE(read.empty());
            for (const Area& area : read) {
                ASSERT_TRUE(area_of(r.read.at, r.read.count) == &area || !area.is_latched());
                ASSERT_TRUE(r.function != 4 || !area.is_holding_only());
            }
        }
        for (unsigned k = 0; k < r.write.count && !bits; ++k)
            ASSERT_NE(writable_at(r.write.at + k), nullptr);  // no scratch here
        ASSERT_TRUE(r.read.count != 0 || r.write.count != 0 || r.function == 43 || r.function == 8 || r.function == 17);
    }
    EXPECT_GT(good, 100);
}

}  // namespace
}  // namespace tactiled::modbus
