// The PLC function blocks that hand out values, at the place of use: made from the rows of the map.
//
// A number is a REAL in SI units where its register has a fraction, else an INT, UINT or DINT. It is 0 with its HAS_ FALSE
// unless the read is fresh, the daemon calls the value GOOD (or uncertain, if that is accepted) and the register is not at
// the end of its range. A word of bits without a fresh read shows every trouble and no good.
#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

constexpr std::string_view kIndent = "    ";

// The form of a register's unit in the text: the end of the field's name, and the value of one count.
struct Si {
    std::string_view unit, end, count;
};
constexpr Si kSi[] = {{"0.01 N", "_N", "0.01"}, {"0.001 Nm", "_NM", "0.001"}, {"0.1 g", "_KG", "0.0001"},
                      {"1 g", "_KG", "0.001"},  {"0.01 mm", "_M", "0.00001"}, {"0.1 degC", "_C", "0.1"},
                      {"0.1 %", "", "0.001"},   {"0.001", "", "0.001"}};

const Si* si_of(const Register& r) {
    for (const Si& si : kSi)
        if (r.unit.text == si.unit) return &si;
    return nullptr;
}

bool is_flags(const Register& r) { return r.type == Type::bits || r.type == Type::mask; }
bool is_number(const Register& r) { return r.type == Type::u16 || r.type == Type::i16 || r.type == Type::i32; }
// Numbers of the stream itself, which say how old or how fast it is; they are known of a bad value, too.
bool is_of_stream(const Register& r) { return r.unit.text == "ms" || r.unit.text == "Hz" || r.unit.text == "us"; }

std::string name_of(const Register& r) {
    const Si* const si = is_number(r) ? si_of(r) : nullptr;
    return fmt::format("{}{}", r.name, si != nullptr ? si->end : "");
}

std::string_view type_of(const Register& r) {
    if (is_flags(r)) return "WORD";
    if (is_number(r) && si_of(r) != nullptr) return "REAL";
    return r.type == Type::i16 ? "INT" : r.type == Type::i32 ? "DINT" : "UINT";
}

// Rows of one block of registers in the piece `piece`, and the BOOL variables that let a number and a state pass.
struct Rows {
    const Area& area;
    std::string_view piece, number, state;
    std::vector<std::string_view> names{};    // these rows only; empty: all
    std::vector<std::string_view> without{};  // or all but these

    [[nodiscard]] bool has(const Register& r) const {
        for (const std::string_view wire : {"SEQ", "SEQ_END", "MAGIC0", "MAGIC1", "SCALE", "WEIGHT_G"})
            if (r.name == wire) return false;
        const auto is_in = [&](const auto& list) { return std::find(list.begin(), list.end(), r.name) != list.end(); };
        return names.empty() ? !is_in(without) : is_in(names);
    }
    [[nodiscard]] bool is_scaled(const Register& r) const {  // in counts of SCALE
        return area.block == Block::sensor && r.unit.text == "0.01 N";
    }
};

void declare(std::string& out, const Rows& rows) {
    for (const Register& r : rows.area.registers) {
        if (!rows.has(r)) continue;
        const std::string_view unit = si_of(r) != nullptr && is_number(r) ? "" : r.unit.text;
        put_field(out, name_of(r), type_of(r),
                  fmt::format("{}{}{}", unit, unit.empty() || r.meaning.empty() ? "" : ", ", r.meaning));
        if (is_number(r)) put_field(out, fmt::format("HAS_{}", r.name), "BOOL", "");
    }
}

void choose(std::string& out, std::string_view condition, std::string_view field, std::string_view value,
            std::string_view otherwise) {
    out += fmt::format("IF {0} THEN\n{4}{1} := {2};\nELSE\n{4}{1} := {3};\nEND_IF;\n", condition, field, value, otherwise,
                       kIndent);
}

void unpack_number(std::string& out, const Rows& rows, const Register& r) {
    const auto cell = [&](unsigned plus) { return fmt::format("{}.CELLS[{}]", rows.piece, r.at + plus); };
    const Si* const si = si_of(r);
    std::string there = r.type == Type::i32   ? fmt::format("(({} <> 16#8000) OR ({} <> 16#0000))", cell(0), cell(1))
                        : r.type == Type::i16 ? fmt::format("({} <> 16#8000)", cell(0))
                                              : fmt::format("({} <> 16#FFFF)", cell(0));
    if (si != nullptr && r.type == Type::i16) there += fmt::format(" AND ({0} <> 16#7FFF) AND ({0} <> 16#8001)", cell(0));
    if (si != nullptr && r.type == Type::u16) there += fmt::format(" AND ({} <> 16#FFFE)", cell(0));
    if (rows.is_scaled(r)) there += " AND (0.0 < UNIT_N)";
    const std::string has = fmt::format("HAS_{}", r.name);
    out += fmt::format("{} := {} AND {};\n", has, is_of_stream(r) ? rows.state : rows.number, there);
    const std::string integer =
        r.type == Type::i32
            ? fmt::format("INT_TO_DINT(WORD_TO_INT({})) * 65536 + UINT_TO_DINT(WORD_TO_UINT({}))", cell(0), cell(1))
            : fmt::format("WORD_TO_{}({})", r.type == Type::i16 ? "INT" : "UINT", cell(0));
    if (si == nullptr) return choose(out, has, name_of(r), integer, "0");
    choose(out, has, name_of(r),
           fmt::format("{}_TO_REAL({}) * {}",
                       r.type == Type::i32   ? "DINT"
                       : r.type == Type::i16 ? "INT"
                                             : "UINT",
                       integer, rows.is_scaled(r) ? "UNIT_N" : si->count),
           "0.0");
}

void unpack(std::string& out, const Rows& rows) {
    for (const Register& r : rows.area.registers) {
        if (!rows.has(r)) continue;
        const std::string cell = fmt::format("{}.CELLS[{}]", rows.piece, r.at);
        if (is_number(r))
            unpack_number(out, rows, r);
        else if (is_flags(r))
            choose(out, rows.state, r.name, cell, fmt::format("16#{:04X}", r.value.unread));
        else if (r.type == Type::enumeration)  // a fault is known of a bad value, too
            choose(out, r.name == "FAULT" || r.name.starts_with("CMD") ? rows.state : rows.number, r.name,
                   fmt::format("WORD_TO_UINT({})", cell), "65535");
        else
            choose(out, rows.state, r.name, fmt::format("WORD_TO_UINT({})", cell), "0");
    }
}

// A value beyond the end of its register is not handed out, and its 0 must not stand beside OK.
void end_of_range(std::string& out, const Rows& rows) {
    for (const Register& r : rows.area.registers)
        if (rows.has(r) && is_number(r) && r.type == Type::i16 && si_of(r) != nullptr)
            out += fmt::format("IF ({0} = 16#7FFF) OR ({0} = 16#8001) THEN\n    OK := FALSE;\nEND_IF;\n",
                               fmt::format("{}.CELLS[{}]", rows.piece, r.at));
}

std::string begin(std::string_view comment, std::string_view name, const std::vector<std::string_view>& pieces,
                  std::string_view option) {
    std::string out = fmt::format("(* {} *)\nFUNCTION_BLOCK {}\nVAR_INPUT\n", comment, name);
    for (const std::string_view piece : pieces) put_field(out, piece, "T_TACTILED_PIECE", "");
    if (!option.empty()) put_field(out, option, "BOOL", "FALSE: such values are not handed out");
    return out + "END_VAR\nVAR_OUTPUT\n";
}

// The age of the pieces, which are of one reading block.
std::string judge(std::string_view piece) {
    return fmt::format("JUDGE(ID := {0}.ID, CALLS := {0}.CALLS, AGE := {0}.AGE);\nFRESH := JUDGE.FRESH;\n", piece);
}

std::string sensor_block() {
    const Rows rows{area_with(Block::sensor), "SENSOR", "USABLE", "FRESH"};
    std::string out = begin(
        "One sensor: SENSOR[0] or SENSOR[1] of FB_TACTILED, or SENSOR of FB_TACTILED_FURTHER. Call it where its values are\n"
        "   used; after a pause of its calls the first one has none.",
        "FB_TACTILED_SENSOR", {"SENSOR"}, "ACCEPT_UNCERTAIN");
    put_field(out, "OK", "BOOL",
              "the value is GOOD, within the registers, and so is the read: use the components that HAS_FX to HAS_TZ name");
    put_field(out, "UNCERTAIN", "BOOL", "fresh, and the daemon calls the value uncertain; FAULT tells why");
    put_fresh(out);
    put_field(out, "HAS_VALUE", "BOOL", "HAS_FX, HAS_FY and HAS_FZ");
    put_field(out, "HAS_TORQUE", "BOOL", "HAS_TX, HAS_TY and HAS_TZ");
    put_field(out, "HAS_COP", "BOOL", "HAS_COP_X and HAS_COP_Y");
    declare(out, rows);
    out +=
        "END_VAR\nVAR\n    JUDGE : FB_TACTILED_AGE;\n    USABLE : BOOL;\n    UNIT_N : REAL;\nEND_VAR\n\n" + judge("SENSOR");
    const unsigned status = kSensorStatus;
    out += fmt::format(
        "OK := FRESH AND ((SENSOR.CELLS[{0}] AND 16#0001) <> 16#0000);\n"
        "UNCERTAIN := FRESH AND ((SENSOR.CELLS[{0}] AND 16#1000) <> 16#0000);\n"
        "USABLE := OK OR (UNCERTAIN AND ACCEPT_UNCERTAIN);\n",
        status);
    find_unit(out, fmt::format("SENSOR.CELLS[{}]", unsigned(kScale)), "UNIT_N", "");
    unpack(out, rows);
    out += "OK := OK AND (0.0 < UNIT_N);\n";
    end_of_range(out, rows);
    return out +
           "HAS_VALUE := HAS_FX AND HAS_FY AND HAS_FZ;\nHAS_TORQUE := HAS_TX AND HAS_TY AND HAS_TZ;\n"
           "HAS_COP := HAS_COP_X AND HAS_COP_Y;\nEND_FUNCTION_BLOCK\n\n";
}

std::string wrench_block() {
    const Rows rows{area_with(Block::tool), "WRENCH", "USABLE", "FRESH"};
    std::string out =
        begin("The wrench on the gripper, in its frame G.", "FB_TACTILED_WRENCH", {"WRENCH"}, "ACCEPT_UNCERTAIN");
    put_field(out, "OK", "BOOL", "the value is GOOD, within the registers, and so is the read");
    put_field(out, "UNCERTAIN", "BOOL", "fresh, and the daemon calls the value uncertain; STATUS tells why");
    put_fresh(out);
    declare(out, rows);
    out += "END_VAR\nVAR\n    JUDGE : FB_TACTILED_AGE;\n    USABLE : BOOL;\nEND_VAR\n\n" + judge("WRENCH");
    out +=
        "OK := FRESH AND ((WRENCH.CELLS[1] AND 16#0100) <> 16#0000);\n"
        "UNCERTAIN := FRESH AND ((WRENCH.CELLS[1] AND 16#0200) <> 16#0000);\n"
        "USABLE := OK OR (UNCERTAIN AND ACCEPT_UNCERTAIN);\n";
    unpack(out, rows);
    end_of_range(out, rows);
    return out + "END_FUNCTION_BLOCK\n\n";
}

// The rows of the global block that are about the grasp.
const std::vector<std::string_view> kGraspRows{"GRIP_FORCE", "GRIP_STATE", "REC_GRIP", "WEIGHT_STATE"};
const std::vector<std::string_view> kWeightRows{"WEIGHT", "WEIGHT_SD"};
const std::vector<std::string_view> kEventRows{"SLIP_COUNT"};

std::vector<std::string_view> rows_of_weight() {
    std::vector<std::string_view> all = kGraspRows;
    for (const auto& more : {kWeightRows, kEventRows}) all.insert(all.end(), more.begin(), more.end());
    return all;
}

std::string weight_block() {
    const Area& global = area_with(Block::global);
    const Rows rows[] = {{global, "NODE", "STABLE", "FRESH", kWeightRows},
                         {global, "NODE", "FRESH", "FRESH", kEventRows},
                         {area_with(Block::doubts), "DOUBTS", "FRESH", "FRESH"},
                         {global, "NODE", "JAWS_OK", "FRESH", kGraspRows},
                         {area_with(Block::grasp), "GRASP", "JAWS_OK", "FRESH"}};
    std::string out = begin("Weight and grasp. What is not GOOD of any sensor makes the grasp not known (65535).",
                            "FB_TACTILED_WEIGHT", {"NODE", "GRASP", "DOUBTS"}, "ACCEPT_UNCERTAIN");
    put_field(out, "OK", "BOOL", "the weight is STABLE, every sensor GOOD, and the read fresh");
    put_fresh(out);
    put_field(out, "ALL_GOOD", "BOOL", "every sensor is GOOD");
    for (const Rows& each : rows) declare(out, each);
    out +=
        "END_VAR\nVAR\n    JUDGE : FB_TACTILED_AGE;\n    STABLE : BOOL;\n    JAWS_OK : BOOL;\n    IDX : INT;\n    ALL : "
        "UDINT;\nEND_VAR\n\n" +
        judge("NODE");
    out += fmt::format(
        "ALL := 1;\nFOR IDX := 1 TO WORD_TO_INT(NODE.CELLS[{}]) DO\n    ALL := ALL * 2;\nEND_FOR;\n"
        "ALL_GOOD := FRESH AND (UINT_TO_UDINT(WORD_TO_UINT(NODE.CELLS[{}])) + 1 = ALL);\n"
        "JAWS_OK := ALL_GOOD OR (FRESH AND ACCEPT_UNCERTAIN);\n"
        "OK := ALL_GOOD AND ((NODE.CELLS[{}] AND 16#0040) <> 16#0000);\nSTABLE := OK OR (FRESH AND ACCEPT_UNCERTAIN);\n",
        unsigned(kSensors), unsigned(kOk), unsigned(kStatus));
    for (const Rows& each : rows) unpack(out, each);
    return out + "END_FUNCTION_BLOCK\n\n";
}

std::string node_block() {
    const Rows rows{area_with(Block::global), "NODE", "FRESH", "FRESH", {}, rows_of_weight()};
    std::string out = begin("The state of the node. Without a fresh read the bits show every trouble: FAULT 16#FFFF, OK 0.",
                            "FB_TACTILED_NODE", {"NODE"}, "");
    put_fresh(out);
    declare(out, rows);
    out += "END_VAR\nVAR\n    JUDGE : FB_TACTILED_AGE;\nEND_VAR\n\n" + judge("NODE");
    unpack(out, rows);
    return out + "END_FUNCTION_BLOCK\n\n";
}

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

std::string structured_values() { return sensor_block() + weight_block() + wrench_block() + node_block(); }

}  // namespace tactiled::ctl
