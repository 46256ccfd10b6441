#include "node/lab/output.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "config/options.hpp"

namespace tactiled::ctl {

void check_output(const std::string& path) {
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    if (std::filesystem::is_directory(path)) throw SetupError(fmt::format("{}: is a folder; name a file", path));
    if (::access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) != 0)
        throw SetupError(fmt::format("{}: no file can be written there: {}", path, std::strerror(errno)));
}

}  // namespace tactiled::ctl
