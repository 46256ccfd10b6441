// The register map for a PLC, made from node/modbus/table.hpp.
#pragma once
#include <string>

namespace tactiled::ctl {

// Returns types, constants, and function blocks that unpack the global block, the first `sensors` sensor blocks and
// the grasp block, and that send commands.
std::string map_structured_text(unsigned sensors);
// Returns the last of these function blocks, a part of that text.
std::string structured_commands();

}  // namespace tactiled::ctl
