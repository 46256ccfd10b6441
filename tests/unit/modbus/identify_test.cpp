// Functions 43 / 14 and 17, byte by byte (Modbus Application Protocol 1.1b3, 6.21 and 6.13).
#include "node/modbus/identify.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes answer_to(const Bytes& request, bool is_running = true) {
    EXPECT_EQ(check_pdu(request, false).exception, kNone);
    std::array<std::uint8_t, kMaxPdu> out{};
    const std::size_t size = Identity("node").answer(request, is_running, out);
    return {out.begin(), out.begin() + long(size)};
}
Bytes pdu_of(std::uint8_t code, std::uint8_t object) { return answer_to({43, 14, code, object}); }

TEST(Identity, SaysItsConformity) {
    for (const int code : {1, 2, 3, 4}) EXPECT_EQ(pdu_of(std::uint8_t(code), 0)[3], 0x82) << code;  // regular, both accesses
}

TEST(Identity, AStreamFromBeyondItsLastObjectStartsAgain) {
    for (const int first : {3, 4, 6, 7, 255}) {  // 3: the first that the basic stream does not have
        const auto pdu = pdu_of(1, std::uint8_t(first));
        EXPECT_EQ(pdu[6], 3) << first;  // objects
        EXPECT_EQ(pdu[7], 0) << first;  // the first of them
    }
    EXPECT_EQ(pdu_of(1, 2)[6], 1);
    EXPECT_EQ(pdu_of(2, 7)[6], 7);
}

TEST(Identity, EveryRegularObjectHasAText) {
    for (const int id : {0, 1, 2, 3, 4, 5, 6}) {
        const auto pdu = pdu_of(4, std::uint8_t(id));
        ASSERT_GT(pdu.size(), 9u) << id;
        EXPECT_EQ(pdu[7], id);
        EXPECT_EQ(pdu[8], pdu.size() - 9) << id;
    }
    const auto url = pdu_of(4, 3);
    const std::string text(url.begin() + 9, url.end());
    EXPECT_NE(text.find(":/"), std::string::npos) << text;
}

TEST(Identity, TheServerIdTellsWhetherTheNodeRuns) {
    const std::string text = std::string("tactiled ") + TACTILED_VERSION;
    for (const bool is_running : {true, false}) {
        Bytes expected{17, std::uint8_t(2 + text.size()), 'T', std::uint8_t(is_running ? 0xFF : 0)};
        expected.insert(expected.end(), text.begin(), text.end());
        EXPECT_EQ(answer_to({17}, is_running), expected);
    }
}

}  // namespace
}  // namespace tactiled::modbus
