// The PLC function block for commands: the handshake of CMD_SEQ, and the PLC's heartbeat.
#include <fmt/format.h>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

constexpr char kDeclaration[] =
    R"((* Runs one command at each rising edge of EXECUTE and follows it to its result. Call it once after each read of the
   global block, one instance for each PLC. Write COMMAND_REGS with one FC 16 to {0} .. {1}, in every cycle or while BUSY,
   and HEARTBEAT_REG with FC 6 to {2} in every cycle. Never write 5010 .. 5017 or the coils in every cycle.

   The number of a command is the last one that the daemon took, plus one. A daemon that has started since takes the first
   number without running its command; this block then writes the next one. After TIMEOUT_S the command is withdrawn: it
   will not run when a broken connection comes back. *)
TYPE T_TACTILED_COMMAND_REGS : ARRAY[0..4] OF WORD;
END_TYPE

FUNCTION_BLOCK FB_TACTILED_COMMAND
VAR_INPUT
    GLOBAL_REGS : T_TACTILED_GLOBAL_REGS;
    GLOBAL_OK : BOOL; (* of FB_TACTILED *)
    EXECUTE : BOOL;
    CMD : UINT; (* C.CMD_TARE and so on *)
    MASK : WORD; (* bit n: sensor n *)
    PARAM_H : UINT;
    PARAM_L : UINT;
    CALLS_PER_SECOND : UINT := 100;
    TIMEOUT_S : UINT := 20;
END_VAR
VAR_OUTPUT
    COMMAND_REGS : T_TACTILED_COMMAND_REGS;
    HEARTBEAT_REG : WORD;
    BUSY : BOOL;
    DONE : BOOL; (* until the next EXECUTE *)
    ERROR : BOOL; (* likewise; RESULT tells why *)
    RESULT : UINT; (* C.RESULT_OK and so on *)
    WRITES_ARRIVE : BOOL; (* the daemon has echoed another HEARTBEAT_REG within half a second *)
END_VAR
VAR
    WAS_EXECUTED : BOOL;
    WRITTEN : BOOL;
    TRIES : UINT;
    NUMBER : UINT;
    CALLS : UDINT;
    STARTED : BOOL;
    BEAT : UINT;
    LAST_ECHO : WORD;
    STILL : UINT;
END_VAR

)";

constexpr char kBody[] =
    R"(IF BEAT = 65535 THEN
    BEAT := 0;
ELSE
    BEAT := BEAT + 1;
END_IF;
HEARTBEAT_REG := UINT_TO_WORD(BEAT);
IF NOT STARTED THEN
    STILL := 60000;
ELSIF GLOBAL_REGS[{echo}] <> LAST_ECHO THEN
    STILL := 0;
ELSIF STILL < 60000 THEN
    STILL := STILL + 1;
END_IF;
LAST_ECHO := GLOBAL_REGS[{echo}];
STARTED := TRUE;
WRITES_ARRIVE := GLOBAL_OK AND (STILL < CALLS_PER_SECOND / 2 + 1);

IF EXECUTE AND (NOT WAS_EXECUTED) AND (NOT BUSY) THEN
    BUSY := TRUE;
    DONE := FALSE;
    ERROR := FALSE;
    RESULT := {ok};
    WRITTEN := FALSE;
    TRIES := 0;
    CALLS := 0;
END_IF;
WAS_EXECUTED := EXECUTE;

IF BUSY AND GLOBAL_OK THEN
    IF NOT WRITTEN THEN
        NUMBER := WORD_TO_UINT(GLOBAL_REGS[{ack}]);
        IF NUMBER = 65535 THEN
            NUMBER := 1;
        ELSE
            NUMBER := NUMBER + 1;
        END_IF;
        COMMAND_REGS[0] := UINT_TO_WORD(CMD);
        COMMAND_REGS[1] := MASK;
        COMMAND_REGS[2] := UINT_TO_WORD(PARAM_H);
        COMMAND_REGS[3] := UINT_TO_WORD(PARAM_L);
        COMMAND_REGS[4] := UINT_TO_WORD(NUMBER);
        WRITTEN := TRUE;
        TRIES := TRIES + 1;
    ELSIF GLOBAL_REGS[{ack}] = COMMAND_REGS[4] THEN
        RESULT := WORD_TO_UINT(GLOBAL_REGS[{result}]);
        IF (RESULT = {adopted}) AND (TRIES < 5) THEN
            WRITTEN := FALSE;
        ELSIF WORD_TO_UINT(GLOBAL_REGS[{state}]) = {done} THEN
            DONE := TRUE;
            BUSY := FALSE;
        ELSIF WORD_TO_UINT(GLOBAL_REGS[{state}]) = {rejected} THEN
            ERROR := TRUE;
            BUSY := FALSE;
        END_IF;
    END_IF;
END_IF;

IF BUSY THEN
    CALLS := CALLS + 1;
    IF CALLS >= UINT_TO_UDINT(CALLS_PER_SECOND) * UINT_TO_UDINT(TIMEOUT_S) THEN
        ERROR := TRUE;
        BUSY := FALSE;
        RESULT := {timed_out};
        COMMAND_REGS[0] := 16#0000;
        COMMAND_REGS[1] := 16#0000;
    END_IF;
END_IF;
END_FUNCTION_BLOCK
)";

std::uint16_t value_of(std::string_view of, std::string_view id) {
    for (const Name& name : names_of(of))
        if (name.id == id) return name.value;
    return 0xFFFF;
}

}  // namespace

std::string structured_commands() {
    const auto result = [](std::string_view id) { return value_of("global.CMD_RESULT", id); };
    const auto state = [](std::string_view id) { return value_of("global.CMD_STATE", id); };
    return fmt::format(kDeclaration, unsigned(kCmd), unsigned(kCmdSeq), unsigned(kPlcHeartbeat)) +
           fmt::format(kBody, fmt::arg("echo", unsigned(kPlcHbEcho)), fmt::arg("ack", unsigned(kCmdSeqAck)),
                       fmt::arg("state", unsigned(kCmdState)), fmt::arg("result", unsigned(kCmdResult)),
                       fmt::arg("ok", result("OK")), fmt::arg("adopted", result("ADOPTED")),
                       fmt::arg("timed_out", result("TIMED_OUT")), fmt::arg("done", state("DONE")),
                       fmt::arg("rejected", state("REJECTED")));
}

}  // namespace tactiled::ctl
