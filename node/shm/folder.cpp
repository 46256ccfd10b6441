#include "node/shm/folder.hpp"

#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "config/options.hpp"
#include "drivers/descriptor.hpp"
#include "tactiled/folder.h"

namespace tactiled {
namespace {

constexpr char kAdvice[] = "give another folder with --runtime-dir";

std::string choose() {
    if (const char* given = tactiled_variable(TACTILED_FOLDER_VARIABLE)) return given;
    if (::geteuid() == 0 || ::access(TACTILED_SERVICE_FOLDER, W_OK | X_OK) == 0) return TACTILED_SERVICE_FOLDER;
    if (const char* users = tactiled_variable("XDG_RUNTIME_DIR")) return fmt::format("{}/tactiled", users);
    throw SetupError(fmt::format(
        "there is no run-time folder: {} cannot be written and XDG_RUNTIME_DIR is not set; give one that only you "
        "and root can write to, with --runtime-dir or, for readers as well, export {}=$HOME/.tactiled",
        TACTILED_SERVICE_FOLDER, TACTILED_FOLDER_VARIABLE));
}

}  // namespace

std::string runtime_folder() {
    const std::string folder = choose();
    if (folder == TACTILED_SHARED_FOLDER) return folder;
    if (::mkdir(folder.c_str(), 0755) == 0)
        ::chmod(folder.c_str(), 0755);  // independent of the umask: group and mode of the segment decide who may read
    else if (errno != EEXIST)
        throw SetupError(fmt::format("{}: {}; {}", folder, std::strerror(errno), kAdvice));
    char why[256];
    uid_t owner = 0;
    const Descriptor fd(tactiled_open_folder(folder.c_str(), &owner, why, sizeof why));
    if (fd < 0) throw SetupError(fmt::format("{}; {}", why, kAdvice));
    if (owner != ::geteuid() && ::geteuid() != 0)
        throw SetupError(fmt::format("{}: belongs to user {}, so readers would not trust a segment of user {} there; {}",
                                     folder, owner, ::geteuid(), kAdvice));
    return folder;
}

void set_runtime_folder(const std::string& folder) { ::setenv(TACTILED_FOLDER_VARIABLE, folder.c_str(), 1); }

std::string folder_warning(const std::string& folder, const std::string& node_name) {
    if (folder == TACTILED_SHARED_FOLDER) return fmt::format("segment in {}: {}", folder, TACTILED_SHARED_WARNING);
    struct stat other {};
    const std::string first = fmt::format("{}/tactiled.{}", TACTILED_SERVICE_FOLDER, node_name);
    if (folder != TACTILED_SERVICE_FOLDER && ::lstat(first.c_str(), &other) == 0)
        return fmt::format("{} exists: readers find it first; choose another [node] name, or give them --runtime-dir {}",
                           first, folder);
    if (struct stat own{}; ::lstat(folder.c_str(), &own) == 0 && own.st_uid != ::geteuid())
        return fmt::format("{} belongs to user {}, who can replace the segment: readers would trust that", folder,
                           own.st_uid);
    struct statfs system {};
    if (::statfs(folder.c_str(), &system) == 0 && system.f_type != TMPFS_MAGIC && system.f_type != RAMFS_MAGIC)
        return fmt::format(
            "{} is not in memory (tmpfs): the loop can be delayed while the kernel writes it to a disk; for a "
            "trial this does not matter, and --runtime-dir names another folder",
            folder);
    return "";
}

std::string control_in(const std::string& folder, const std::string& node_name, const std::string& configured) {
    const std::string fallback = fmt::format("{}/{}.sock", TACTILED_SERVICE_FOLDER, node_name);
    return configured != fallback || folder == TACTILED_SHARED_FOLDER ? configured
                                                                      : fmt::format("{}/{}.sock", folder, node_name);
}

}  // namespace tactiled
