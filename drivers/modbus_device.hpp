// Configuration of one Modbus device: a [[link.slave]] table, or a file of registers that it names.
#pragma once
#include <cstdint>
#include <vector>

#include "config/options.hpp"
#include "drivers/wire/modbus_message.hpp"
#include "drivers/wire/register_set.hpp"

namespace tactiled {

struct ModbusDevice {
    std::uint16_t device = 0;  // Frame::device
    std::uint8_t unit = 1, function = 3;
    double rate_Hz = 0;
    RegisterSet set;
    struct Write {
        std::uint16_t at, value;
        std::uint8_t function;
    };
    std::vector<Write> start;  // written before the first reading, and after each request without a good answer
};

// Reads one device. Errors go to the options' Problems. setup: never throws for bad input
ModbusDevice read_modbus_device(Options table, ModbusWire wire);

}  // namespace tactiled
