// The PLC function block that writes: the handshake of CMD_SEQ, the PLC's heartbeat, and the hints of the robot.
#include <fmt/format.h>

#include <cmath>

#include "node/ctl/map_text.hpp"
#include "node/modbus/robot.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

constexpr char kDeclaration[] =
    R"((* Commands and hints, one instance for each PLC. Call it in every cycle after FB_TACTILED, and write WRITE_REGS, {size} registers,
   to {at} in every cycle with one FC 16. Never write 5010 .. 5017 or the coils in every cycle.

   A rising edge of EXECUTE runs CMD once and follows it to its result. The number of a command is the last one that the
   daemon took, plus one. A daemon that has started since takes the first number without running its command; this block then
   writes the next one. After TIMEOUT the command is withdrawn: it will not run when a broken connection comes back.

   Hints hold while these writes arrive. Leave HAS_GRAVITY FALSE on a gripper that is not turned: the configuration has it. *)
TYPE T_TACTILED_WRITE_REGS : ARRAY[0..{last}] OF WORD;
END_TYPE

FUNCTION_BLOCK FB_TACTILED_WRITE
VAR_INPUT
    NODE : T_TACTILED_PIECE; (* of FB_TACTILED *)
    EXECUTE : BOOL;
    CMD : UINT; (* C.CMD_TARE and so on *)
    MASK : WORD; (* bit n: sensor n *)
    PARAM_H : UINT;
    PARAM_L : UINT;
    TIMEOUT : TIME := T#20s;
    GRIPPER_STATE : UINT := 65535; (* C.GRIPPER_LIFTING and so on; 65535 and any other number: no hint *)
    HAS_GRAVITY : BOOL; (* the robot turns the gripper, and GRAVITY is known *)
    GRAVITY_X : REAL; (* m/s2, frame G, 9.81 in all *)
    GRAVITY_Y : REAL;
    GRAVITY_Z : REAL;
    HAS_ACCEL : BOOL; (* ACCEL is new in this call; the words keep it for {accel_ms} ms, for a slower fieldbus *)
    ACCEL_X : REAL; (* m/s2, frame G, without gravity *)
    ACCEL_Y : REAL;
    ACCEL_Z : REAL;
END_VAR
VAR_OUTPUT
    WRITE_REGS : T_TACTILED_WRITE_REGS;
    BUSY : BOOL;
    DONE : BOOL; (* until the next EXECUTE *)
    ERROR : BOOL; (* likewise; RESULT tells why *)
    RESULT : UINT; (* C.RESULT_OK and so on *)
    WRITES_ARRIVE : BOOL; (* the daemon has echoed another heartbeat within {fresh_s} s *)
    BAD_GRAVITY : BOOL; (* GRAVITY is not as on Earth: it is written as not known, and the rest of the write as it is *)
END_VAR
VAR
    JUDGE : FB_TACTILED_AGE;
    FRESH : BOOL;
    WAS_EXECUTED : BOOL;
    WRITTEN : BOOL;
    TRIES : UINT;
    NUMBER : UINT;
    SINCE_EXECUTE : TON;
    BEAT : UINT;
    ECHOED : BOOL;
    HAS_ECHO : BOOL;
    LAST_ECHO : WORD;
    SINCE_ECHO : TON;
    COUNT : UINT; (* of the values of ACCEL *)
    ACCEL_STATED : BOOL;
    SINCE_ACCEL : TON;
    IDX : INT;
    SQUARES : DINT;
END_VAR

)";

constexpr char kBody[] =
    R"(JUDGE(ID := NODE.ID, CALLS := NODE.CALLS, AGE := NODE.AGE);
FRESH := JUDGE.FRESH;
IF BEAT = 65535 THEN
    BEAT := 0;
ELSE
    BEAT := BEAT + 1;
END_IF;
WRITE_REGS[{beat}] := UINT_TO_WORD(BEAT);
IF FRESH THEN
    IF HAS_ECHO AND (NODE.CELLS[{echo}] <> LAST_ECHO) THEN
        ECHOED := TRUE;
        SINCE_ECHO(IN := FALSE, PT := {fresh});
    END_IF;
    LAST_ECHO := NODE.CELLS[{echo}];
    HAS_ECHO := TRUE;
END_IF;
SINCE_ECHO(IN := TRUE, PT := {fresh});
WRITES_ARRIVE := FRESH AND ECHOED AND (NOT SINCE_ECHO.Q);

IF EXECUTE AND (NOT WAS_EXECUTED) AND (NOT BUSY) THEN
    BUSY := TRUE;
    DONE := FALSE;
    ERROR := FALSE;
    RESULT := {ok};
    WRITTEN := FALSE;
    TRIES := 0;
    SINCE_EXECUTE(IN := FALSE, PT := TIMEOUT);
END_IF;
WAS_EXECUTED := EXECUTE;

IF BUSY AND FRESH THEN
    IF NOT WRITTEN THEN
        NUMBER := WORD_TO_UINT(NODE.CELLS[{ack}]);
        IF NUMBER = 65535 THEN
            NUMBER := 1;
        ELSE
            NUMBER := NUMBER + 1;
        END_IF;
        WRITE_REGS[0] := UINT_TO_WORD(CMD);
        WRITE_REGS[1] := MASK;
        WRITE_REGS[2] := UINT_TO_WORD(PARAM_H);
        WRITE_REGS[3] := UINT_TO_WORD(PARAM_L);
        WRITE_REGS[4] := UINT_TO_WORD(NUMBER);
        WRITTEN := TRUE;
        TRIES := TRIES + 1;
    ELSIF NODE.CELLS[{ack}] = WRITE_REGS[4] THEN
        RESULT := WORD_TO_UINT(NODE.CELLS[{result}]);
        IF (RESULT = {adopted}) AND (TRIES < 5) THEN
            WRITTEN := FALSE;
        ELSIF WORD_TO_UINT(NODE.CELLS[{state}]) = {done} THEN
            DONE := TRUE;
            BUSY := FALSE;
        ELSIF WORD_TO_UINT(NODE.CELLS[{state}]) = {rejected} THEN
            ERROR := TRUE;
            BUSY := FALSE;
        END_IF;
    END_IF;
END_IF;

SINCE_EXECUTE(IN := BUSY, PT := TIMEOUT);
IF SINCE_EXECUTE.Q THEN
    ERROR := TRUE;
    BUSY := FALSE;
    RESULT := {timed_out};
    WRITE_REGS[0] := 16#0000;
    WRITE_REGS[1] := 16#0000;
END_IF;

WRITE_REGS[{gripper}] := UINT_TO_WORD(GRIPPER_STATE);
IF {last_state} < GRIPPER_STATE THEN
    WRITE_REGS[{gripper}] := 16#FFFF;
END_IF;
WRITE_REGS[{force}] := 16#FFFF;
)";

// Gravity is stated with its length, in counts of 0.001 m/s2, between the limits of the daemon, which refuses a whole write
// for another one. A gravity that is turned and bad is not known; 0, 0, 0 says nothing, and leaves the configured one.
constexpr char kGravity[] =
    R"(    SQUARES := 0;
    FOR IDX := {x} TO {z} DO
        SQUARES := SQUARES + INT_TO_DINT(WORD_TO_INT(WRITE_REGS[IDX])) * INT_TO_DINT(WORD_TO_INT(WRITE_REGS[IDX]));
    END_FOR;
    BAD_GRAVITY := (SQUARES < {least}) OR ({most} < SQUARES);
END_IF;
IF NOT HAS_GRAVITY THEN
)";

// Returns the place of a register of the commands in the block that is written.
unsigned place_of(std::uint16_t address) {
    for (const Copy& copy : area_with(Block::cycle).copies)
        if (address >= copy.from && address < copy.from + copy.count) return copy.at + (address - copy.from);
    return 0;
}

// Writes one word into the three registers of a vector.
std::string fill_vector(std::string_view indent, unsigned at, std::string_view word) {
    std::string out;
    for (unsigned axis = 0; axis < 3; ++axis) out += fmt::format("{}WRITE_REGS[{}] := {};\n", indent, at + axis, word);
    return out;
}

// Begins an IF that writes the three components of a known vector, in 0.001 m/s2. A component out of range is not known.
std::string write_vector(std::string_view name, unsigned at, double limit_m_s2) {
    std::string out = fmt::format("IF HAS_{}", name);
    for (const char axis : {'X', 'Y', 'Z'})
        out += fmt::format(" AND (-{2:.1f} < {0}_{1}) AND ({0}_{1} < {2:.1f})", name, axis, limit_m_s2);
    out += " THEN\n";
    for (const char axis : {'X', 'Y', 'Z'})
        out += fmt::format("    WRITE_REGS[{}] := INT_TO_WORD(REAL_TO_INT({}_{} * 1000.0));\n", at + unsigned(axis - 'X'),
                           name, axis);
    return out;
}

// The limits are those of the daemon less one count, because its sum of squares is rounded.
std::string write_gravity() {
    const auto squares = [](double length_m_s2) { return std::lround(length_m_s2 * length_m_s2 * 1e6); };
    const unsigned at = place_of(kGravityX);
    return "BAD_GRAVITY := HAS_GRAVITY;\n" + write_vector("GRAVITY", at, 10) +
           fmt::format(kGravity, fmt::arg("x", at), fmt::arg("z", at + 2), fmt::arg("least", squares(Robot::kMinG_m_s2) + 1),
                       fmt::arg("most", squares(Robot::kMaxG_m_s2) - 1)) +
           fill_vector("    ", at, "16#0000") + "ELSIF BAD_GRAVITY THEN\n" + fill_vector("    ", at, "16#8000") +
           "END_IF;\n";
}

// The words are those of a measurement for as long as the daemon would use it. A later write, for example the first one
// after an outage, has "not known": the daemon takes the time of a write as that of the measurement.
std::string write_acceleration() {
    const unsigned at = place_of(kAccelX);
    const std::string limit = fmt::format("T#{}ms", Robot::kAccelerationLasts_ms);
    return write_vector("ACCEL", at, 32) +
           fmt::format(
               "    IF COUNT = 65535 THEN\n        COUNT := 0;\n    ELSE\n        COUNT := COUNT + 1;\n    END_IF;\n"
               "    ACCEL_STATED := TRUE;\n    SINCE_ACCEL(IN := FALSE, PT := {0});\nEND_IF;\n"
               "WRITE_REGS[{1}] := UINT_TO_WORD(COUNT);\nSINCE_ACCEL(IN := ACCEL_STATED, PT := {0});\n"
               "IF SINCE_ACCEL.Q THEN\n    ACCEL_STATED := FALSE;\nEND_IF;\nIF NOT ACCEL_STATED THEN\n",
               limit, place_of(kAccelCount)) +
           fill_vector("    ", at, "16#8000") + "END_IF;\n";
}

std::uint16_t value_of(std::string_view of, std::string_view id) {
    for (const Name& name : names_of(of))
        if (name.id == id) return name.value;
    return 0xFFFF;
}

}  // namespace

std::string structured_write() {
    const auto result = [](std::string_view id) { return value_of("global.CMD_RESULT", id); };
    const auto state = [](std::string_view id) { return value_of("global.CMD_STATE", id); };
    return fmt::format(kDeclaration, fmt::arg("size", kCycleSize), fmt::arg("at", kCycleAt),
                       fmt::arg("last", kCycleSize - 1), fmt::arg("fresh_s", kFresh_ms / 1e3),
                       fmt::arg("accel_ms", Robot::kAccelerationLasts_ms)) +
           fmt::format(kBody, fmt::arg("beat", place_of(kPlcHeartbeat)), fmt::arg("echo", unsigned(kPlcHbEcho)),
                       fmt::arg("ack", unsigned(kCmdSeqAck)), fmt::arg("state", unsigned(kCmdState)),
                       fmt::arg("result", unsigned(kCmdResult)), fmt::arg("ok", result("OK")),
                       fmt::arg("adopted", result("ADOPTED")), fmt::arg("timed_out", result("TIMED_OUT")),
                       fmt::arg("done", state("DONE")), fmt::arg("rejected", state("REJECTED")),
                       fmt::arg("gripper", place_of(kGripperState)),
                       fmt::arg("last_state", writable_at(kGripperState)->limits.max),
                       fmt::arg("force", place_of(kGripperForce)), fmt::arg("fresh", fresh())) +
           write_gravity() + write_acceleration() + "END_FUNCTION_BLOCK\n\n";
}

}  // namespace tactiled::ctl
