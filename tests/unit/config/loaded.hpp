// A configuration's text, loaded, with what was said about it.
#pragma once
#include <string>
#include <vector>

#include "config/config.hpp"
#include "folder.hpp"

namespace tactiled::test {

using Lines = std::vector<std::string>;

inline constexpr const char* kLink = "[[link]]\nname = 'usb0'\ndriver = 'uart'\n";
inline constexpr const char* kSensor =
    "[[sensor]]\nname = 'left'\nlink = 'usb0'\nmodel = 'generic'\ncalibration = 'left.toml'\n";

struct Loaded {
    Folder folder;
    Problems problems;
    Config config;
    explicit Loaded(const std::string& text) : config(load_config(folder.write("t.toml", text), problems)) {}

    // Errors without the folder.
    [[nodiscard]] Lines lines() const {
        Lines lines;
        for (auto line : problems.lines()) {
            for (auto at = line.find(folder.path() + "/"); at != line.npos; at = line.find(folder.path() + "/"))
                line.erase(at, folder.path().size() + 1);
            lines.push_back(line);
        }
        return lines;
    }
};

}  // namespace tactiled::test
