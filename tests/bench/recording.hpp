// The recordings of tests/data that are packed.
#pragma once
#include <fmt/format.h>

#include <cstdlib>
#include <string>

#include "config/options.hpp"

namespace tactiled {

// Unpacks tests/data/NAME.csv.xz to `path`, which is returned. setup: throws SetupError where xz fails
inline std::string unpacked(const std::string& name, const std::string& path) {
    const std::string packed = fmt::format("{}/tests/data/{}.csv.xz", TACTILED_SOURCE_DIR, name);
    if (std::system(fmt::format("xz -dc {} > {}", packed, path).c_str()) != 0) throw SetupError(packed + ": xz failed");
    return path;
}

}  // namespace tactiled
