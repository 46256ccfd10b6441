// A scene from its text.
#pragma once
#include <string>

#include "drivers/sim/simulation.hpp"

namespace tactiled::sim {

inline Scene scene_of(const std::string& text) {
    Problems problems;
    return read_scene(Options::parse_text(text, "scene.toml", problems), problems);
}

}  // namespace tactiled::sim
