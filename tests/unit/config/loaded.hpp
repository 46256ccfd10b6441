// A configuration's text, loaded, with its errors.
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

inline Lines errors(const std::string& text) { return Loaded(text).lines(); }

// Errors of a table's lines beside a good link and a good sensor; the text's first line is line 1.
inline Lines errors_of(const std::string& table) { return errors(table + "\n" + kLink + kSensor); }

inline std::string sensor(const std::string& name, const std::string& keys) {
    return "[[sensor]]\nname = '" + name + "'\nmodel = 'generic'\ncalibration = 'c.toml'\n" + keys;
}

}  // namespace tactiled::test
