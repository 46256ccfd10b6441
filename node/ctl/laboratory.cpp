#include "node/ctl/laboratory.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <system_error>

#include "node/ctl/verb.hpp"

namespace tactiled::ctl {

std::optional<int> start_laboratory(char** argv) {
    char** word = *argv != nullptr ? argv + 1 : argv;  // a program may be started without a name
    while (*word != nullptr && **word == '-') ++word;
    if (*word == nullptr || std::none_of(std::begin(kLaboratoryVerbs), std::end(kLaboratoryVerbs),
                                         [&](const auto& verb) { return std::strcmp(verb.name, *word) == 0; }))
        return std::nullopt;
    std::error_code error;
    const auto here = std::filesystem::read_symlink("/proc/self/exe", error);
    if (error) {
        fmt::print(stderr, "tactilectl: {}: /proc/self/exe: {}\n", *word, error.message());
        return kUnhealthy;
    }
    const auto program = here.parent_path() / "tactilectl-lab";
    ::execv(program.c_str(), argv);
    if (errno == ENOENT) {
        fmt::print(stderr, "tactilectl: {} is in the package tactiled-lab, which is not installed: there is no {}\n", *word,
                   program.native());
        return kUsage;
    }
    fmt::print(stderr, "tactilectl: {}: {}: {}\n", *word, program.native(), std::strerror(errno));
    return kUnhealthy;
}

}  // namespace tactiled::ctl
