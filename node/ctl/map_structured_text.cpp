// The register map for a PLC: IEC 61131-3 structured text that declares what a sensor block is and unpacks it.
//
// Kept to what CODESYS, TwinCAT and TIA all take: one field a line, named array types, explicit conversions, no bit access,
// no pointers, names of at most 40 characters. tests/system/map_test.py runs it against the daemon.
#include <fmt/format.h>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

const Area& area_with(Block block) {
    for (const Area& area : areas())
        if (area.block == block && !area.low_word_first) return area;
    return areas().front();
}

bool is_flag(const Register& r) { return r.type == Type::bits || r.type == Type::mask; }
// Forces and torques become REAL in SI, with a bit that says whether there is a value.
bool is_force(const Register& r) { return r.type == Type::i16 && (r.unit == "0.01 N" || r.unit == "0.001 Nm"); }
bool is_wire_only(const Register& r) {
    return r.name == "SEQ_END" || r.name == "MAGIC0" || r.name == "MAGIC1" || r.name == "SCALE";
}
double scale_of(const Register& r) { return r.unit == "0.001 Nm" ? 0.001 : 0.01; }
std::string si_name(const Register& r) { return fmt::format("{}_{}", r.name, r.unit == "0.001 Nm" ? "NM" : "N"); }

void field(std::string& out, std::string_view name, std::string_view type, std::string_view meaning) {
    out += fmt::format("    {} : {};", name, type);
    if (!meaning.empty()) out += fmt::format(" (* {} *)", meaning);
    out += "\n";
}

void declare(std::string& out, std::string_view type, const Area& area) {
    out += fmt::format("TYPE {} :\nSTRUCT\n", type);
    for (const Register& r : area.registers) {
        if (is_wire_only(r)) continue;
        const std::string meaning =
            fmt::format("{}{}{}", r.unit, r.unit.empty() || r.meaning.empty() ? "" : ", ", r.meaning);
        if (is_force(r))
            field(out, si_name(r), "REAL", r.meaning);
        else
            field(out, r.name,
                  is_flag(r)            ? "WORD"
                  : r.type == Type::i16 ? "INT"
                  : r.type == Type::i32 ? "DINT"
                                        : "UINT",
                  meaning);
    }
    if (area.block == Block::sensor) {
        field(out, "OK", "BOOL", "the value is GOOD: use it");
        field(out, "HAS_VALUE", "BOOL", "FX, FY and FZ hold numbers, though perhaps not GOOD ones; else they are 0");
        field(out, "HAS_TORQUE", "BOOL", "TX, TY and TZ hold numbers");
    }
    out += "END_STRUCT;\nEND_TYPE\n\n";
}

// The statements that unpack the registers of `array` from `base` on into `target`.
void unpack(std::string& out, const Area& area, std::string_view array, std::string_view base, std::string_view target,
            std::string_view indent) {
    for (const Register& r : area.registers) {
        if (is_wire_only(r)) continue;
        const auto cell = [&](unsigned plus) {
            return base.empty() ? fmt::format("{}[{}]", array, r.at + plus)
                                : fmt::format("{}[{} + {}]", array, base, r.at + plus);
        };
        if (is_force(r)) {
            out += fmt::format("{}IF {} <> 16#8000 THEN\n{}    {}.{} := INT_TO_REAL(WORD_TO_INT({})) * {};\n{}ELSE\n",
                               indent, cell(0), indent, target, si_name(r), cell(0), scale_of(r), indent);
            out += fmt::format("{}    {}.{} := 0.0;\n{}    {}.{} := FALSE;\n{}END_IF;\n", indent, target, si_name(r), indent,
                               target, r.unit == "0.001 Nm" ? "HAS_TORQUE" : "HAS_VALUE", indent);
        } else if (r.type == Type::i32) {  // high word first
            out += fmt::format("{}{}.{} := INT_TO_DINT(WORD_TO_INT({})) * 65536 + UINT_TO_DINT(WORD_TO_UINT({}));\n", indent,
                               target, r.name, cell(0), cell(1));
        } else {
            const std::string value = is_flag(r)            ? cell(0)
                                      : r.type == Type::i16 ? fmt::format("WORD_TO_INT({})", cell(0))
                                                            : fmt::format("WORD_TO_UINT({})", cell(0));
            out += fmt::format("{}{}.{} := {};\n", indent, target, r.name, value);
        }
    }
}

}  // namespace

std::string map_structured_text(unsigned sensors) {
    const Area &global = area_with(Block::global), &grasp = area_with(Block::grasp), &sensor = area_with(Block::sensor);
    const unsigned cells = sensors * kSensorSize;
    std::string out = fmt::format(
        "(* tactiled register map {}.{}: types, and a function block that unpacks one read of the global block and one of\n"
        "   the sensor blocks. Printed by: tactilectl map --format st --sensors {}\n\n"
        "   Read with FC 4 (or 3): {} registers from {} into GLOBAL_REGS, {} from {} into SENSOR_REGS.{}\n"
        "   Call FB_TACTILED once after each read, and use a sensor only while VALID and its OK are TRUE. *)\n\n",
        kMapMajor, kMapMinor, sensors, kGlobalSize, kGlobalAt, cells, kSensorsAt,
        cells > 125 ? " At most 125 a request:\n   read them in pieces of 5 sensors; the pieces' SEQ may differ." : "");
    out += fmt::format("TYPE T_TACTILED_GLOBAL_REGS : ARRAY[0..{}] OF WORD;\nEND_TYPE\n\n", kGlobalSize - 1);
    out += fmt::format("TYPE T_TACTILED_SENSOR_REGS : ARRAY[0..{}] OF WORD;\nEND_TYPE\n\n", cells - 1);
    declare(out, "T_TACTILED_GLOBAL", global);
    declare(out, "T_TACTILED_SENSOR", sensor);
    out += fmt::format("TYPE T_TACTILED_GRASP_REGS : ARRAY[0..{}] OF WORD;\nEND_TYPE\n\n", kGraspSize - 1);
    declare(out, "T_TACTILED_GRASP", grasp);
    out += fmt::format("TYPE T_TACTILED_SENSORS : ARRAY[0..{}] OF T_TACTILED_SENSOR;\nEND_TYPE\n\n", sensors - 1);
    out +=
        "FUNCTION_BLOCK FB_TACTILED\nVAR_INPUT\n"
        "    GLOBAL_REGS : T_TACTILED_GLOBAL_REGS;\n"
        "    SENSOR_REGS : T_TACTILED_SENSOR_REGS;\n"
        "    CALLS_PER_SECOND : UINT := 100; (* how often this block is called: it judges the heartbeat *)\n"
        "END_VAR\nVAR_OUTPUT\n"
        "    VALID : BOOL; (* both reads are whole, the map is known, the heartbeat runs *)\n"
        "    WRONG_MAP : BOOL; (* no tactiled of this major version, or off by one register *)\n"
        "    TORN : BOOL; (* SEQ and SEQ_END of a block differ: the read was put together from two *)\n"
        "    DEAD : BOOL; (* the heartbeat has stood still for half a second *)\n"
        "    NODE : T_TACTILED_GLOBAL;\n"
        "    SENSOR : T_TACTILED_SENSORS;\n"
        "END_VAR\nVAR\n"
        "    IDX : INT;\n    BASE : INT;\n    CHANNEL_OK : BOOL;\n    BEAT_SEEN : BOOL;\n    LAST_BEAT : UINT;\n    STILL : "
        "UINT;\nEND_VAR\n\n";
    out += fmt::format("WRONG_MAP := (GLOBAL_REGS[{}] <> 16#5441) OR (GLOBAL_REGS[{}] <> 16#4354);\n", unsigned(kMagic0),
                       unsigned(kMagic1));
    out += fmt::format("WRONG_MAP := WRONG_MAP OR (WORD_TO_UINT(GLOBAL_REGS[{}]) / 256 <> {});\n", unsigned(kMapVersion),
                       kMapMajor);
    out += fmt::format("TORN := GLOBAL_REGS[{}] <> GLOBAL_REGS[{}];\n\n", unsigned(kSeq), unsigned(kSeqEnd));
    unpack(out, global, "GLOBAL_REGS", "", "NODE", "");
    out +=
        "\nIF (NOT BEAT_SEEN) OR (NODE.HEARTBEAT <> LAST_BEAT) THEN\n    STILL := 0;\nELSIF STILL < 60000 THEN\n    STILL "
        ":= STILL + 1;\n"
        "END_IF;\nLAST_BEAT := NODE.HEARTBEAT;\nBEAT_SEEN := TRUE;\nDEAD := STILL >= CALLS_PER_SECOND / 2 + 1;\n\n";
    out += fmt::format("FOR IDX := 0 TO {} DO\n    BASE := IDX * {};\n", sensors - 1, kSensorSize);
    out += fmt::format("    CHANNEL_OK := SENSOR_REGS[BASE] = SENSOR_REGS[BASE + {}];\n", unsigned(kSensorSeqEnd));
    out +=
        "    IF NOT CHANNEL_OK THEN\n        TORN := TRUE;\n    END_IF;\n"
        "    SENSOR[IDX].HAS_VALUE := TRUE;\n    SENSOR[IDX].HAS_TORQUE := TRUE;\n";
    unpack(out, sensor, "SENSOR_REGS", "BASE", "SENSOR[IDX]", "    ");
    out +=
        fmt::format("    SENSOR[IDX].OK := CHANNEL_OK AND ((SENSOR_REGS[BASE + {}] AND 16#0001) <> 16#0000);\nEND_FOR;\n\n",
                    unsigned(kSensorStatus));
    out +=
        "VALID := NOT (WRONG_MAP OR TORN OR DEAD);\n"
        "IF NOT VALID THEN\n";
    out += fmt::format(
        "    FOR IDX := 0 TO {} DO\n        SENSOR[IDX].OK := FALSE;\n    END_FOR;\nEND_IF;\nEND_FUNCTION_BLOCK\n\n",
        sensors - 1);
    out += fmt::format("(* The grasp block: {} registers from {}. Its SEQ is that of the frame, as in NODE. *)\n",
                       kGraspSize, kGraspAt);
    out +=
        "FUNCTION_BLOCK FB_TACTILED_GRASP\nVAR_INPUT\n    GRASP_REGS : T_TACTILED_GRASP_REGS;\nEND_VAR\nVAR_OUTPUT\n"
        "    TORN : BOOL;\n    GRASP : T_TACTILED_GRASP;\nEND_VAR\n\n";
    out += fmt::format("TORN := GRASP_REGS[{}] <> GRASP_REGS[{}];\n", unsigned(kGraspSeq), unsigned(kGraspSeqEnd));
    unpack(out, grasp, "GRASP_REGS", "", "GRASP", "");
    out += "END_FUNCTION_BLOCK\n";
    return out;
}

}  // namespace tactiled::ctl
