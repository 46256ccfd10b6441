// Sends one command to the daemon and returns its answer.
#pragma once
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

struct Answer {
    int exit_status = 0;  // kNotReachable if there was no answer; `text` then has the reason
    int result = 0;       // enum tactiled_command_result
    std::string text;     // explanation by the daemon
};

// Sends "NODE WORDS" to the control socket of `segment`'s daemon.
Answer ask(const Segment& segment, const std::string& words, double timeout_s);
// Returns the raw answer, for requests that are not commands; "" with `why` set if there is no answer.
std::string ask_plain(const Segment& segment, const std::string& words, double timeout_s, std::string& why);

}  // namespace tactiled::ctl
