// Sends one command to the daemon and returns its answer.
#pragma once
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// Opens the segment of the daemon `node`. Throws VerbError with kNotReachable.
Segment open_node(const std::string& node);

struct Answer {
    int exit_status = 0;  // kGood, kUnhealthy
    int result = 0;       // enum tactiled_command_result
    std::string text;     // explanation by the daemon
};

// Sends "NODE WORDS" to the control socket of `segment`'s daemon. Throws VerbError with kNotReachable if there is no
// answer.
Answer ask(const Segment& segment, const std::string& words, double timeout_s);
// Returns the raw answer, for requests that are not commands; "" with `why` set if there is no answer.
std::string ask_plain(const Segment& segment, const std::string& words, double timeout_s, std::string& why);

}  // namespace tactiled::ctl
