// Model "patch" on the simulated arrays of config/scenes, against the truth of the scenes. The simulator shares no code with
// the model.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "decoupling/patch/patch.hpp"
#include "drivers/sim/simulation.hpp"

namespace tactiled {
namespace {

const std::string kScenes = TACTILED_SOURCE_DIR "/config/scenes/";
constexpr std::array<sim::Axis, 3> kForces{sim::kFx, sim::kFy, sim::kFz};

sim::Scene scene_at(const std::string& name, std::uint64_t seed) {
    std::ifstream file(kScenes + name);
    std::stringstream text;
    text << file.rdbuf();
    Problems problems;
    sim::Scene scene = sim::read_scene(Options::parse_text(text.str(), name, problems), problems);
    scene.seed = seed;
    scene.sensors[0].serial = 1000 * seed;  // other taxels
    return scene;
}

// The calibration file of the scenes with 16 x 16 taxels; for another scene its numbers with those of that scene.
Calibration calibration_of(const sim::Scene& scene, double noise_N) {
    const sim::Sensor& sensor = scene.sensors[0];
    Problems problems;
    Calibration c = load_calibration(TACTILED_SOURCE_DIR "/config/calibration/array_grid.toml", problems);
    problems.throw_if_any();
    c.parameters["rows"] = double(sensor.rows);
    c.parameters["columns"] = double(sensor.columns);
    c.parameters["pitch_mm"] = sensor.pitch_m * 1e3;
    c.tables["taxel_sd"] = {std::vector<double>(sensor.n(), noise_N)};
    if (sensor.n() == 1) {
        c.channels = {"Z"};
        c.zero = {0};
        c.components = {"fz", "mx", "my"};
        c.tables["taxel"] = {{-0.001}};
    }
    return c;
}

struct Judged {
    std::size_t n = 0, within = 0, beyond = 0;  // forces of the sum; within one sd; beyond five
    void take(const Estimate& estimate, const sim::Block& block, std::size_t at) {
        for (std::size_t k = 0; k < 3; ++k) {
            if (std::isnan(estimate.wrench_S[k])) continue;
            const double error = std::abs(estimate.wrench_S[k] - block.load[kForces[k]][at]) / estimate.sd[k];
            within += std::size_t(error < 1);
            beyond += std::size_t(error > 5);
            ++n;
        }
    }
};

// Loads of a scene that are held, each judged once, with arrays of `seeds` serial numbers.
Judged judge(const std::string& name, std::uint64_t seeds, double noise_N, const std::string& effects) {
    Judged judged;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        const sim::Scene scene = scene_at(name, seed);
        const auto patch = make_decoupler(calibration_of(scene, noise_N));
        sim::Simulation simulation(scene, effects);
        const sim::Sensor& sensor = scene.sensors[0];
        const auto every = std::uint64_t(0.25 * scene.rate_Hz);  // a load of `wander` lasts 0.25 s
        for (const sim::Block* block = &simulation.advance(0); block->n > 0; block = &simulation.advance(0))
            for (std::size_t n = 0; n < block->n; ++n) {
                if ((block->first + n) % every != every - 1 || block->dropped[n]) continue;
                if (std::isnan(block->x_m[n])) continue;  // a part of the contact is beside the array
                Reading reading;
                reading.taxels = {{std::uint16_t(sensor.taxels()), std::uint16_t(sensor.n())},
                                  simulation.array(0)->values(n)};
                judged.take(patch->decouple(reading), *block, n);
            }
    }
    return judged;
}

void expect_honest(const std::string& name, std::uint64_t seeds, double noise_N = 0.005) {
    for (const std::string effects : {"auto", "all"}) {
        const Judged judged = judge(name, seeds, noise_N, effects);
        const double within = 100.0 * double(judged.within) / double(judged.n);
        EXPECT_GT(judged.n, 500u) << name;
        EXPECT_GT(within, 60) << name << " " << effects;
        EXPECT_LT(within, 76) << name << " " << effects;
        EXPECT_LE(double(judged.beyond), 0.005 * double(judged.n)) << name << " " << effects;
        fmt::print("{} {}: {} forces, {:.1f} % within one sd, {} beyond five\n", name, effects, judged.n, within,
                   judged.beyond);
    }
}

TEST(PatchOnScenes, Ball) { expect_honest("array_grid_ball.toml", 40); }
TEST(PatchOnScenes, Edge) { expect_honest("array_grid_edge.toml", 12); }
TEST(PatchOnScenes, Cylinder) { expect_honest("array_grid_cylinder.toml", 26, 0.002); }
TEST(PatchOnScenes, Fingers) { expect_honest("array_grid_fingers.toml", 12); }

// A skin that creeps and has hysteresis reads a few per cent off, which no calibration of noise and gains contains.
TEST(PatchOnScenes, SlidingBall) {
    const Judged judged = judge("array_grid_slide.toml", 10, 0.005, "auto");
    EXPECT_GT(judged.n, 500u);
    EXPECT_EQ(judged.beyond, 0u);
    fmt::print("slide: {} forces, {} within one sd\n", judged.n, judged.within);
}

}  // namespace
}  // namespace tactiled
