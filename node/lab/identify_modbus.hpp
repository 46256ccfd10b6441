// `identify` for a Modbus device: reads a block of registers several times, and prints the keys that read it as numbers.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace tactiled::ctl {

// The registers of one type at one device, and how to reach it.
struct ModbusBlock {
    std::string name;   // the printed [[link]] has this name
    std::string wire;   // its keys: address, or device, baud and parity
    unsigned baud = 0;  // 0 over TCP
    unsigned unit = 1;
    unsigned function = 0;  // 3 or 4; 0: the first one that is answered
    std::uint16_t at = 0;
    std::size_t count = 0;  // 0: unknown
};

// Sets the registers from text, "100..105". setup: throws SetupError where it is no range, or one of more than 30 registers
void set_registers(ModbusBlock& block, const std::string& range);

// Returns the device at a path or ADDRESS:PORT. `baud` and `parity` are ignored for an address.
ModbusBlock modbus_device_at(const std::string& where, unsigned baud, const std::string& parity);

// Returns the first [[link.slave]] of a link of `config`, or the one at `unit`, with the registers of its channels; nullopt
// if the link is missing or has none. setup: throws SetupError where the link has errors
std::optional<ModbusBlock> modbus_device_of_link(const std::string& config, const std::string& link,
                                                 std::optional<std::size_t> unit);

// Reads the registers for `seconds`, prints the interpretations, and the [[link]] if one of them is clear. `type`: one that
// the manual states, or "". Returns kGood if one is clear.
// setup: throws std::runtime_error where the device does not answer
int identify_modbus(ModbusBlock block, double seconds, const std::string& type, bool json);

}  // namespace tactiled::ctl
