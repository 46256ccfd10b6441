// The server's identity: functions 43 / 14 and 17 (Modbus Application Protocol 1.1b3, 6.21 and 6.13). libmodbus does not
// implement the first, and answers the second with its own name and version.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "node/modbus/request_validator.hpp"

namespace tactiled::modbus {

class Identity {
public:
    // `node_name` is reported as UserApplicationName.
    explicit Identity(const std::string& node_name);
    // Writes the PDU that answers a request of one of these functions that check_pdu() has accepted. `is_running` is
    // the run indicator of function 17. Returns its length in `out`. rt: wait-free
    std::size_t answer(std::span<const std::uint8_t> pdu, bool is_running,
                       std::span<std::uint8_t, kMaxPdu> out) const noexcept;

private:
    std::array<std::string, kIdentityObjects> objects_;  // indexed by object id
};

}  // namespace tactiled::modbus
