// State of the daemon behind a segment. The segment of a daemon that was killed remains, with its last values.
#pragma once
#include <string>
#include <string_view>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

struct Liveness {
    const char* word = "running";  // "running", "ended", "hangs" or "dead"
    std::string why;               // text with the remedy; "" if the daemon runs
    [[nodiscard]] bool runs() const { return why.empty(); }
    [[nodiscard]] bool is_dead() const { return word == std::string_view("dead"); }
};

// "ended": the daemon has closed its segment. "dead": it has published nothing for longer than its watchdog_ms, and
// no process with its number is a tactiled. "hangs": the same, and there is such a process.
Liveness liveness_of(const SegmentView& segment);

// Returns the reason why commands cannot reach the daemon behind `segment`: its control socket is missing or belongs
// to another user. "" if it can be used.
std::string control_fault(const SegmentView& segment);

}  // namespace tactiled::ctl
