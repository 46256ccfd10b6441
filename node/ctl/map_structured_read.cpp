// The PLC function blocks that take what was read, and the one that judges its age.
//
// A read is good if it is whole, of this map, and newer than the one before: SEQ counts the frames that the daemon
// publishes, so it changes with each answer of a live loop. Age is counted by TON alone, which measures with the
// controller's clock however seldom it is called; the period of the task is not needed.
#include <fmt/format.h>

#include <vector>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

// T#2s stands for every time that is longer than kFresh_ms.
constexpr char kTypesAndAge[] =
    R"(TYPE T_TACTILED_CELLS : ARRAY[0..{last_cell}] OF WORD;
END_TYPE

(* One block of registers of the last good read. *)
TYPE T_TACTILED_PIECE :
STRUCT
    ID : UINT; (* which block it is: 16 + n for sensor n *)
    CALLS : UINT; (* of the block that read it *)
    AGE : TIME; (* of the read, at the last of these calls *)
    CELLS : T_TACTILED_CELLS;
END_STRUCT;
END_TYPE

TYPE T_TACTILED_JAWS : ARRAY[0..1] OF T_TACTILED_PIECE;
END_TYPE

TYPE T_TACTILED_REGS : ARRAY[0..{last}] OF WORD;
END_TYPE

(* Part of the blocks below: judges the age of a read at the place of use. It is at most the AGE when the reading block was
   called last, plus the time since then: since this block's call before, if CALLS has changed, else longer by what has passed
   since it had changed. An instance that is used for several blocks in turns hands out nothing. *)
FUNCTION_BLOCK FB_TACTILED_AGE
VAR_INPUT
    ID : UINT;
    CALLS : UINT;
    AGE : TIME;
END_VAR
VAR_OUTPUT
    FRESH : BOOL; (* the read is less than {fresh_s} s old *)
END_VAR
VAR
    STARTED : BOOL;
    LAST_ID : UINT;
    LAST_CALLS : UINT;
    PAUSE : TON; (* since the call before *)
    HELD : TON; (* since CALLS has changed *)
    BOUND : TIME; (* of the age, at that change *)
END_VAR

PAUSE(IN := TRUE, PT := T#2s);
HELD(IN := TRUE, PT := T#2s);
IF (NOT STARTED) OR (ID <> LAST_ID) THEN
    BOUND := T#2s;
ELSIF CALLS <> LAST_CALLS THEN
    BOUND := AGE + PAUSE.ET;
    HELD(IN := FALSE, PT := T#2s);
    HELD(IN := TRUE, PT := T#2s);
END_IF;
FRESH := BOUND + HELD.ET < {fresh};
PAUSE(IN := FALSE, PT := T#2s);
PAUSE(IN := TRUE, PT := T#2s);
LAST_ID := ID;
LAST_CALLS := CALLS;
STARTED := TRUE;
END_FUNCTION_BLOCK

)";

constexpr char kVariables[] =
    R"(VAR
    IDX : INT;
    CALLS : UINT;
    STARTED : BOOL; (* SEQ is known *)
    HAS_READ : BOOL; (* there was a good read *)
    LAST_SEQ : WORD;
    PAUSE : TON; (* since the call before: a read is at most as old as that *)
    SINCE : TON; (* since the last good read was seen *)
    BOUND : TIME; (* of its age then *)
    AGE : TIME;
END_VAR

)";

// Judges the read whose SEQ is the expression `seq`; `wrong` is true of one that must not be used.
constexpr char kJudge[] =
    R"(PAUSE(IN := TRUE, PT := T#2s);
IF READ_DONE AND NOT ({wrong}) THEN
    IF STARTED AND ({seq} <> LAST_SEQ) THEN
{take}        HAS_READ := TRUE;
        BOUND := PAUSE.ET;
        SINCE(IN := FALSE, PT := T#2s);
    END_IF;
    LAST_SEQ := {seq};
    STARTED := TRUE;
END_IF;
SINCE(IN := TRUE, PT := T#2s);
PAUSE(IN := FALSE, PT := T#2s);
PAUSE(IN := TRUE, PT := T#2s);
AGE := T#2s;
IF HAS_READ THEN
    AGE := BOUND + SINCE.ET;
END_IF;
IF CALLS = 65535 THEN
    CALLS := 0;
ELSE
    CALLS := CALLS + 1;
END_IF;
)";

// One part of the view: its name in the text and its first cell.
struct Part {
    std::string name;
    unsigned at, size;
    std::string id;
};

std::vector<Part> parts_of_view() {
    std::vector<Part> parts;
    for (const Copy& copy : area_with(Block::view).copies) switch (copy.from) {
            case kGlobalAt: parts.push_back({"NODE", copy.at, copy.count, "1"}); break;
            case kGraspAt: parts.push_back({"GRASP", copy.at, copy.count, "2"}); break;
            case kDoubtsAt: parts.push_back({"DOUBTS", copy.at, copy.count, "3"}); break;
            case kToolAt: parts.push_back({"WRENCH", copy.at, copy.count, "4"}); break;
            case kSensorsAt:
                for (unsigned n = 0; n < 2; ++n)
                    parts.push_back(
                        {fmt::format("SENSOR[{}]", n), copy.at + n * kSensorSize, kSensorSize, std::to_string(16 + n)});
        }
    return parts;
}

std::string take(const Part& part, std::string_view from) {
    return fmt::format("        FOR IDX := 0 TO {} DO\n            {}.CELLS[IDX] := {};\n        END_FOR;\n", part.size - 1,
                       part.name, from);
}

std::string stamp(const Part& part) {
    return fmt::format("{0}.ID := {1};\n{0}.CALLS := CALLS;\n{0}.AGE := AGE;\n", part.name, part.id);
}

std::string read_view() {
    const auto parts = parts_of_view();
    unsigned node = 0;
    std::string taken, stamped;
    for (const Part& part : parts) {
        if (part.name == "NODE") node = part.at;
        taken += take(part, fmt::format("VIEW_REGS[IDX + {}]", part.at));
        stamped += stamp(part);
    }
    std::string out = fmt::format(
        "(* The first call, in every cycle. READ_DONE: a read of VIEW_REGS, {} registers from {}, has ended well since the "
        "call\n   before; it may stay TRUE. *)\nFUNCTION_BLOCK FB_TACTILED\nVAR_INPUT\n    VIEW_REGS : T_TACTILED_REGS;\n"
        "    READ_DONE : BOOL;\nEND_VAR\nVAR_OUTPUT\n",
        kViewSize, kViewAt);
    put_field(out, "NODE", "T_TACTILED_PIECE", "for FB_TACTILED_NODE, _WEIGHT and _WRITE");
    put_field(out, "GRASP", "T_TACTILED_PIECE", "for FB_TACTILED_WEIGHT");
    put_field(out, "DOUBTS", "T_TACTILED_PIECE", "likewise");
    put_field(out, "WRENCH", "T_TACTILED_PIECE", "for FB_TACTILED_WRENCH");
    put_field(out, "SENSOR", "T_TACTILED_JAWS", "for FB_TACTILED_SENSOR: the first two sensors");
    put_field(out, "ARRIVES", "BOOL", "the last good read is fresh, as of this call: for a lamp");
    put_field(out, "WRONG_MAP", "BOOL", "no tactiled of this major version from 1.9 on, or off by one register");
    put_field(out, "TORN", "BOOL", "the registers are of two reads");
    out += fmt::format("END_VAR\n{}", kVariables);
    out += fmt::format(
        "WRONG_MAP := (VIEW_REGS[{}] <> 16#5441) OR (VIEW_REGS[{}] <> 16#4354) OR (WORD_TO_UINT(VIEW_REGS[{}]) / 256 <> "
        "{});\nTORN := VIEW_REGS[0] <> VIEW_REGS[{}];\n",
        node + kMagic0, node + kMagic1, node + kMapVersion, kMapMajor, kViewSize - 1);
    out += fmt::format(kJudge, fmt::arg("wrong", "WRONG_MAP OR TORN"), fmt::arg("seq", "VIEW_REGS[0]"),
                       fmt::arg("take", taken));
    return out + stamped + "ARRIVES := AGE < " + fresh() + ";\nEND_FUNCTION_BLOCK\n\n";
}

std::string read_further() {
    const Part part{"SENSOR", 0, kSensorSize, "WORD_TO_UINT(INT_TO_WORD(NUMBER)) + 16"};
    std::string out = fmt::format(
        "(* The same for a further sensor, one instance each: SENSOR_REGS are up to 5 sensors, {} registers each from {} + "
        "{} n.\n   FIRST is the number of the first one in them, NUMBER that of this one. *)\nFUNCTION_BLOCK "
        "FB_TACTILED_FURTHER\nVAR_INPUT\n"
        "    SENSOR_REGS : T_TACTILED_REGS;\n    READ_DONE : BOOL;\n    FIRST : INT; (* 0 .. 15 *)\n    NUMBER : INT; (* "
        "FIRST .. FIRST + 4 *)\nEND_VAR\nVAR_OUTPUT\n",
        kSensorSize, kSensorsAt, kSensorSize);
    put_field(out, "SENSOR", "T_TACTILED_PIECE", "for FB_TACTILED_SENSOR");
    put_field(out, "TORN", "BOOL", "the registers are of two reads, or NUMBER is not among them");
    out += fmt::format(
        "END_VAR\n{}IDX := 0;\nTORN := (NUMBER < FIRST) OR (FIRST + 4 < NUMBER);\nIF NOT TORN THEN\n    IDX := (NUMBER - "
        "FIRST) * {};\nEND_IF;\n"
        "BASE := IDX;\nTORN := TORN OR (SENSOR_REGS[BASE] <> SENSOR_REGS[BASE + {}]);\n",
        std::string(kVariables).replace(0, 4, "VAR\n    BASE : INT;\n"), kSensorSize, unsigned(kSensorSeqEnd));
    out += fmt::format(kJudge, fmt::arg("wrong", "TORN"), fmt::arg("seq", "SENSOR_REGS[BASE]"),
                       fmt::arg("take", take(part, "SENSOR_REGS[BASE + IDX]")));
    return out + stamp(part) + "END_FUNCTION_BLOCK\n\n";
}

}  // namespace

std::string structured_read() {
    return fmt::format(kTypesAndAge, fmt::arg("last_cell", kGlobalSize - 1), fmt::arg("last", kViewSize - 1),
                       fmt::arg("fresh", fresh()), fmt::arg("fresh_s", kFresh_ms / 1e3)) +
           read_view() + read_further();
}

}  // namespace tactiled::ctl
