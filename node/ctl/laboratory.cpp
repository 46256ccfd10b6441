#include "node/ctl/verbs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "node/ctl/verb_first.hpp"

namespace tactiled::ctl {

int start_laboratory(const std::vector<char*>& words) {
    const std::string_view word = verb_of(words);
    std::error_code error;
    const auto here = std::filesystem::read_symlink("/proc/self/exe", error);
    if (error) {
        fmt::print(stderr, "tactilectl: {}: /proc/self/exe: {}\n", word, error.message());
        return kUnhealthy;
    }
    const auto program = here.parent_path() / "tactilectl-lab";
    ::execv(program.c_str(), words.data());
    if (errno == ENOENT) {
        fmt::print(stderr, "tactilectl: {} is in the package tactiled-lab, which is not installed: there is no {}\n", word,
                   program.native());
        return kUsage;
    }
    fmt::print(stderr, "tactilectl: {}: {}: {}\n", word, program.native(), std::strerror(errno));
    return kUnhealthy;
}

}  // namespace tactiled::ctl
