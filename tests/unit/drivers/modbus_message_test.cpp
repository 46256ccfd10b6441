// Modbus requests and answers as bytes: examples of the standard, libmodbus as a reference, hostile answers.
#include <gtest/gtest.h>
#include <modbus/modbus.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <random>
#include <vector>

#include "drivers/wire/modbus_message.hpp"

namespace tactiled {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Found = ModbusAnswers::Found;

Bytes request_bytes(ModbusWire wire, const ModbusRequest& request) {
    std::array<std::uint8_t, kModbusMaxRequest> out;
    const std::size_t size = encode_modbus(wire, request, out);
    return {out.begin(), out.begin() + std::ptrdiff_t(size)};
}

Bytes with_crc(Bytes bytes) {
    const std::uint16_t crc = modbus_crc(bytes);
    bytes.push_back(std::uint8_t(crc));
    bytes.push_back(std::uint8_t(crc >> 8));
    return bytes;
}

Bytes with_header(std::uint16_t transaction, Bytes body) {
    Bytes bytes{std::uint8_t(transaction >> 8), std::uint8_t(transaction), 0, 0, 0, std::uint8_t(body.size())};
    bytes.insert(bytes.end(), body.begin(), body.end());
    return bytes;
}

void feed(ModbusAnswers& answers, const Bytes& bytes) {
    ASSERT_LE(bytes.size(), answers.room().size());
    std::copy(bytes.begin(), bytes.end(), answers.room().begin());
    answers.took(bytes.size());
}

const ModbusRequest kThree{.transaction = 7, .unit = 9, .function = 3, .at = 180, .count = 3};
const Bytes kThreeBody{9, 3, 6, 0, 1, 0xFF, 0xFE, 0, 3};

TEST(ModbusMessage, IsTheExampleOfTheFt300sManual) {
    // Requests the stream: register 410 := 0x0200 with function 16.
    EXPECT_EQ(request_bytes(ModbusWire::rtu, {.unit = 9, .function = 16, .at = 410, .value = 0x0200}),
              (Bytes{0x09, 0x10, 0x01, 0x9A, 0x00, 0x01, 0x02, 0x02, 0x00, 0xCD, 0xCA}));
}

// libmodbus answers at the other end of a socket pair, from registers that contain their own address.
class Witness {
public:
    explicit Witness(ModbusWire wire)
        : context_(wire == ModbusWire::tcp ? ::modbus_new_tcp("127.0.0.1", 1502)
                                           : ::modbus_new_rtu("/dev/null", 9600, 'N', 8, 1)),
          map_(::modbus_mapping_new(0, 0, 300, 300)) {
        EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends_), 0);
        ::modbus_set_socket(context_, ends_[1]);
        ::modbus_set_slave(context_, 9);
        for (std::uint16_t i = 0; i < 300; ++i) {
            map_->tab_registers[i] = i;
            map_->tab_input_registers[i] = std::uint16_t(1000 + i);
        }
    }
    ~Witness() {
        ::modbus_mapping_free(map_);
        ::modbus_free(context_);
        ::close(ends_[0]);
        ::close(ends_[1]);
    }
    Bytes answer(const Bytes& request) {
        EXPECT_EQ(::write(ends_[0], request.data(), request.size()), ssize_t(request.size()));
        std::uint8_t received[MODBUS_TCP_MAX_ADU_LENGTH];
        const int size = ::modbus_receive(context_, received);
        EXPECT_EQ(size, int(request.size()));
        EXPECT_GT(::modbus_reply(context_, received, size, map_), 0);
        Bytes out(300);
        out.resize(std::size_t(std::max<ssize_t>(0, ::read(ends_[0], out.data(), out.size()))));
        return out;
    }
    std::uint16_t holding(int at) const { return map_->tab_registers[at]; }

private:
    modbus_t* context_;
    modbus_mapping_t* map_;
    int ends_[2];
};

class BothWires : public testing::TestWithParam<ModbusWire> {};
INSTANTIATE_TEST_SUITE_P(Modbus, BothWires, testing::Values(ModbusWire::rtu, ModbusWire::tcp),
                         [](const auto& wire) { return wire.param == ModbusWire::rtu ? "Rtu" : "Tcp"; });

TEST_P(BothWires, AreSpokenAsLibmodbusSpeaksThem) {
    Witness slave(GetParam());
    ModbusAnswers answers(GetParam());
    for (const std::uint8_t function : std::initializer_list<std::uint8_t>{3, 4})
        for (const std::uint16_t count : std::initializer_list<std::uint16_t>{1, 2, 6, 125}) {
            const ModbusRequest request{.transaction = count, .unit = 9, .function = function, .at = 100, .count = count};
            answers.expect(request);
            const Bytes bytes = slave.answer(request_bytes(GetParam(), request));
            EXPECT_EQ(bytes.size(), modbus_answer_bytes(GetParam(), request));
            feed(answers, bytes);
            ASSERT_EQ(answers.next(), Found::good);
            ASSERT_EQ(answers.registers().size(), count);
            EXPECT_EQ(answers.registers()[count - 1u], (function == 4 ? 1000 : 0) + 100 + count - 1);
        }
    for (const std::uint8_t function : std::initializer_list<std::uint8_t>{6, 16}) {
        const ModbusRequest request{
            .transaction = 5, .unit = 9, .function = function, .at = 7, .value = std::uint16_t(0x200 + function)};
        answers.expect(request);
        feed(answers, slave.answer(request_bytes(GetParam(), request)));
        EXPECT_EQ(answers.next(), Found::good);
        EXPECT_EQ(slave.holding(7), 0x200 + function);
    }
    const ModbusRequest beyond{.transaction = 6, .unit = 9, .function = 3, .at = 400, .count = 1};
    answers.expect(beyond);
    feed(answers, slave.answer(request_bytes(GetParam(), beyond)));
    EXPECT_EQ(answers.next(), Found::refused);
    EXPECT_EQ(answers.exception(), 2);  // illegal data address
    EXPECT_EQ(answers.skipped, 0u);
}

TEST_P(BothWires, AnAnswerInSingleBytesIsTheSame) {
    ModbusAnswers answers(GetParam());
    answers.expect(kThree);
    const Bytes whole = GetParam() == ModbusWire::rtu ? with_crc(kThreeBody) : with_header(7, kThreeBody);
    for (std::size_t i = 0; i < whole.size(); ++i) {
        feed(answers, {whole[i]});
        EXPECT_EQ(answers.next(), i + 1 < whole.size() ? Found::nothing : Found::good);
    }
    EXPECT_EQ(answers.registers()[1], 0xFFFE);
}

TEST(ModbusRtu, NoiseBeforeAnAnswerAndTheEchoOfTheRequestCostNothing) {
    ModbusAnswers answers(ModbusWire::rtu);
    answers.expect(kThree);
    Bytes all = request_bytes(ModbusWire::rtu, kThree);  // an adapter with an echo
    for (const std::uint8_t byte : std::initializer_list<std::uint8_t>{0xFF, 0x00, 0x09}) all.push_back(byte);
    const std::size_t before = all.size();
    for (const std::uint8_t byte : with_crc(kThreeBody)) all.push_back(byte);
    feed(answers, all);
    EXPECT_EQ(answers.next(), Found::good);
    EXPECT_EQ(answers.skipped, before);
}

TEST(ModbusRtu, AnEchoIsNeverTheAnswerAlsoWhereItsBytesWouldFit) {
    // Tries all requests for one register whose first seven bytes are a whole answer with a valid CRC.
    unsigned tried = 0;
    for (unsigned unit = 1; unit <= 247; ++unit)
        for (const std::uint8_t function : std::initializer_list<std::uint8_t>{3, 4})
            for (unsigned low = 0; low < 256; ++low) {
                const ModbusRequest request{
                    .unit = std::uint8_t(unit), .function = function, .at = std::uint16_t(0x200 + low), .count = 1};
                const Bytes echo = request_bytes(ModbusWire::rtu, request);
                const std::uint16_t crc = modbus_crc(std::span(echo).first(5));
                if (echo[5] != (crc & 0xFF) || echo[6] != crc >> 8) continue;
                ++tried;
                for (const std::size_t cut : std::initializer_list<std::size_t>{7, 8}) {
                    ModbusAnswers answers(ModbusWire::rtu);
                    answers.expect(request);
                    feed(answers, {echo.begin(), echo.begin() + std::ptrdiff_t(cut)});
                    EXPECT_EQ(answers.next(), Found::nothing);
                    feed(answers, {echo.begin() + std::ptrdiff_t(cut), echo.end()});
                    EXPECT_EQ(answers.next(), Found::nothing);
                    EXPECT_EQ(answers.missing(), TACTILED_LINK_BUS_ERROR);
                    feed(answers, with_crc({request.unit, function, 2, 0x12, 0x34}));
                    ASSERT_EQ(answers.next(), Found::good);
                    EXPECT_EQ(answers.registers()[0], 0x1234);
                }
            }
    EXPECT_GT(tried, 0u);
}

TEST(ModbusRtu, OnALineThatEchoesAWriteIsConfirmedByTheSecondCopyAlone) {
    const ModbusRequest write{.unit = 9, .function = 6, .at = 1, .value = 2};
    for (const bool echoes : {true, false}) {
        ModbusAnswers answers(ModbusWire::rtu);
        answers.expect(kThree);
        if (echoes) feed(answers, request_bytes(ModbusWire::rtu, kThree));
        feed(answers, with_crc(kThreeBody));
        ASSERT_EQ(answers.next(), Found::good);
        answers.expect(write);
        feed(answers, request_bytes(ModbusWire::rtu, write));
        EXPECT_EQ(answers.next(), echoes ? Found::nothing : Found::good);
        if (!echoes) continue;
        feed(answers, request_bytes(ModbusWire::rtu, write));
        EXPECT_EQ(answers.next(), Found::good);
    }
}

TEST(ModbusRtu, TheEchoOfARequestThatASilentUnitDidNotAnswerIsNoAnswerOfAnotherLength) {
    ModbusAnswers answers(ModbusWire::rtu);
    answers.expect(kThree);
    feed(answers, request_bytes(ModbusWire::rtu, kThree));
    EXPECT_EQ(answers.next(), Found::nothing);
    EXPECT_EQ(answers.missing(), TACTILED_LINK_BUS_ERROR);
}

TEST(ModbusRtu, OfOtherUnitsFunctionsLengthsAndChecksumsNothingIsTaken) {
    struct Case {
        Bytes bytes;
        tactiled_link_count counted;
    };
    Bytes flipped = with_crc(kThreeBody);
    flipped[5] ^= 0x10;
    Bytes cut = with_crc(kThreeBody);
    cut.resize(7);
    for (const Case& c :
         {Case{with_crc({8, 3, 6, 0, 1, 0, 2, 0, 3}), TACTILED_LINK_BUS_ERROR},
          Case{with_crc({9, 4, 6, 0, 1, 0, 2, 0, 3}), TACTILED_LINK_BUS_ERROR},
          Case{with_crc({9, 3, 4, 0, 1, 0, 2}), TACTILED_LINK_BAD_LENGTH},
          Case{with_crc({9, 3, 8, 0, 1, 0, 2, 0, 3, 0, 4}), TACTILED_LINK_BAD_LENGTH}, Case{cut, TACTILED_LINK_BAD_LENGTH},
          Case{flipped, TACTILED_LINK_BAD_CHECKSUM}, Case{{}, TACTILED_LINK_BUS_ERROR}}) {
        ModbusAnswers answers(ModbusWire::rtu);
        answers.expect(kThree);
        feed(answers, c.bytes);
        EXPECT_EQ(answers.next(), Found::nothing);
        EXPECT_EQ(answers.missing(), c.counted) << c.bytes.size() << " bytes";
    }
}

TEST(ModbusRtu, AnyBitFlippedInAnAnswerIsSeen) {
    const Bytes good = with_crc(kThreeBody);
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
        Bytes bytes = good;
        bytes[bit / 8] = std::uint8_t(bytes[bit / 8] ^ 1u << bit % 8);
        ModbusAnswers answers(ModbusWire::rtu);
        answers.expect(kThree);
        feed(answers, bytes);
        EXPECT_EQ(answers.next(), Found::nothing) << "bit " << bit;
    }
}

TEST(ModbusTcp, ALateAnswerIsPassedOverAndTheOneBehindItTaken) {
    ModbusAnswers answers(ModbusWire::tcp);
    answers.expect(kThree);
    Bytes bytes = with_header(6, {9, 3, 6, 0, 9, 0, 9, 0, 9});
    for (const std::uint8_t byte : with_header(7, kThreeBody)) bytes.push_back(byte);
    feed(answers, bytes);
    ASSERT_EQ(answers.next(), Found::good);
    EXPECT_EQ(answers.registers()[0], 1);
    EXPECT_EQ(answers.skipped, 15u);
    feed(answers, with_header(7, kThreeBody));  // again, without a request
    EXPECT_EQ(answers.next(), Found::nothing);
}

TEST(ModbusTcp, LooksAtUnitFunctionAndLength) {
    struct Case {
        Bytes body;
        Found found;
    };
    for (const Case& c :
         {Case{{8, 3, 6, 0, 1, 0, 2, 0, 3}, Found::foreign}, Case{{9, 4, 6, 0, 1, 0, 2, 0, 3}, Found::foreign},
          Case{{9, 3, 4, 0, 1, 0, 2}, Found::wrong_length}, Case{{9, 3, 4, 0, 1, 0, 2, 0, 3}, Found::wrong_length},
          Case{{9, 3, 6, 0, 1, 0, 2}, Found::wrong_length}, Case{{9, 3, 6, 0, 1, 0, 2, 0, 3, 0, 4}, Found::wrong_length},
          Case{{9, 0x83, 2}, Found::refused}, Case{{9, 0x83, 2, 0}, Found::wrong_length}}) {
        ModbusAnswers answers(ModbusWire::tcp);
        answers.expect(kThree);
        feed(answers, with_header(7, c.body));
        EXPECT_EQ(answers.next(), c.found);
    }
    for (const Bytes& bytes :
         {Bytes{0, 7, 0, 1, 0, 9, 9, 3}, Bytes{0, 7, 0, 0, 1, 0, 9, 3}, Bytes{0, 7, 0, 0, 0, 2, 9, 3}}) {
        ModbusAnswers answers(ModbusWire::tcp);
        answers.expect(kThree);
        feed(answers, bytes);
        EXPECT_EQ(answers.next(), Found::broken);
    }
}

TEST(ModbusRtu, AWriteIsConfirmedHoweverItsAnswerIsCut) {
    const ModbusRequest write{.transaction = 7, .unit = 9, .function = 6, .at = 410, .value = 512};
    const Bytes confirmed = request_bytes(ModbusWire::rtu, write);
    ModbusAnswers answers(ModbusWire::rtu);
    answers.expect(write);
    for (const std::uint8_t byte : Bytes(confirmed.begin(), confirmed.end() - 1)) {
        feed(answers, {byte});
        EXPECT_EQ(answers.next(), Found::nothing);
    }
    feed(answers, {confirmed.back()});
    EXPECT_EQ(answers.next(), Found::good);
    feed(answers, confirmed);  // once more, without a request
    EXPECT_EQ(answers.next(), Found::nothing);
    EXPECT_EQ(answers.skipped, confirmed.size());
}

TEST(ModbusTcp, AWriteIsConfirmedByItsOwnAddressAndValue) {
    const ModbusRequest write{.transaction = 7, .unit = 9, .function = 6, .at = 410, .value = 512};
    struct Case {
        Bytes body;
        Found found;
    };
    for (const auto& [body, found] : {Case{{9, 6, 1, 0x9A, 2, 0}, Found::good}, Case{{9, 6, 1, 0x9B, 2, 0}, Found::foreign},
                                      Case{{9, 6, 1, 0x9A, 2, 1}, Found::foreign}}) {
        ModbusAnswers answers(ModbusWire::tcp);
        answers.expect(write);
        feed(answers, with_header(7, body));
        EXPECT_EQ(answers.next(), found);
    }
}

}  // namespace
}  // namespace tactiled
