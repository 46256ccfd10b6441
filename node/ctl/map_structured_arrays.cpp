// The PLC function block that joins the pages of an array.
#include <fmt/format.h>

#include "node/ctl/map_text.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::ctl {
namespace {

using namespace modbus;

constexpr char kDeclaration[] =
    R"((* Joins the pages of an array, one instance for each array. To begin, read {head} registers from {heads} + {head} n, n = 0 for
   the first sensor, into HEAD_REGS and call it with HEAD_READ. While BUSY, read {page} registers from PAGE_AT into PAGE_REGS
   and call it with PAGE_READ and PAGE_FROM, the address that this read was requested with. All other calls have neither. After
   an exception, begin again. Call it in every cycle, and use VALUES while OK: they are of one snapshot, those of a taxel
   together, -32768 without a force.

   The pages are those of the array whose head was read last on this connection: read one array after the other. *)
TYPE T_TACTILED_HEAD_REGS : ARRAY[0..{last_of_head}] OF WORD;
END_TYPE

TYPE T_TACTILED_PAGE_REGS : ARRAY[0..{last_of_page}] OF WORD;
END_TYPE

TYPE T_TACTILED_VALUES : ARRAY[0..{last_value}] OF INT;
END_TYPE

FUNCTION_BLOCK FB_TACTILED_ARRAY
VAR_INPUT
    HEAD_REGS : T_TACTILED_HEAD_REGS;
    PAGE_REGS : T_TACTILED_PAGE_REGS;
    HEAD_READ : BOOL; (* HEAD_REGS were read since the last call *)
    PAGE_READ : BOOL; (* its rising edge: PAGE_REGS were read *)
    PAGE_FROM : UINT; (* the address of that read; a page that is not the one at PAGE_AT is not taken *)
END_VAR
VAR_OUTPUT
    BUSY : BOOL; (* the page at PAGE_AT is needed *)
    PAGE_AT : UINT;
    VALID : BOOL; (* VALUES are whole, their last page was read within {fresh_s} s, and their head within {expires} s *)
    OK : BOOL; (* VALID, and GOOD *)
    MIXED : BOOL; (* a page had another token: begin again *)
    TOO_LONG : BOOL; (* the array has more values: print this text with a larger --values *)
    STATUS : WORD; (* SENSOR_GOOD and so on *)
    REASON : UINT; (* why it is not GOOD: REASON_STALE and so on *)
    TAXELS : UINT;
    UNIT_N : REAL; (* newtons of one count of VALUES *)
    VALUES : T_TACTILED_VALUES;
END_VAR
VAR
    IDX : INT;
    BASE : INT;
    PAGE : INT;
    PAGES : INT;
    TOKEN : WORD;
    WAS_READ : BOOL;
    WHOLE : BOOL;
    SINCE_HEAD : TON;
    SINCE_READ : TON; (* of the head or a page *)
END_VAR

)";

constexpr char kBegin[] =
    R"(IF HEAD_READ THEN
    WHOLE := FALSE;
    MIXED := FALSE;
    SINCE_HEAD(IN := FALSE, PT := T#{expires}s);
    SINCE_READ(IN := FALSE, PT := {fresh});
    PAGE := 0;
    PAGE_AT := {pages};
    TOKEN := HEAD_REGS[0];
    PAGES := WORD_TO_INT(HEAD_REGS[{n_pages}]);
    TOO_LONG := {max_pages} < PAGES;
    BUSY := (0 < PAGES) AND (NOT TOO_LONG);
    STATUS := HEAD_REGS[{status}];
    REASON := WORD_TO_UINT(HEAD_REGS[3]);
    TAXELS := WORD_TO_UINT(HEAD_REGS[6]);
)";

constexpr char kJoin[] =
    R"(ELSIF PAGE_READ AND (NOT WAS_READ) AND BUSY AND (PAGE_FROM = PAGE_AT) THEN
    IF PAGE_REGS[0] = TOKEN THEN
        BASE := PAGE * {values};
        FOR IDX := 0 TO {last_index} DO
            VALUES[BASE + IDX] := WORD_TO_INT(PAGE_REGS[IDX + 1]);
        END_FOR;
        PAGE := PAGE + 1;
        PAGE_AT := PAGE_AT + {page};
        WHOLE := PAGE = PAGES;
        BUSY := NOT WHOLE;
        SINCE_READ(IN := FALSE, PT := {fresh});
    ELSE
        MIXED := TRUE;
        BUSY := FALSE;
    END_IF;
END_IF;
WAS_READ := PAGE_READ;
SINCE_HEAD(IN := TRUE, PT := T#{expires}s);
SINCE_READ(IN := TRUE, PT := {fresh});
VALID := WHOLE AND (NOT SINCE_HEAD.Q) AND (NOT SINCE_READ.Q);
BUSY := BUSY AND (NOT SINCE_HEAD.Q);
OK := VALID AND ((STATUS AND 16#0001) <> 16#0000);
END_FUNCTION_BLOCK
)";

}  // namespace

std::string structured_arrays(unsigned values) {
    const unsigned max_pages = (values + kPageValues - 1) / kPageValues;
    std::string out =
        fmt::format(kDeclaration, fmt::arg("head", kHeadSize), fmt::arg("heads", kHeadsAt), fmt::arg("page", kPageSize),
                    fmt::arg("last_of_head", kHeadSize - 1), fmt::arg("last_of_page", kPageSize - 1),
                    fmt::arg("last_value", max_pages * kPageValues - 1), fmt::arg("expires", kExpires_s),
                    fmt::arg("fresh_s", kFresh_ms / 1e3));
    out += fmt::format(kBegin, fmt::arg("pages", kPagesAt), fmt::arg("n_pages", unsigned(kArrayPages)),
                       fmt::arg("max_pages", max_pages), fmt::arg("status", unsigned(kArrayStatus)),
                       fmt::arg("expires", kExpires_s), fmt::arg("fresh", fresh()));
    find_unit(out, "HEAD_REGS[5]", "UNIT_N", "    ");
    return out + fmt::format(kJoin, fmt::arg("values", kPageValues), fmt::arg("last_index", kPageValues - 1),
                             fmt::arg("page", kPageSize), fmt::arg("expires", kExpires_s), fmt::arg("fresh", fresh()));
}

}  // namespace tactiled::ctl
