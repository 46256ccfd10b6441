// libmodbus answers what writes, and what reads bits: it gets a checked request by a call and writes its answer to one end
// of a socket pair, the other end of which is ours: a packet an answer, so that nothing of one is left for the next
// request. It never sees a client. Reads of registers, which a PLC asks for all the time, do not come here: wall.hpp,
// registers_adu().
#pragma once
#include <modbus.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "node/modbus/request_validator.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::modbus {

// The whole map by address, as libmodbus wants it. Only what a request reads needs to be filled in.
struct Tables {
    std::array<std::uint16_t, kMapEnd> registers{};
    std::array<std::uint8_t, kCoils> coils{};
    std::array<std::uint8_t, kInputs> inputs{};
};

// Whether `answer` is to `request`: of the same transaction, protocol and unit, and as long as it says. rt: wait-free
[[nodiscard]] bool is_answer_to(std::span<const std::uint8_t> request, std::span<const std::uint8_t> answer) noexcept;

class Responder {
public:
    // setup: throws SetupError where libmodbus or a socket pair cannot be had
    Responder();
    ~Responder();
    Responder(const Responder&) = delete;
    Responder& operator=(const Responder&) = delete;

    // The answer to a request that check_adu() found good. What it writes, it writes into `tables`. Returns its length in
    // `out`; where libmodbus gives none or a wrong one, exception 4.
    std::size_t answer(std::span<const std::uint8_t> adu, Tables& tables, std::span<std::uint8_t, kMaxAdu> out) noexcept;

private:
    struct Free {
        void operator()(modbus_t* context) const noexcept { modbus_free(context); }
    };
    std::unique_ptr<modbus_t, Free> context_;
    std::array<int, 2> pair_{-1, -1};
};

}  // namespace tactiled::modbus
