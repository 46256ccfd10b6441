// PLC.md: the registers that a PLC reads before, during and after each fault. Made by the simulated world, equal on
// every machine.
#pragma once
#include <string>

namespace tactiled::faults {

std::string plc_page();

}  // namespace tactiled::faults
