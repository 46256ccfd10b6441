#include "node/ctl/ask.hpp"

#include <fmt/format.h>

#include <cstdio>

#include "node/control.hpp"
#include "node/ctl/liveness.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {

std::string ask_plain(const Segment& segment, const std::string& words, double timeout_s, std::string& why) {
    const std::string control = segment.header().control;
    if (control.empty()) {
        why = "the daemon runs without a control socket; its log has the reason";
        return "";
    }
    std::string reply = ask_daemon(control, fmt::format("{} {}", segment.header().name, words), int(timeout_s * 1000), why);
    if (const Liveness liveness = liveness_of(segment); reply.empty() && !liveness.runs()) why = liveness.why;
    return reply;
}

Segment open_node(const std::string& node) {
    std::string why;
    Segment segment = Segment::try_open(node, why);
    if (!segment.is_open()) throw VerbError(kNotReachable, why);
    return segment;
}

Answer ask(const Segment& segment, const std::string& words, double timeout_s) {
    Answer answer;
    std::string why;
    const std::string reply = ask_plain(segment, words, timeout_s, why);
    int state = 0, used = 0;
    if (std::sscanf(reply.c_str(), "%d %d%n", &state, &answer.result, &used) != 2)
        throw VerbError(kNotReachable, why.empty() ? "unreadable answer of the daemon" : why);
    answer.text = reply.substr(std::min(reply.size(), std::size_t(used) + 1));
    answer.exit_status = answer.result == TACTILED_COMMAND_OK ? kGood : kUnhealthy;
    return answer;
}

}  // namespace tactiled::ctl
