// What the simulator promises of every effect, over random scenes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "drivers/sim/simulation.hpp"

namespace tactiled::sim {
namespace {

Scene scene_of(const std::string& text) {
    Problems problems;
    return read_scene(Options::parse_text(text, "scene.toml", problems), problems);
}

std::string random_scene(std::uint64_t seed) {
    std::mt19937_64 r(seed);
    const auto u = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(r); };
    const auto pick = [&](std::size_t n) { return std::size_t(r() % n); };
    const char* model[] = {"table", "hair", "capacitive"};
    const char* shape[] = {"flat", "sphere", "textured"};
    const std::size_t m = pick(3);
    const double full = m == 0 ? 1 : m == 1 ? 0.05 : 8;
    const double rate = std::pow(10, u(1, 3));
    std::string s = fmt::format(
        "format = 1\ntitle = \"r\"\nseed = {}\nrate_Hz = {}\n[body]\nshape = \"{}\"\nradius_m = {}\nfriction = {}\nmass_kg "
        "= {}\n"
        "temperature_C = {}\n[[sensor]]\nname = \"s\"\nmodel = \"{}\"\nturn_deg = {}\nshare = {}\n",
        seed, rate, shape[pick(3)], u(1e-4, 5e-3), u(0.2, 1.2), u(0.001, 0.05) * full, u(18, 35), model[m], u(-180, 180),
        u(0.3, 1));
    s += fmt::format("[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = {}\n", u(0, full), u(0.01, 0.5));
    for (std::size_t i = 0, n = 1 + pick(5); i < n; ++i) {
        const char* course[] = {"linear", "smooth", "at_once"};
        switch (pick(11)) {
            case 0:
                s += fmt::format("[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = {}\ncourse = \"{}\"\n", u(0, full),
                                 u(0.01, 0.5), course[pick(3)]);
                break;
            case 1:
                s += fmt::format("[[motion]]\ndo = \"shear\"\nto_N = {}\ndirection_deg = {}\nin_s = {}\n", u(0, full / 2),
                                 u(0, 360), u(0.01, 0.5));
                break;
            case 2:
                s += fmt::format("[[motion]]\ndo = \"rotate\"\nby_deg = {}\nin_s = {}\n", u(-360, 360), u(0.05, 0.5));
                break;
            case 3: s += fmt::format("[[motion]]\ndo = \"hold\"\nfor_s = {}\n", u(0.01, 0.5)); break;
            case 4:
                s += fmt::format("[[motion]]\ndo = \"move\"\nx_m = {}\ny_m = {}\nin_s = {}\n", u(-5e-4, 5e-4),
                                 u(-5e-4, 5e-4), u(0.05, 0.5));
                break;
            case 5:
                s += fmt::format("[[motion]]\ndo = \"slide\"\nspeed_m_s = {}\nin_s = {}\n", u(0, 0.1), u(0.05, 0.5));
                break;
            case 6:
                s += fmt::format("[[motion]]\ndo = \"tap\"\npeak_N = {}\nfor_s = {}\n", u(0, full / 2), u(0.01, 0.2));
                break;
            case 7:
                s += fmt::format("[[motion]]\ndo = \"shake\"\namplitude_N = {}\nfrom_Hz = {}\nfor_s = {}\n", u(0, full / 4),
                                 u(0.5, 60), u(0.1, 0.5));
                break;
            case 8:
                s += fmt::format("[[motion]]\ndo = \"square\"\namplitude_N = {}\nfrom_Hz = {}\nfor_s = {}\n", u(0, full / 4),
                                 u(0.5, 20), u(0.1, 0.5));
                break;
            case 9:
                s += fmt::format("[[motion]]\ndo = \"warm\"\nambient_by_K = {}\nbody_by_K = {}\nin_s = {}\n", u(-5, 5),
                                 u(-5, 5), u(0.05, 0.5));
                break;
            default:
                s += fmt::format("[[motion]]\ndo = \"lift\"\nacceleration_m_s2 = {}\ndirection_deg = {}\n", u(0, 3),
                                 u(0, 360));
                break;
        }
    }
    return s;
}

// The largest difference between two runs, in N of the channels; missing and dropped samples aside.
double difference_N(const Scene& scene, const std::string& a, const std::string& b) {
    Simulation one(scene, a), other(scene, b);
    const Sensor& sensor = scene.sensors[0];
    double most = 0;
    for (;;) {
        const Block& x = one.advance(0);
        const Block& y = other.advance(0);
        if (x.n == 0) return most;
        for (std::size_t n = 0; n < x.n; ++n) {
            if (x.dropped[n] || y.dropped[n]) continue;
            std::array<double, kMostChannels> change{};
            for (std::size_t k = 0; k < sensor.n(); ++k)
                if (((x.missing[n] | y.missing[n]) >> k & 1u) == 0) {
                    change[k] = x.channel[k][n] - y.channel[k][n];
                    EXPECT_TRUE(std::isfinite(x.channel[k][n]) && std::isfinite(y.channel[k][n]));
                }
            most = std::max(most, sensor.largest_N(change));
        }
    }
}

TEST(Effects, AloneNeverChangeAChannelByMoreThanTheirBound) {
    for (std::uint64_t seed = 1; seed <= 300; ++seed) {
        const std::string text = random_scene(seed);
        const Scene scene = scene_of(text);
        const auto choice = choose(scene, scene.sensors[0], scene.motion.extent(scene.sensors[0]), "all");
        for (const Decision& d : choice.decisions) {
            const double N = difference_N(scene, std::string(d.effect->name), "none");
            ASSERT_LE(N, d.bound.change_N * (1 + 1e-9) + 1e-12) << d.effect->name << " in scene " << seed << "\n" << text;
        }
    }
}

TEST(Effects, LeftOutOfAllKeepTheGuarantee) {
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
        const std::string text = random_scene(seed);
        const Scene scene = scene_of(text);
        const auto choice = choose(scene, scene.sensors[0], scene.motion.extent(scene.sensors[0]), "auto");
        ASSERT_LE(difference_N(scene, "auto", "all"), choice.guaranteed_N * (1 + 1e-9) + 1e-12) << "scene " << seed << "\n"
                                                                                                << text;
        ASSERT_LE(choice.guaranteed_N, choice.wanted_N);
    }
}

TEST(Extent, HoldsEverySample) {
    for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
        const std::string text = random_scene(seed);
        const Scene scene = scene_of(text);
        const Extent e = scene.motion.extent(scene.sensors[0]);
        Simulation simulation(scene, "none");
        std::array<double, kAxes> before{}, least{}, most{};
        const double slack = 1 + 1e-9;
        for (const Block* b = &simulation.advance(0); b->n > 0; b = &simulation.advance(0))
            for (std::size_t n = 0; n < b->n; ++n) {
                for (std::size_t axis = 0; axis < kAxes; ++axis) {
                    const double load = b->load[axis][n];
                    ASSERT_LE(std::abs(load), e.most[axis] * slack) << axis << " in scene " << seed << "\n" << text;
                    ASSERT_LE(std::abs(load - before[axis]), e.change(Axis(axis), 1 / scene.rate_Hz) * slack + 1e-15)
                        << axis << " at " << b->t_s[n] << " in scene " << seed << "\n"
                        << text;
                    before[axis] = load;
                    least[axis] = std::min(least[axis], load);
                    most[axis] = std::max(most[axis], load);
                }
                const double shear = std::hypot(b->load[kFx][n], b->load[kFy][n]);
                ASSERT_LE(shear + scene.body.friction * b->load[kFz][n], e.shear_excess_N * slack + 1e-12) << seed << "\n"
                                                                                                           << text;
                ASSERT_LE(b->speed_m_s[n], e.speed_m_s);
                ASSERT_LE(b->slide_m[n], e.slide_m * slack + 1e-15);
                ASSERT_LE(std::abs(b->ambient_K[n]), e.ambient_K * slack);
                ASSERT_LE(std::abs(b->body_K[n] - b->ambient_K[n]), e.body_K * slack + 1e-12);
            }
        for (std::size_t axis = 0; axis < kAxes; ++axis) ASSERT_LE(most[axis] - least[axis], e.span[axis] * slack);
    }
}

TEST(Simulation, GivesTheSameBitsWhateverTheBlockSize) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        const Scene scene = scene_of(random_scene(seed));
        Simulation one(scene, "all"), other(scene, "all", 7);
        const auto values = [&](Simulation& simulation) {
            std::vector<double> all;
            for (;;) {
                const Block& block = simulation.advance(0);
                if (block.n == 0) return all;
                for (std::size_t n = 0; n < block.n; ++n)
                    for (std::size_t k = 0; k < scene.sensors[0].n(); ++k) all.push_back(block.channel[k][n]);
            }
        };
        ASSERT_EQ(values(one), values(other)) << "scene " << seed;
    }
}

}  // namespace
}  // namespace tactiled::sim
