// The register map for a PLC, made from node/modbus/table.hpp.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "node/modbus/table.hpp"

namespace tactiled::ctl {

// A read whose values are handed out is at most so old, by the controller's clock and since its arrival. The promise is that
// no value is used 1 s after the daemon built the answer; up to 100 ms pass before the arrival (the time-out of a request,
// on the pages of the controllers), and up to 100 ms after the call that hands the value out (the period of the slowest
// task).
inline constexpr unsigned kFresh_ms = 1000 - 100 - 100;

// A register that an area copies from another one: "tool.FX", or "sensor1.FX" where its block repeats.
struct CopiedRegister {
    std::string name;
    unsigned at;  // its address in the area
    const modbus::Register* row;
    const modbus::Area* origin;
};
std::vector<CopiedRegister> copied_registers(const modbus::Area& area);

// Returns types, constants and function blocks in structured text: for the view and the sensors, for commands and hints, and
// one that joins the pages of an array of up to `values` values.
std::string map_structured_text(unsigned values);
// Returns the same text as a source of TIA Portal (SCL): with UDTs, VERSION and BEGIN, without named array types.
std::string scl_of(std::string_view structured_text);

// Parts of that text.
std::string structured_read();
std::string structured_values();
std::string structured_write();
std::string structured_arrays(unsigned values);
// Returns kFresh_ms as a literal.
std::string fresh();
// Appends a field or a variable, the output FRESH, or the statements that find the newtons of one count of a force.
void put_field(std::string& out, std::string_view name, std::string_view type, std::string_view meaning);
void put_fresh(std::string& out);
void find_unit(std::string& out, std::string_view scale, std::string_view unit, std::string_view indent);

}  // namespace tactiled::ctl
