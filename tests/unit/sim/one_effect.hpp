// Runs a scene with the named effects only.
#pragma once
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <vector>

#include "drivers/sim/simulation.hpp"
#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {

// Returns a scene of one sensor "s"; `head` = keys of the scene, `rest` = its other tables.
inline Scene scene_with(const std::string& model, const std::string& rest, const std::string& head = "") {
    return scene_of("format = 1\ntitle = \"t\"\n" + head + "\n[[sensor]]\nname = \"s\"\nmodel = \"" + model + "\"\n" + rest);
}

inline std::string press(double N, double in_s, const std::string& course = "linear") {
    return fmt::format("[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = {}\ncourse = \"{}\"\n", N, in_s, course);
}
inline std::string shear(double N, double degrees, double in_s) {
    return fmt::format("[[motion]]\ndo = \"shear\"\nto_N = {}\ndirection_deg = {}\nin_s = {}\n", N, degrees, in_s);
}
inline std::string hold(double for_s) { return fmt::format("[[motion]]\ndo = \"hold\"\nfor_s = {}\n", for_s); }

// All samples of a sensor, one row per quantity.
struct Recording {
    std::vector<double> t_s, radius_m;
    std::array<std::vector<double>, kAxes> load;
    std::array<std::vector<double>, kMaxSensorChannels> channel;
    std::vector<std::uint32_t> lost, missing;
    std::vector<bool> dropped;
};

inline Recording run(const Scene& scene, const std::string& effects, std::size_t sensor = 0) {
    Recording all;
    Simulation simulation(scene, effects);
    for (const Block* b = &simulation.advance(sensor); b->n > 0; b = &simulation.advance(sensor))
        for (std::size_t n = 0; n < b->n; ++n) {
            all.t_s.push_back(b->t_s[n]);
            all.radius_m.push_back(b->radius_m[n]);
            for (std::size_t axis = 0; axis < kAxes; ++axis) all.load[axis].push_back(b->load[axis][n]);
            for (std::size_t k = 0; k < scene.sensors[sensor].n(); ++k) all.channel[k].push_back(b->channel[k][n]);
            all.lost.push_back(b->lost[n]);
            all.missing.push_back(b->missing[n]);
            all.dropped.push_back(b->dropped[n]);
        }
    return all;
}

}  // namespace tactiled::sim
