// Function 43 / 14, read device identification (Modbus Application Protocol 1.1b3, 6.21): libmodbus does not have it.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "node/modbus/request_validator.hpp"

namespace tactiled::modbus {

class Identity {
public:
    // `node_name` is told as UserApplicationName.
    explicit Identity(const std::string& node_name);
    // The answer to a request of function 43 / 14 that check_adu() found good.
    std::size_t answer(std::span<const std::uint8_t> adu, std::span<std::uint8_t, kMaxAdu> out) const noexcept;

private:
    std::array<std::string, 7> objects_;  // by object id
};

}  // namespace tactiled::modbus
