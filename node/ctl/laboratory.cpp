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
#include "node/ctl/verb_first.hpp"

namespace tactiled::ctl {

std::optional<int> start_laboratory(const std::vector<char*>& words) {
    const std::string_view word = verb_of(words);
    if (std::none_of(std::begin(kLaboratoryVerbs), std::end(kLaboratoryVerbs),
                     [&](const auto& verb) { return verb.name == word; }))
        return std::nullopt;
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
