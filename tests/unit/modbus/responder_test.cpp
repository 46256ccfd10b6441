// Each answer is sent in one piece, in the framing of its request, and libmodbus never gets a request for which it
// would sleep.
#include "node/modbus/responder.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <chrono>
#include <vector>

#include "answer_socket.hpp"
#include "drivers/wire/modbus_message.hpp"

namespace tactiled::modbus {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes framed(ModbusWire wire, const Bytes& pdu, std::uint8_t unit = 9) {
    Bytes request{0x12, 0x34, 0, 0, 0, std::uint8_t(pdu.size() + 1), unit};
    if (wire == ModbusWire::rtu) request = {unit};
    request.insert(request.end(), pdu.begin(), pdu.end());
    if (wire == ModbusWire::tcp) return request;
    const std::uint16_t crc = modbus_crc(request);
    request.insert(request.end(), {std::uint8_t(crc & 0xFF), std::uint8_t(crc >> 8)});
    return request;
}

class ResponderTest : public testing::TestWithParam<ModbusWire> {
protected:
    ResponderTest() : responder_(GetParam()) { responder_.set_descriptor(socket_.fd()); }
    Bytes framed(const Bytes& pdu, std::uint8_t unit = 9) const { return modbus::framed(GetParam(), pdu, unit); }
    Bytes taken(std::size_t sent) {
        Bytes bytes(300);
        bytes.resize(socket_.take(bytes));
        EXPECT_EQ(bytes.size(), sent);
        return bytes;
    }
    Bytes reply(const Bytes& pdu) { return taken(responder_.reply(framed(pdu), tables_)); }
    Bytes refuse(const Bytes& pdu, Exception e) { return taken(responder_.refuse(framed(pdu), e)); }

    test::AnswerSocket socket_;
    Responder responder_;
    Tables tables_;
};

INSTANTIATE_TEST_SUITE_P(Wires, ResponderTest, testing::Values(ModbusWire::tcp, ModbusWire::rtu),
                         [](const auto& each) { return each.param == ModbusWire::tcp ? "tcp" : "rtu"; });

TEST_P(ResponderTest, AnswersEachFunctionThatReadsAndWrites) {
    tables_.registers[40] = 0x1234;
    tables_.registers[41] = 0xFEDC;
    tables_.coils[1] = tables_.inputs[0] = tables_.inputs[9] = 1;
    EXPECT_EQ(reply({1, 0, 0, 0, 3}), framed({1, 1, 2}));
    EXPECT_EQ(reply({2, 0, 0, 0, 10}), framed({2, 2, 1, 2}));
    for (const auto function : {std::uint8_t(3), std::uint8_t(4)})
        EXPECT_EQ(reply({function, 0, 40, 0, 2}), framed({function, 4, 0x12, 0x34, 0xFE, 0xDC}));
    for (const Bytes& same : {Bytes{5, 0, 33, 0xFF, 0}, Bytes{6, 0x13, 0xEC, 1, 2}, Bytes{22, 0x13, 0xEC, 1, 2, 3, 4}})
        EXPECT_EQ(reply(same), framed(same));
    EXPECT_EQ(reply({15, 0, 0, 0, 9, 2, 1, 0}), framed({15, 0, 0, 0, 9}));
    EXPECT_EQ(reply({16, 0x13, 0xEC, 0, 2, 4, 0, 1, 0, 2}), framed({16, 0x13, 0xEC, 0, 2}));
}

TEST_P(ResponderTest, AReadBesideAWriteTellsWhatControlsSayOfTheCellsThatWereWritten) {
    tables_.registers[kTareCell] = 0;  // reads 0 for any written value
    EXPECT_EQ(reply({23, kTareCell >> 8, kTareCell & 0xFF, 0, 1, kTareCell >> 8, kTareCell & 0xFF, 0, 1, 2, 0, 1}),
              framed({23, 2, 0, 0}));
    Bytes longest{23, 0, 100, 0, 125, 0x13, 0xEC, 0, 121, 242};
    longest.resize(10 + 242, 0xAA);
    Bytes answer{23, 250};
    answer.resize(252);
    EXPECT_EQ(reply(longest), framed(answer));
    EXPECT_EQ(reply({3, 0x23, 0x28, 0, 12}), framed([] {
                  Bytes zeros{3, 24};
                  zeros.resize(26);
                  return zeros;
              }()));  // the cells before those that it wrote to
}

TEST_P(ResponderTest, AnExceptionHasTheFunctionAndItsHighBit) {
    EXPECT_EQ(refuse({3, 0, 99, 0, 1}, kIllegalAddress), framed({0x83, 2}));
    EXPECT_EQ(refuse({0}, kIllegalFunction), framed({0x80, 1}));
    EXPECT_EQ(refuse({6, 0, 0, 0, 0}, kBusy), framed({0x86, 6}));
    for (const auto function :
         {std::uint8_t(0x80), std::uint8_t(0x83), std::uint8_t(0xFF)})  // libmodbus alone would clear the bit
        EXPECT_EQ(refuse({function, 0, 0, 0, 1}, kIllegalFunction), framed({function, 1}));
}

TEST_P(ResponderTest, SendsAPduAsLongAsThereCanBe) {
    Bytes pdu(kMaxPdu, 7);
    EXPECT_EQ(taken(responder_.send(framed({8, 0, 0, 1, 2}), pdu)), framed(pdu));
}

TEST_P(ResponderTest, OnlyALineHasBroadcasts) {
    const bool is_line = GetParam() == ModbusWire::rtu;
    for (const Bytes& request : {framed({3, 0, 0, 0, 1}, 0), framed({6, 0x13, 0xEC, 0, 1}, 0)}) {
        const std::size_t sizes[] = {responder_.reply(request, tables_), responder_.refuse(request, kIllegalAddress),
                                     responder_.send(request, Bytes{8, 0, 0, 1, 2})};
        for (const std::size_t size : sizes) {
            EXPECT_EQ(size == 0, is_line);
            EXPECT_EQ(taken(size).empty(), is_line);
        }
    }
}

TEST_P(ResponderTest, AFullSocketIsReportedAndDelaysNobody) {
    const Bytes request = framed({4, 0, 100, 0, 125});
    const auto began = std::chrono::steady_clock::now();
    int sent = 0;
    while (responder_.reply(request, tables_) != 0 && sent < 100'000) ++sent;
    EXPECT_GT(sent, 16);
    EXPECT_LT(sent, 100'000);
    EXPECT_EQ(responder_.refuse(request, kBusy), 0u);
    EXPECT_EQ(responder_.send(request, Bytes{8, 0, 0, 1, 2}), 0u);
    EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(5)) << "it slept";
}

// libmodbus answers any PDU that the validator accepts with the requested function, and refuses none of them.
RC_GTEST_PROP(Responder, LibmodbusRefusesNothingThatTheValidatorLetsThrough, ()) {
    const auto wire = *rc::gen::element(ModbusWire::tcp, ModbusWire::rtu);
    const auto word = [](int from, int to) { return *rc::gen::inRange(from, to); };
    const auto& area = areas()[std::size_t(word(0, int(areas().size())))];
    const int at = word(area.at, area.at + area.size), count = word(1, 126), to = word(4998, 5230), n = word(1, 122);
    const auto high = [](int value) { return std::uint8_t(value >> 8); };
    const auto low = [](int value) { return std::uint8_t(value); };
    const auto function = *rc::gen::element<std::uint8_t>(1, 2, 3, 4, 5, 6, 15, 16, 22, 23);
    Bytes pdu{function};
    switch (function) {
        case 1:
        case 2: pdu.insert(pdu.end(), {0, low(word(0, 70)), 0, low(word(1, 70))}); break;
        case 3:
        case 4: pdu.insert(pdu.end(), {high(at), low(at), high(count), low(count)}); break;
        case 5: pdu.insert(pdu.end(), {0, low(word(0, 36)), low(255 * word(0, 2)), 0}); break;
        case 6: pdu.insert(pdu.end(), {high(to), low(to), 1, 2}); break;
        case 15: pdu.insert(pdu.end(), {0, low(word(0, 30)), 0, 8, 1, 0xFF}); break;
        case 16: pdu.insert(pdu.end(), {high(to), low(to), high(n), low(n), low(2 * n)}); break;
        case 22: pdu.insert(pdu.end(), {high(to), low(to), 1, 2, 3, 4}); break;
        default:
            pdu.insert(pdu.end(),
                       {high(at), low(at), high(count), low(count), high(to), low(to), high(n), low(n), low(2 * n)});
    }
    if (function == 16 || function == 23) pdu.resize(pdu.size() + 2u * unsigned(n));
    RC_PRE(check_pdu(pdu, true).exception == kNone);

    test::AnswerSocket socket;
    Responder responder(wire);
    responder.set_descriptor(socket.fd());
    Tables tables;
    std::array<std::uint8_t, kMaxAdu> out{};
    const std::size_t sent = responder.reply(framed(wire, pdu), tables);
    RC_ASSERT(sent != 0u);
    RC_ASSERT(socket.take(out) == sent);
    RC_ASSERT(responder.pdu_of(std::span(out).first(sent))[0] == function);
}

}  // namespace
}  // namespace tactiled::modbus
