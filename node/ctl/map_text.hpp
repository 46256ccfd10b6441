// The register map as text, in each of its forms; all from node/modbus/table.hpp.
#pragma once
#include <string>

namespace tactiled::ctl {

std::string map_markdown();
std::string map_csv();
std::string map_json();
std::string map_manual_page();
// Types, and a function block that unpacks the global block and the first `sensors` sensor blocks.
std::string map_structured_text(unsigned sensors);

}  // namespace tactiled::ctl
