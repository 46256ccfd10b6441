// The master's side of Modbus, RTU and TCP: requests to bytes, bytes to answers. Pure, no I/O, bounded.
//
// An answer must belong to the open request. In TCP the transaction number shows that. RTU has only unit, function
// and length, so the caller requests another length if an earlier answer may still arrive (drivers/modbus.cpp).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/wire/modbus_codes.hpp"
#include "tactiled/layout.h"

namespace tactiled {

inline constexpr std::size_t kModbusMaxRequest = 15;  // bytes

struct ModbusRequest {
    std::uint16_t transaction = 0;  // sent over TCP alone
    std::uint8_t unit = 1;
    std::uint8_t function = modbus::kReadHolding;  // 3 and 4 read `count` registers, 6 and 16 write one: `value`
    std::uint16_t at = 0, count = 1, value = 0;
};

// The CRC-16 of Modbus RTU, sent low byte first.
std::uint16_t modbus_crc(std::span<const std::uint8_t> bytes) noexcept;

// Encodes a request. Returns the number of bytes. rt: wait-free
std::size_t encode_modbus(ModbusWire wire, const ModbusRequest& request,
                          std::span<std::uint8_t, kModbusMaxRequest> out) noexcept;

// Number of bytes of the answer, including RTU's CRC or TCP's header.
std::size_t modbus_answer_bytes(ModbusWire wire, const ModbusRequest& request) noexcept;

// Collects the bytes of a line or a connection and finds the answer to the open request in them.
class ModbusAnswers {
public:
    enum class Found {
        nothing,       // no answer yet
        good,          // registers() has the values, or the write was confirmed
        refused,       // exception() has the reason
        wrong_length,  // an answer with another number of registers than requested
        foreign,       // an answer of another unit or function with the open transaction number
        broken,        // TCP: not Modbus, and the begin of the next message is unknown
    };

    explicit ModbusAnswers(ModbusWire wire) noexcept : wire_(wire) {}

    // Discards the bytes of the old connection. rt: wait-free
    void reset() noexcept;
    // Opens a request; one at a time. RTU discards earlier bytes. rt: wait-free
    void expect(const ModbusRequest& request) noexcept;
    // Returns the buffer for the next bytes, never empty; took() adds the number of bytes that were written to it.
    // rt: wait-free
    std::span<std::uint8_t> room() noexcept { return std::span(bytes_).subspan(size_); }
    void took(std::size_t n) noexcept { size_ += n; }
    // Searches the received bytes; a result other than `nothing` closes the request. rt: bounded by the received bytes
    Found next() noexcept;
    // Returns the counter for a request without an answer. rt: wait-free
    [[nodiscard]] tactiled_link_count missing() const noexcept;

    [[nodiscard]] std::span<const std::uint16_t> registers() const noexcept { return {registers_.data(), n_registers_}; }
    [[nodiscard]] std::uint8_t exception() const noexcept { return exception_; }
    std::uint32_t skipped = 0;  // bytes that were part of no answer; the caller resets the number

private:
    Found next_rtu() noexcept;
    Found next_tcp() noexcept;
    // Judges the message at `pdu` (unit first) as an answer to the request, `size` bytes without CRC.
    Found judge(const std::uint8_t* pdu, std::size_t size) noexcept;
    void drop(std::size_t n) noexcept;

    ModbusWire wire_;
    ModbusRequest request_;
    bool open_ = false;
    bool checksum_failed_ = false, other_length_ = false, echo_seen_ = false;  // since expect()
    bool line_echoes_ = false;  // the line echoes sent bytes, as seen in the last read
    std::array<std::uint8_t, kModbusMaxRequest> sent_{};
    std::size_t n_sent_ = 0;
    std::array<std::uint8_t, 1024> bytes_{};  // the longest answer has 260
    std::size_t size_ = 0;
    std::array<std::uint16_t, modbus::kMaxRead> registers_{};
    std::size_t n_registers_ = 0;
    std::uint8_t exception_ = 0;
};

}  // namespace tactiled
