// What we answer ourselves is, byte by byte, what libmodbus answers.
#include "node/modbus/responder.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace tactiled::modbus {
namespace {

RC_GTEST_PROP(Responder, RegistersAreAnsweredAsLibmodbusDoes, ()) {
    static Responder responder;
    const auto& areas_ = areas();
    const Area& area = areas_[*rc::gen::inRange<std::size_t>(0, areas_.size())];
    const auto at = *rc::gen::inRange<std::uint16_t>(area.at, std::uint16_t(area.at + area.size));
    const auto most = std::min(125, area.at + area.size - at);
    const auto count = *rc::gen::inRange<std::uint16_t>(1, std::uint16_t(most + 1));
    const auto function = std::uint8_t(*rc::gen::element(kReadHolding, kReadInputRegisters));
    const auto transaction = *rc::gen::arbitrary<std::uint16_t>();
    const std::vector<std::uint8_t> adu{std::uint8_t(transaction >> 8),
                                        std::uint8_t(transaction),
                                        0,
                                        0,
                                        0,
                                        6,
                                        *rc::gen::arbitrary<std::uint8_t>(),
                                        function,
                                        std::uint8_t(at >> 8),
                                        std::uint8_t(at),
                                        std::uint8_t(count >> 8),
                                        std::uint8_t(count)};
    Tables tables;
    for (unsigned i = 0; i < count; ++i) tables.registers[at + i] = *rc::gen::arbitrary<std::uint16_t>();

    std::array<std::uint8_t, kMostAdu> ours{}, theirs{};
    const std::size_t n = registers_adu(adu, std::span(tables.registers).subspan(at, count), ours);
    RC_ASSERT(n == responder.answer(adu, tables, theirs));
    RC_ASSERT(std::equal(ours.begin(), ours.begin() + std::ptrdiff_t(n), theirs.begin()));
}

}  // namespace
}  // namespace tactiled::modbus
