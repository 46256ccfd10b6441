// The register map for a PLC: IEC 61131-3 structured text that declares the blocks, unpacks them and checks their
// liveness. The blocks for commands and arrays are in
// map_structured_commands.cpp and map_structured_arrays.cpp.
//
// The text uses only features that CODESYS, TwinCAT, TIA and matiec all accept: one field a line, named array types,
// explicit conversions, no bit access, no pointers, no enumerations, names of at most 40 characters.
// tests/system/map_test.py runs it against the daemon.
#include <fmt/format.h>

#include <array>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

bool is_flag(const Register& r) { return r.type == Type::bits || r.type == Type::mask; }
// Forces and torques become REAL in SI units, with a bit that is set if there is a value.
bool is_force(const Register& r) { return r.type == Type::i16 && (r.unit.text == "0.01 N" || r.unit.text == "0.001 Nm"); }
bool is_wire_only(const Register& r) {
    return r.name == "SEQ_END" || r.name == "MAGIC0" || r.name == "MAGIC1" || r.name == "SCALE";
}
bool is_scaled(const Register& r) { return r.unit.text == "0.01 N"; }  // in the block of a sensor: in counts of SCALE
std::string si_name(const Register& r) { return fmt::format("{}_{}", r.name, r.unit.text == "0.001 Nm" ? "NM" : "N"); }

void field(std::string& out, std::string_view name, std::string_view type, std::string_view meaning) {
    out += fmt::format("    {} : {};", name, type);
    if (!meaning.empty()) out += fmt::format(" (* {} *)", meaning);
    out += "\n";
}

bool is_number(const Register& r) {
    return (r.type == Type::u16 || r.type == Type::i16 || r.type == Type::i32) && r.name != "N_SENSORS";
}

const char* type_of(const Register& r) {
    return is_flag(r) ? "WORD" : r.type == Type::i16 ? "INT" : r.type == Type::i32 ? "DINT" : "UINT";
}

void declare(std::string& out, std::string_view type, const Area& area) {
    out += fmt::format("TYPE {} :\nSTRUCT\n", type);
    for (const Register& r : area.registers) {
        if (is_wire_only(r)) continue;
        const std::string_view unit = area.block == Block::sensor && is_scaled(r) ? "UNIT_N" : r.unit.text;
        const std::string meaning = fmt::format("{}{}{}", unit, unit.empty() || r.meaning.empty() ? "" : ", ", r.meaning);
        if (is_force(r))
            field(out, si_name(r), "REAL", r.meaning);
        else
            field(out, r.name, type_of(r), meaning);
        if (is_number(r)) field(out, fmt::format("HAS_{}", r.name), "BOOL", "");
    }
    if (area.block == Block::sensor) {
        field(out, "UNIT_N", "REAL",
              "newtons of one count, from SCALE; 0 where SCALE is unknown, and then no force is there");
        field(out, "ALIVE", "BOOL", "this block is whole, and its SEQ has changed within half a second");
        field(out, "OK", "BOOL", "ALIVE, and the value is GOOD: use the components that HAS_FX to HAS_TZ name");
        field(out, "HAS_VALUE", "BOOL", "HAS_FX, HAS_FY and HAS_FZ");
        field(out, "HAS_TORQUE", "BOOL", "HAS_TX, HAS_TY and HAS_TZ");
        field(out, "HAS_COP", "BOOL", "HAS_COP_X and HAS_COP_Y");
    }
    out += "END_STRUCT;\nEND_TYPE\n\n";
}

// One constant for each bit and each value that has a name.
void declare_constants(std::string& out) {
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
    out +=
        "(* The names of bits and states. Declare one instance, C : FB_TACTILED_CONST, and read C.GRIP_HOLDING. SENSOR_ is "
        "for\n"
        "   STATUS and REASON_ for FAULT of a sensor. *)\nFUNCTION_BLOCK FB_TACTILED_CONST\nVAR_OUTPUT\n";
    for (const Group& group : kGroups)
        for (const Name& name : names_of(group.of)) {
            if (name.id.empty()) continue;
            const std::string value =
                group.is_bit ? fmt::format("WORD := 16#{:04X}", 1u << name.value) : fmt::format("UINT := {}", name.value);
            field(out, fmt::format("{}_{}", group.prefix, name.id), value, name.name);
        }
    out +=
        "    NOT_KNOWN : UINT := 65535; (* of GRIP_STATE and SLIP_STATE *)\nEND_VAR\nVAR\n    WAS_CALLED : "
        "BOOL;\nEND_VAR\n\n"
        "WAS_CALLED := TRUE;\nEND_FUNCTION_BLOCK\n\n";
}

// The statements that unpack the registers of `array` from `base` on into `target`. While the variable `alive` is FALSE no
// number is available and no state is known.
void unpack(std::string& out, const Area& area, std::string_view array, std::string_view base, std::string_view target,
            std::string_view alive, std::string_view indent) {
    for (const Register& r : area.registers) {
        if (is_wire_only(r)) continue;
        const auto cell = [&](unsigned plus) {
            return base.empty() ? fmt::format("{}[{}]", array, r.at + plus)
                                : fmt::format("{}[{} + {}]", array, base, r.at + plus);
        };
        const auto choose = [&](std::string_view condition, std::string_view field, std::string_view value,
                                std::string_view otherwise) {
            out += fmt::format("{0}IF {1} THEN\n{0}    {2}.{3} := {4};\n{0}ELSE\n{0}    {2}.{3} := {5};\n{0}END_IF;\n",
                               indent, condition, target, field, value, otherwise);
        };
        if (is_number(r)) {
            const std::string has = fmt::format("{}.HAS_{}", target, r.name);
            const std::string there = r.type == Type::i32
                                          ? fmt::format("(({} <> 16#8000) OR ({} <> 16#0000))", cell(0), cell(1))
                                          : fmt::format("({} <> {})", cell(0), r.type == Type::i16 ? "16#8000" : "16#FFFF");
            const bool scaled = area.block == Block::sensor && is_scaled(r);
            const std::string unit = fmt::format("{}.UNIT_N", target);
            out += fmt::format("{}{} := {} AND {}{};\n", indent, has, alive, there,
                               scaled ? fmt::format(" AND (0.0 < {})", unit) : "");
            if (is_force(r))
                choose(has, si_name(r), fmt::format("INT_TO_REAL(WORD_TO_INT({})) * {}", cell(0), scaled ? unit : "0.001"),
                       "0.0");
            else if (r.type == Type::i32)  // high word first
                choose(
                    has, r.name,
                    fmt::format("INT_TO_DINT(WORD_TO_INT({})) * 65536 + UINT_TO_DINT(WORD_TO_UINT({}))", cell(0), cell(1)),
                    "0");
            else
                choose(has, r.name, fmt::format("WORD_TO_{}({})", r.type == Type::i16 ? "INT" : "UINT", cell(0)), "0");
        } else if (r.type == Type::enumeration) {
            choose(alive, r.name, fmt::format("WORD_TO_UINT({})", cell(0)), "65535");
        } else {
            out += fmt::format("{}{}.{} := {};\n", indent, target, r.name,
                               is_flag(r) ? cell(0) : fmt::format("WORD_TO_UINT({})", cell(0)));
        }
    }
}

// STILL counts the calls since `cell` has changed. The first call proves nothing, because the array may contain old
// data.
void count_still(std::string& out, std::string_view cell, std::string_view last, std::string_view still,
                 std::string_view indent) {
    out += fmt::format(
        "{0}IF NOT STARTED THEN\n{0}    {3} := 60000;\n{0}ELSIF {1} <> {2} THEN\n{0}    {3} := 0;\n"
        "{0}ELSIF {3} < 60000 THEN\n{0}    {3} := {3} + 1;\n{0}END_IF;\n{0}{2} := {1};\n",
        indent, cell, last, still);
}

// The subset of IEC 61131-3 that the text uses; tests/system/structured_text_test.py enforces this list.
constexpr char kSubset[] =
    "   It is written in this subset of IEC 61131-3: TYPE, ARRAY, OF, STRUCT, FUNCTION_BLOCK, VAR, VAR_INPUT, VAR_OUTPUT,\n"
    "   initial values, IF, THEN, ELSIF, ELSE, FOR, TO, DO, AND, OR, NOT, := = <> < >= + * /, BOOL, WORD, INT, UINT, DINT, "
    "UDINT,\n"
    "   REAL, WORD_TO_INT, WORD_TO_UINT, UINT_TO_WORD, INT_TO_REAL, INT_TO_DINT, UINT_TO_DINT, UINT_TO_UDINT. *)\n\n";

}  // namespace

void find_unit(std::string& out, std::string_view scale, std::string_view unit, std::string_view indent) {
    constexpr const char* kUnits[] = {"0.000001", "0.00001", "0.0001", "0.001",
                                      "0.01",     "0.1",     "1.0",    "10.0"};  // SCALE -6 ..
    const char* when = "IF";
    int power = -6;
    for (const char* value : kUnits) {
        out += fmt::format("{0}{1} {2} = 16#{3:04X} THEN\n{0}    {4} := {5};\n", indent, when, scale,
                           unsigned(power++) & 0xFFFFu, unit, value);
        when = "ELSIF";
    }
    out += fmt::format("{0}ELSE\n{0}    {1} := 0.0;\n{0}END_IF;\n", indent, unit);
}

std::string map_structured_text(unsigned sensors, unsigned values) {
    const Area &global = area_with(Block::global), &grasp = area_with(Block::grasp), &sensor = area_with(Block::sensor);
    const unsigned cells = sensors * kSensorSize;
    std::string out = fmt::format(
        "(* tactiled register map {}.{}: types, constants, function blocks that unpack what was read, and one that "
        "commands.\n"
        "   Printed by: tactilectl map --format st --sensors {} --values {}\n\n"
        "   Read with FC 4 (or 3): {} registers from {} into GLOBAL_REGS, {} from {} into SENSOR_REGS.{}\n"
        "   Call FB_TACTILED once after each read, and use a sensor only while its OK is TRUE. Each sensor's block is "
        "judged by\n"
        "   itself: read whole blocks of {} registers, in one request or in several.\n\n",
        kMapMajor, kMapMinor, sensors, values, kGlobalSize, kGlobalAt, cells, kSensorsAt,
        cells > 125 ? " At most 125 a request:\n   read them in pieces of 5 sensors." : "", kSensorSize);
    out += kSubset;
    const auto array = [&](std::string_view name, unsigned size, std::string_view of) {
        out += fmt::format("TYPE {} : ARRAY[0..{}] OF {};\nEND_TYPE\n\n", name, size - 1, of);
    };
    array("T_TACTILED_GLOBAL_REGS", kGlobalSize, "WORD");
    array("T_TACTILED_SENSOR_REGS", cells, "WORD");
    array("T_TACTILED_SEQS", sensors, "WORD");
    array("T_TACTILED_COUNTS", sensors, "UINT");
    declare_constants(out);
    declare(out, "T_TACTILED_GLOBAL", global);
    declare(out, "T_TACTILED_SENSOR", sensor);
    array("T_TACTILED_GRASP_REGS", kGraspSize, "WORD");
    declare(out, "T_TACTILED_GRASP", grasp);
    array("T_TACTILED_SENSORS", sensors, "T_TACTILED_SENSOR");
    out +=
        "FUNCTION_BLOCK FB_TACTILED\nVAR_INPUT\n"
        "    GLOBAL_REGS : T_TACTILED_GLOBAL_REGS;\n"
        "    SENSOR_REGS : T_TACTILED_SENSOR_REGS;\n"
        "    CALLS_PER_SECOND : UINT := 100; (* how often this block is called: it judges what stands still *)\n"
        "END_VAR\nVAR_OUTPUT\n"
        "    VALID : BOOL; (* every read is whole and alive, and the map is known *)\n"
        "    GLOBAL_OK : BOOL; (* the same of the global read alone *)\n"
        "    WRONG_MAP : BOOL; (* no tactiled of this major version, or off by one register *)\n"
        "    TORN : BOOL; (* SEQ and SEQ_END of a block differ: the read was put together from two *)\n"
        "    DEAD : BOOL; (* the heartbeat, or the SEQ of a sensor, has stood still for half a second *)\n"
        "    NODE : T_TACTILED_GLOBAL;\n"
        "    SENSOR : T_TACTILED_SENSORS;\n"
        "END_VAR\nVAR\n"
        "    IDX : INT;\n    BASE : INT;\n    READ_OK : BOOL;\n    STARTED : BOOL;\n    STILL_CALLS : UINT;\n"
        "    LAST_BEAT : WORD;\n    STILL : UINT;\n    LAST_SEQ : T_TACTILED_SEQS;\n    SEQ_STILL : T_TACTILED_COUNTS;\n"
        "END_VAR\n\n";
    out += fmt::format("WRONG_MAP := (GLOBAL_REGS[{}] <> 16#5441) OR (GLOBAL_REGS[{}] <> 16#4354);\n", unsigned(kMagic0),
                       unsigned(kMagic1));
    out += fmt::format("WRONG_MAP := WRONG_MAP OR (WORD_TO_UINT(GLOBAL_REGS[{}]) / 256 <> {});\n", unsigned(kMapVersion),
                       kMapMajor);
    out += fmt::format("TORN := GLOBAL_REGS[{}] <> GLOBAL_REGS[{}];\n", unsigned(kSeq), unsigned(kSeqEnd));
    out += "STILL_CALLS := CALLS_PER_SECOND / 2 + 1;\n";
    count_still(out, fmt::format("GLOBAL_REGS[{}]", unsigned(kHeartbeat)), "LAST_BEAT", "STILL", "");
    out += "DEAD := STILL >= STILL_CALLS;\nGLOBAL_OK := NOT (WRONG_MAP OR TORN OR DEAD);\n\n";
    unpack(out, global, "GLOBAL_REGS", "", "NODE", "GLOBAL_OK", "");
    out += fmt::format("\nFOR IDX := 0 TO {} DO\n    BASE := IDX * {};\n", sensors - 1, kSensorSize);
    out += fmt::format("    READ_OK := SENSOR_REGS[BASE] = SENSOR_REGS[BASE + {}];\n", unsigned(kSensorSeqEnd));
    count_still(out, "SENSOR_REGS[BASE]", "LAST_SEQ[IDX]", "SEQ_STILL[IDX]", "    ");
    out += fmt::format(
        "    IF IDX < WORD_TO_INT(GLOBAL_REGS[{}]) THEN\n        TORN := TORN OR (NOT READ_OK);\n"
        "        DEAD := DEAD OR (SEQ_STILL[IDX] >= STILL_CALLS);\n    END_IF;\n"
        "    READ_OK := GLOBAL_OK AND READ_OK AND (NOT (SEQ_STILL[IDX] >= STILL_CALLS));\n    SENSOR[IDX].ALIVE := "
        "READ_OK;\n",
        unsigned(kSensors));
    find_unit(out, fmt::format("SENSOR_REGS[BASE + {}]", unsigned(kScale)), "SENSOR[IDX].UNIT_N", "    ");
    unpack(out, sensor, "SENSOR_REGS", "BASE", "SENSOR[IDX]", "READ_OK", "    ");
    for (const auto& [name, x, y, z] :
         {std::array{"HAS_VALUE", "HAS_FX", "HAS_FY", "HAS_FZ"}, std::array{"HAS_TORQUE", "HAS_TX", "HAS_TY", "HAS_TZ"}})
        out += fmt::format("    SENSOR[IDX].{} := SENSOR[IDX].{} AND SENSOR[IDX].{} AND SENSOR[IDX].{};\n", name, x, y, z);
    out += "    SENSOR[IDX].HAS_COP := SENSOR[IDX].HAS_COP_X AND SENSOR[IDX].HAS_COP_Y;\n";
    out += fmt::format("    SENSOR[IDX].OK := READ_OK AND ((SENSOR_REGS[BASE + {}] AND 16#0001) <> 16#0000);\nEND_FOR;\n",
                       unsigned(kSensorStatus));
    out += "STARTED := TRUE;\nVALID := NOT (WRONG_MAP OR TORN OR DEAD);\nEND_FUNCTION_BLOCK\n\n";
    out += fmt::format(
        "(* The grasp block: {} registers from {}. Use it only while VALID is TRUE, here and of FB_TACTILED. *)\n",
        kGraspSize, kGraspAt);
    out +=
        "FUNCTION_BLOCK FB_TACTILED_GRASP\nVAR_INPUT\n    GRASP_REGS : T_TACTILED_GRASP_REGS;\n"
        "    CALLS_PER_SECOND : UINT := 100;\nEND_VAR\nVAR_OUTPUT\n"
        "    VALID : BOOL;\n    TORN : BOOL;\n    DEAD : BOOL; (* SEQ has stood still for half a second *)\n"
        "    GRASP : T_TACTILED_GRASP;\nEND_VAR\nVAR\n    STARTED : BOOL;\n    LAST_SEQ : WORD;\n    STILL : "
        "UINT;\nEND_VAR\n\n";
    out += fmt::format("TORN := GRASP_REGS[{}] <> GRASP_REGS[{}];\n", unsigned(kGraspSeq), unsigned(kGraspSeqEnd));
    count_still(out, fmt::format("GRASP_REGS[{}]", unsigned(kGraspSeq)), "LAST_SEQ", "STILL", "");
    out += "STARTED := TRUE;\nDEAD := STILL >= CALLS_PER_SECOND / 2 + 1;\nVALID := NOT (TORN OR DEAD);\n";
    unpack(out, grasp, "GRASP_REGS", "", "GRASP", "VALID", "");
    out += "END_FUNCTION_BLOCK\n\n";
    out += structured_commands();
    return out + "\n" + structured_arrays(values);
}

}  // namespace tactiled::ctl
