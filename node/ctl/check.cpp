// tactilectl check FILE: a configuration with all that it refers to; every error at once.
#include <fmt/format.h>

#include <memory>

#include "node/ctl/command_line.hpp"
#include "node/ctl/verb.hpp"
#include "node/setup.hpp"

namespace tactiled::ctl {

void add_check(CLI::App& app, Run& run) {
    auto path = std::make_shared<std::string>();
    auto* verb = add_verb(app, "check", "Checks a configuration and its calibrations; prints every error in them");
    verb->add_option("file", *path, "the configuration")->required();
    verb->callback([path, &run] {
        run = [path] {
            Problems problems;
            const Node node = load_node(*path, problems);
            for (const auto& line : problems.lines()) fmt::print(stderr, "{}\n", line);
            if (!problems.empty()) return kUnhealthy;
            fmt::print("{}: good: {} links, {} sensors\n", *path, node.links.size(), node.sensors.size());
            return kGood;
        };
    });
}

}  // namespace tactiled::ctl
