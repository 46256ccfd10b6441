// The files of the page, which the build puts into the program: embed.cmake.
#pragma once
#include <span>
#include <string_view>

namespace tactiled::web {

struct Asset {
    std::string_view path, type, content;  // path as in the URL
};
std::span<const Asset> assets();
// Another text for other files: an open page then loads itself anew.
std::string_view assets_version();

}  // namespace tactiled::web
