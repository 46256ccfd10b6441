// Arrays of taxels in a scene.
#include "drivers/sim/taxel_array.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>

#include "drivers/driver.hpp"
#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {
namespace {

const std::string kBall = "[body]\nshape = \"sphere\"\nradius_m = 6e-3\n";
const std::string kPress =
    "[[motion]]\ndo = \"press\"\nto_N = 3\nin_s = 0.05\n[[motion]]\ndo = \"shear\"\nto_N = 1\n"
    "direction_deg = 30\nin_s = 0.05\n[[motion]]\ndo = \"move\"\nx_m = 4e-3\ny_m = 1e-3\nin_s = 0.1\n";

std::string array_text(const std::string& rest, const std::string& keys = "values = 3\n", const std::string& head = "") {
    return "format = 1\ntitle = \"t\"\n" + head + "[[sensor]]\nname = \"s\"\nmodel = \"taxel\"\ntaxels = [8, 8]\n" + keys +
           rest;
}

std::vector<float> all_values(const Scene& scene, const std::string& effects, std::size_t block_size) {
    Simulation simulation(scene, effects, block_size);
    std::vector<float> all;
    for (const Block* block = &simulation.advance(0); block->n > 0; block = &simulation.advance(0))
        for (std::size_t n = 0; n < block->n; ++n) {
            const auto values = simulation.array(0)->values(n);
            all.insert(all.end(), values.begin(), values.end());
        }
    return all;
}

TEST(TaxelArray, ReadsTheLoadOfTheBody) {
    const Scene scene = scene_of(array_text(kBall + kPress));
    Simulation simulation(scene, "none");
    for (const Block* block = &simulation.advance(0); block->n > 0; block = &simulation.advance(0))
        for (std::size_t n = 0; n < block->n; ++n) {
            const auto values = simulation.array(0)->values(n);
            double sum[3]{}, x = 0, y = 0;
            for (std::size_t i = 0; i < 64; ++i) {
                for (std::size_t v = 0; v < 3; ++v) sum[v] += double(values[v * 64 + i]);
                x += double(values[128 + i]) * (double(i % 8) - 3.5) * 2e-3;
                y += double(values[128 + i]) * (3.5 - double(i / 8)) * 2e-3;
            }
            EXPECT_NEAR(sum[0] / 1000, block->load[kFx][n], 1e-5);
            EXPECT_NEAR(sum[1] / 1000, block->load[kFy][n], 1e-5);
            EXPECT_NEAR(sum[2] / 1000, -block->load[kFz][n], 1e-5);
            if (block->load[kFz][n] > -0.5) continue;
            EXPECT_NEAR(x / sum[2], block->x_m[n],
                        5e-4);  // a quarter of the pitch: the taxels do not tell where in them it is
            EXPECT_NEAR(y / sum[2], block->y_m[n], 5e-4);
        }
}

TEST(TaxelArray, GivesTheSameBitsForAnyBlockSize) {
    const Scene scene = scene_of(array_text(kBall + kPress));
    const auto one = all_values(scene, "all", 1);
    ASSERT_EQ(one.size(), 200u * 192);
    EXPECT_EQ(one, all_values(scene, "all", 64));
    EXPECT_EQ(one, all_values(scene, "all", 7));
    EXPECT_NE(one, all_values(scene_of(array_text(kBall + kPress, "values = 3\n", "seed = 2\n")), "all", 1));
}

TEST(TaxelArray, HasTheTruthOfWhatIsOnIt) {
    const Scene scene = scene_of(array_text(kBall + "[[motion]]\ndo = \"move\"\nx_m = 8e-3\n[[motion]]\ndo = \"press\"\n"
                                                    "to_N = 2\n[[motion]]\ndo = \"hold\"\nfor_s = 0.1\n"));
    Simulation simulation(scene, "none", 1);
    const Block* block = nullptr;
    for (std::uint64_t n = 0; n < scene.samples; ++n) block = &simulation.advance(0);
    EXPECT_NEAR(block->load[kFz][0], -1, 2e-3);  // one half is beside it
    EXPECT_TRUE(std::isnan(block->x_m[0]) && std::isnan(block->load[kMx][0]));
}

// Auto is within its guarantee of all effects, for any body, and no taxel is beyond the bound of an effect.
TEST(TaxelArray, KeepsTheGuarantee) {
    const std::string bodies[] = {kBall, "[body]\nshape = \"fingers\"\nradius_m = 3e-3\napart_m = 6e-3\n",
                                  "[body]\nshape = \"cylinder\"\nlength_m = 8e-3\nturn_deg = 30\n",
                                  "[body]\nshape = \"edge\"\nradius_m = 1e-3\nturn_deg = 60\n", ""};
    const std::string sensors[] = {"model = \"taxel\"\nvalues = 3\n", "model = \"taxel\"\n",
                                   "model = \"capacitive\"\npiezo_V_per_N = 0\n"};
    std::mt19937 random(5);
    std::uniform_real_distribution<double> u(0, 1);
    for (const auto& body : bodies)
        for (const auto& sensor : sensors) {
            std::string text = "format = 1\ntitle = \"t\"\n" + body + "[effects.dead_channel]\nrate_1_h = 500\nway = 1\n" +
                               "[[sensor]]\nname = \"s\"\ntaxels = [4, 5]\npitch_m = 3e-3\n" + sensor;
            for (int k = 0; k < 4; ++k)
                text += fmt::format(
                    "[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = 0.05\n[[motion]]\ndo = \"shear\"\nto_N = {}\n"
                    "direction_deg = {}\n[[motion]]\ndo = \"move\"\nx_m = {}\ny_m = {}\nin_s = {}\n"
                    "[[motion]]\ndo = \"warm\"\nambient_by_K = {}\nin_s = 0.1\n",
                    6 * u(random), 2 * u(random), 360 * u(random), 0.01 * u(random) - 0.005, 0.01 * u(random) - 0.005,
                    0.02 + 0.2 * u(random), 4 * u(random) - 2);
            Scene scene = scene_of(text);
            for (const double wanted_N : {1e-3, 1e-2, 0.1, 1.0, 10.0}) {
                scene.wanted_accuracy_N = wanted_N;
                Simulation all(scene, "all"), chosen(scene, "auto");
                const Sensor& s = scene.sensors[0];
                double max_N = 0;
                for (const Block* a = &all.advance(0); a->n > 0; a = &all.advance(0)) {
                    const Block& b = chosen.advance(0);
                    for (std::size_t n = 0; n < a->n; ++n) {
                        if (a->dropped[n] || b.dropped[n]) continue;
                        const auto x = all.array(0)->values(n), y = chosen.array(0)->values(n);
                        for (std::size_t k = 0; k < s.n(); ++k)
                            for (std::size_t i = 0; i < 20; ++i)
                                max_N =
                                    std::max(max_N, std::abs(double(x[k * 20 + i]) - double(y[k * 20 + i])) / s.per_N[k]);
                    }
                }
                EXPECT_LE(max_N, chosen.choice(0).guaranteed_N + 1e-6) << text << wanted_N;  // 1e-6: the values are float
                EXPECT_LE(chosen.choice(0).guaranteed_N, wanted_N);
            }
        }
}

TEST(TaxelArray, LeavesOutWhatTheSceneDoesNotCallFor) {
    const auto names = [](const Scene& scene) {
        std::string on;
        const Simulation simulation(scene, "auto");
        for (const Decision& d : simulation.choice(0).decisions)
            if (d.on) on += std::string(d.effect->name) + " ";
        return on;
    };
    EXPECT_EQ(names(scene_of(array_text(kBall + kPress, "", "wanted_accuracy_N = 1\n"))), "");
    EXPECT_EQ(names(scene_of(array_text(kBall + kPress, "", "wanted_accuracy_N = 0.03\n"))), "gain_spread ");
}

TEST(TaxelArray, HasDeadTaxels) {
    const Scene scene = scene_of(array_text(kBall + kPress + "[effects.dead_channel]\nrate_1_h = 5000\nway = 2\n", ""));
    std::size_t missing = 0;
    for (const float value : all_values(scene, "dead_channel", 64)) missing += std::size_t(std::isnan(value));
    EXPECT_GT(missing, 64u);
    EXPECT_LT(missing, 64u * 100);
}

std::string problem_of(const std::string& text, const std::string& effects = "auto") {
    try {
        const Scene scene = scene_of(text);
        Simulation{scene, effects};
    } catch (const SetupError& e) { return e.what(); }
    return "";
}

TEST(TaxelArray, RefusesWhatHasNoLaw) {
    const auto has = [](const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; };
    EXPECT_PRED2(has, problem_of(array_text(kBall + kPress), "noise,texture"),
                 "effect \"texture\" works on single sensors; \"s\" is an array of taxels");
    EXPECT_PRED2(has, problem_of(array_text("[body]\nshape = \"textured\"\n" + kPress)),
                 "texture and adhesion do not occur");
    const std::string single = "[[sensor]]\nname = \"h\"\nmodel = \"hair\"\n";
    EXPECT_PRED2(has, problem_of("format = 1\ntitle = \"t\"\n" + single + "[body]\nshape = \"cylinder\"\n" + kPress),
                 "a cylinder or fingers need sensors with taxels");
    EXPECT_PRED2(has, problem_of("format = 1\ntitle = \"t\"\n[[sensor]]\nname = \"s\"\nmodel = \"taxel\"\n" + kPress),
                 "model \"taxel\" needs taxels = [rows, columns]");
    EXPECT_PRED2(has,
                 problem_of(array_text(kBall + kPress + "[[sensor]]\nname = \"o\"\nmodel = \"taxel\"\ntaxels = [3, 3]\n")),
                 "\"o\" has another number of taxels or values than \"s\"");
    EXPECT_PRED2(has, problem_of(array_text(kBall + kPress, "array = [2, 2]\n")), "taxels = [rows, columns] one of all");
    EXPECT_EQ(problem_of(array_text(kBall + kPress + single)), "");
}

TEST(TaxelArray, IsDeliveredByTheDriverBesideASensorWithChannels) {
    const std::string file = ::testing::TempDir() + "array." + std::to_string(::getpid()) + ".toml";
    std::ofstream(file) << array_text(kBall + kPress + "[[sensor]]\nname = \"h\"\nmodel = \"hair\"\n");
    Problems problems;
    Options options =
        Options::parse_text("scene = \"" + file + "\"\neffects = \"none\"\nspeed = 1000\n", "test.toml", problems);
    const auto driver = Drivers::find("sim")->make(options);
    problems.throw_if_any();
    EXPECT_EQ(driver->taxel_shape(), (TaxelShape{64, 3}));
    ASSERT_EQ(driver->open(), "");
    Frame frame{};
    std::size_t arrays = 0, others = 0;
    float sum = 0;
    for (Status status = Status::timeout; status != Status::disconnected;) {
        status = driver->read(frame, 10);
        if (status != Status::frame) continue;
        const Taxels taxels = driver->taxels();
        if (frame.device == 0) {
            ++arrays;
            ASSERT_EQ(frame.n_channels, 0u);
            ASSERT_EQ(taxels.shape, (TaxelShape{64, 3}));
            ASSERT_EQ(taxels.value.size(), 192u);
            sum = 0;
            for (std::size_t i = 128; i < 192; ++i) sum += taxels.value[i];
        } else {
            ++others;
            ASSERT_EQ(frame.n_channels, 4u);
            ASSERT_EQ(taxels.value.size(), 0u);
        }
    }
    EXPECT_EQ(arrays, 200u);
    EXPECT_EQ(others, 200u);
    EXPECT_NEAR(sum, 3000, 1);
    std::remove(file.c_str());
}

}  // namespace
}  // namespace tactiled::sim
