// tactilectl clear: clears latched faults and slip latches, as the PLC's command does.
#include <fmt/format.h>

#include <memory>

#include "node/ctl/ask.hpp"
#include "node/ctl/command_line.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

struct Args {
    std::string node = "gripper";
    double timeout_s = 5;
};

int clear(const Args& args) {
    const Answer answer = ask(open_node(args.node), "clear", args.timeout_s);
    const bool done = answer.exit_status == kGood;
    fmt::print(done ? stdout : stderr, "clear: {}\n", done ? "done; a fault whose cause lasts comes back" : "refused");
    return answer.exit_status;
}

}  // namespace

Run add_clear(Command verb) {
    auto args = std::make_shared<Args>();
    add_node_option(verb, args->node);
    add_timeout_option(verb, args->timeout_s);
    return [args] { return clear(*args); };
}

}  // namespace tactiled::ctl
