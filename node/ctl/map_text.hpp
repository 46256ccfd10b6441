// The register map as text, in each of its forms; all are made from node/modbus/table.hpp.
#pragma once
#include <string>

namespace tactiled::ctl {

std::string map_markdown();
std::string map_csv();
std::string map_json();
std::string map_manual_page();
// Returns types, constants, and function blocks that unpack the global block, the first `sensors` sensor blocks and
// the grasp block, and that send commands.
std::string map_structured_text(unsigned sensors);
// Returns the last of these function blocks, a part of that text.
std::string structured_commands();

}  // namespace tactiled::ctl
