// The register map for a PLC, made from node/modbus/table.hpp.
#pragma once
#include <string>
#include <string_view>

namespace tactiled::ctl {

// Returns types, constants, and function blocks that unpack the global block, the first `sensors` sensor blocks and
// the grasp block, that send commands, and that join the pages of an array of up to `values` values.
std::string map_structured_text(unsigned sensors, unsigned values);

// Parts of that text: the last two function blocks, and the statements that find the newtons of one count of a force.
std::string structured_commands();
std::string structured_arrays(unsigned values);
void find_unit(std::string& out, std::string_view scale, std::string_view unit, std::string_view indent);

}  // namespace tactiled::ctl
