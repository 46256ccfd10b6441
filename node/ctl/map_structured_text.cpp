// The register map for a PLC: IEC 61131-3 structured text. The first call of each cycle takes what was read
// (map_structured_read.cpp); a second one, at the place of use, hands out the values while they are fresh
// (map_structured_values.cpp). Two more blocks write commands and hints, and join the pages of arrays.
//
// The text uses only features that CODESYS, TwinCAT and matiec accept: one field a line, named array types, explicit
// conversions, no bit access, no pointers, no enumerations, names of at most 40 characters. The only block that it takes
// from the standard library is TON, which is the controller's clock. map_structured_scl.cpp rewrites it for TIA Portal.
// tests/system/structured_text_test.py runs it against the daemon.
#include <fmt/format.h>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

// One constant for each bit and each value that has a name.
std::string structured_constants() {
    struct Group {
        const char *prefix, *of;
        bool is_bit;
    };
    constexpr Group kGroups[] = {{"STATUS", "global.STATUS", true},
                                 {"FAULT", "global.FAULT", true},
                                 {"WARN", "global.WARN", true},
                                 {"SENSOR", "sensor.STATUS", true},
                                 {"REASON", "sensor.FAULT", false},
                                 {"GRIP", "global.GRIP_STATE", false},
                                 {"WEIGHT", "global.WEIGHT_STATE", false},
                                 {"WHY", "doubt.WEIGHT_WHY", true},
                                 {"TOOL", "tool.STATUS", true},
                                 {"SLIP", "sensor.SLIP_STATE", false},
                                 {"CMD", "control.CMD", false},
                                 {"CMD_STATE", "global.CMD_STATE", false},
                                 {"RESULT", "global.CMD_RESULT", false},
                                 {"GRIPPER", "control.GRIPPER_STATE", false}};
    std::string out =
        "(* The names of bits and states. Declare one instance, C : FB_TACTILED_CONST, and read C.GRIP_HOLDING. SENSOR_ is "
        "for\n"
        "   STATUS and REASON_ for FAULT of a sensor. *)\nFUNCTION_BLOCK FB_TACTILED_CONST\nVAR_OUTPUT\n";
    for (const Group& group : kGroups)
        for (const Name& name : names_of(group.of)) {
            if (name.id.empty()) continue;
            const std::string value =
                group.is_bit ? fmt::format("WORD := 16#{:04X}", 1u << name.value) : fmt::format("UINT := {}", name.value);
            put_field(out, fmt::format("{}_{}", group.prefix, name.id), value, name.name);
        }
    return out +
           "    NOT_KNOWN : UINT := 65535; (* of a state *)\nEND_VAR\nVAR\n    WAS_CALLED : BOOL;\nEND_VAR\n\n"
           "WAS_CALLED := TRUE;\nEND_FUNCTION_BLOCK\n\n";
}

// tests/system/structured_text_test.py enforces the list.
constexpr char kHead[] =
    R"((* tactiled register map {major}.{minor}, printed by: tactilectl map --format st

   In every cycle, in a task of any period: read {size} registers from {view} into VIEW_REGS (FC 3 or 4), call FB_TACTILED, and
   then, where a value is used, FB_TACTILED_SENSOR, FB_TACTILED_WEIGHT, FB_TACTILED_WRENCH or FB_TACTILED_NODE. These blocks
   hand out values while the last good read is less than {fresh_s} s old by the controller's clock, whether the daemon, the
   network, the reading code or a call of a block has stopped. Use a value while OK is TRUE, in the cycle of that call. The age
   counts from the arrival of a read: give requests a time-out of at most 100 ms, and no value is used 1 s after its answer.

   It is written in this subset of IEC 61131-3: TYPE, ARRAY, OF, STRUCT, FUNCTION_BLOCK, VAR, VAR_INPUT, VAR_OUTPUT,
   initial values, IF, THEN, ELSIF, ELSE, FOR, TO, DO, AND, OR, NOT, := = <> < + - * /, BOOL, WORD, INT, UINT, UDINT,
   DINT, REAL, TIME, TON, WORD_TO_INT, WORD_TO_UINT, UINT_TO_WORD, INT_TO_WORD, INT_TO_REAL, UINT_TO_REAL, DINT_TO_REAL, REAL_TO_INT,
   INT_TO_DINT, UINT_TO_DINT, UINT_TO_UDINT. *)

)";

}  // namespace

void put_field(std::string& out, std::string_view name, std::string_view type, std::string_view meaning) {
    out += fmt::format("    {} : {};", name, type);
    if (!meaning.empty()) out += fmt::format(" (* {} *)", meaning);
    out += "\n";
}

std::string fresh() { return fmt::format("T#{}ms", kFresh_ms); }

void put_fresh(std::string& out) {
    put_field(out, "FRESH", "BOOL",
              fmt::format("the read is less than {} s old; otherwise nothing is known", kFresh_ms / 1e3));
}

std::string map_structured_text(unsigned values) {
    std::string out =
        fmt::format(kHead, fmt::arg("major", kMapMajor), fmt::arg("minor", kMapMinor), fmt::arg("size", kViewSize),
                    fmt::arg("view", kViewAt), fmt::arg("fresh_s", kFresh_ms / 1e3));
    return out + structured_constants() + structured_read() + structured_values() + structured_write() +
           structured_arrays(values);
}

}  // namespace tactiled::ctl
