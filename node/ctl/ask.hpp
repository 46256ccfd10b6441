// One command to the daemon, and its word about it.
#pragma once
#include <string>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

struct Answer {
    int exit_status = 0;  // kNotReachable where there was none; then `text` says why
    int result = 0;       // enum tactiled_command_result
    std::string text;     // explanation by the daemon
};

// Sends "NODE WORDS" to the control socket of `segment`'s daemon.
Answer ask(const Segment& segment, const std::string& words, double timeout_s);
// The raw answer, for requests that are not commands; "" with `why` set where there is no answer.
std::string ask_plain(const Segment& segment, const std::string& words, double timeout_s, std::string& why);

}  // namespace tactiled::ctl
