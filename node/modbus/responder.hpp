// Sends all answers. libmodbus composes the answers to the functions that it knows, and all exceptions, and writes
// them to the client's socket or to the tty in one call. It never reads from them.
#pragma once
#include <modbus.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "node/modbus/request_validator.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::modbus {

// The whole map by address, in the layout of libmodbus. Only the cells that a request reads must be filled in.
struct Tables {
    std::array<std::uint16_t, kMapEnd + kMaxWriteBeside> registers{};  // the last cells: see Responder::reply()
    std::array<std::uint8_t, kCoils> coils{};
    std::array<std::uint8_t, kInputs> inputs{};
};

// Answers a whole request. Returns the number of bytes sent, or 0 if the answer was not sent completely or none is
// due.
using Answer = std::function<std::size_t(std::span<const std::uint8_t> request)>;

// One framing. A request is passed in this framing: with its MBAP header, or as an RTU frame with its checksum.
class Responder {
public:
    // setup: throws SetupError where libmodbus gives no context
    explicit Responder(ModbusWire wire);

    // Sets the non-blocking socket or tty of the following requests; the caller keeps ownership. rt: wait-free
    void set_descriptor(int fd) noexcept { modbus_set_socket(context_.get(), fd); }
    // rt: wait-free
    [[nodiscard]] std::span<const std::uint8_t> pdu_of(std::span<const std::uint8_t> request) const noexcept;

    // Each function sends one answer and returns the number of its bytes, or 0 if the kernel did not take all of
    // them, or if the request was a broadcast.

    // Sends the answer of libmodbus, from `tables`, to a request of functions 1 .. 6, 15, 16, 22 and 23 that
    // check_pdu() has accepted.
    // rt: one system call, does not block
    std::size_t reply(std::span<const std::uint8_t> request, Tables& tables) noexcept;
    // rt: one system call, does not block
    std::size_t refuse(std::span<const std::uint8_t> request, Exception exception) noexcept;
    // Sends an answer that the project composed. rt: one system call, does not block
    std::size_t send(std::span<const std::uint8_t> request, std::span<const std::uint8_t> pdu) noexcept;

private:
    struct Free {
        void operator()(modbus_t* context) const noexcept { modbus_free(context); }
    };
    [[nodiscard]] bool is_broadcast(std::span<const std::uint8_t> request) const noexcept {
        return wire_ == ModbusWire::rtu && request[0] == MODBUS_BROADCAST_ADDRESS;
    }
    ModbusWire wire_;
    std::unique_ptr<modbus_t, Free> context_;
};

}  // namespace tactiled::modbus
