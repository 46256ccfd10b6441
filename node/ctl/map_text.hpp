// The register map for a PLC, made from node/modbus/table.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "node/modbus/table.hpp"

namespace tactiled::ctl {

// A register that an area copies from another one: "tool.FX", or "sensor1.FX" where its block repeats.
struct CopiedRegister {
    std::string name;
    unsigned at;  // its address in the area
    const modbus::Register* row;
    const modbus::Area* origin;
};
std::vector<CopiedRegister> copied_registers(const modbus::Area& area);

// Returns types, constants, and function blocks that unpack the global block, the first `sensors` sensor blocks and
// the grasp block, that send commands, and that join the pages of an array of up to `values` values.
std::string map_structured_text(unsigned sensors, unsigned values);

// Parts of that text: the last two function blocks, and the statements that find the newtons of one count of a force.
std::string structured_commands();
std::string structured_arrays(unsigned values);
void find_unit(std::string& out, std::string_view scale, std::string_view unit, std::string_view indent);

}  // namespace tactiled::ctl
