// tactilectl clear: clears latched faults and slip latches, as the PLC's command does.
#include <fmt/format.h>

#include <memory>

#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

int clear(const std::string& node, double timeout_s) {
    std::string why;
    const Segment segment = Segment::try_open(node, why);
    if (!segment.is_open()) {
        fmt::print(stderr, "tactilectl: {}\n", why);
        return kNotReachable;
    }
    const Answer answer = ask(segment, "clear", timeout_s);
    if (answer.exit_status == kNotReachable)
        fmt::print(stderr, "tactilectl: {}\n", answer.text);
    else
        fmt::print(answer.exit_status == kGood ? stdout : stderr, "clear: {}\n",
                   answer.exit_status == kGood ? "done; a fault whose cause lasts comes back" : "refused");
    return answer.exit_status;
}

}  // namespace

void add_clear(Command program, Run& run) {
    struct Args {
        std::string node = "gripper";
        double timeout_s = 5;
    };
    auto args = std::make_shared<Args>();
    Command verb = add_verb(program, "clear", "Clears latched faults and slip latches", "  tactilectl clear\n");
    add_node_option(verb, args->node);
    verb.add_option("--timeout", args->timeout_s, "seconds to wait for the daemon's answer")
        .number_in(0.1, 60.0)
        .show_default();
    verb.callback([args, &run] { run = [args] { return clear(args->node, args->timeout_s); }; });
}

}  // namespace tactiled::ctl
