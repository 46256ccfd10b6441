#include "node/version.hpp"

#include <fmt/format.h>
#include <gnu/libc-version.h>

namespace tactiled {

std::string version_text() {
    return fmt::format("{}\ncommit {}\nbuilt with {}\nruns with glibc {}", TACTILED_VERSION, kCommit, TACTILED_BUILT_WITH,
                       ::gnu_get_libc_version());
}

}  // namespace tactiled
