// The register map as text, in each of its forms; all from node/modbus/table.hpp.
#pragma once
#include <string>

namespace tactiled::ctl {

std::string map_markdown();
std::string map_csv();
std::string map_json();
std::string map_manual_page();
// Types, constants, and function blocks that unpack the global block, the first `sensors` sensor blocks and the grasp block,
// and that command.
std::string map_structured_text(unsigned sensors);
// The last of these function blocks, a part of that text.
std::string structured_commands();

}  // namespace tactiled::ctl
