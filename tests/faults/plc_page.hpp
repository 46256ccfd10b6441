// PLC.md: what a PLC reads before, in and after each fault. Made by the simulated world, the same everywhere.
#pragma once
#include <string>

namespace tactiled::faults {

std::string plc_page();

}  // namespace tactiled::faults
