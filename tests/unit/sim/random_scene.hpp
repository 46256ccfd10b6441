// Random scenes for property tests: any sensor, body and sequence of motions. RapidCheck shrinks a failing one to few
// motions.
#pragma once
#include <fmt/format.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {

struct RandomScene {
    std::string model, head, tail;
    std::vector<std::string> motions;

    [[nodiscard]] std::string text() const {
        std::string all = head;
        for (const auto& motion : motions) all += "[[motion]]\n" + motion;
        return all + tail;
    }
    [[nodiscard]] Scene scene() const { return scene_of(text()); }
};

// A bound holds up to the rounding of its own sum.
inline constexpr double kRounding = 1 + 1e-9, kNothing_N = 1e-12;

inline std::ostream& operator<<(std::ostream& out, const RandomScene& scene) { return out << scene.text(); }

// Returns a number between a and b, in steps of a thousandth; shrinks towards a.
inline double between(double a, double b) { return a + (b - a) * *rc::gen::inRange(0, 1001) / 1000; }

inline std::string random_motion(double full_N) {
    const auto course = [] { return *rc::gen::element<std::string>("linear", "smooth", "at_once"); };
    switch (*rc::gen::inRange(0, 16)) {
        case 0:
            return fmt::format("do = \"press\"\nto_N = {}\nin_s = {}\ncourse = \"{}\"\n", between(0, full_N),
                               between(0.01, 0.5), course());
        case 1:
            return fmt::format("do = \"shear\"\nto_N = {}\ndirection_deg = {}\nin_s = {}\ncourse = \"{}\"\n",
                               between(0, full_N / 2), between(0, 360), between(0.01, 0.5), course());
        case 14: {
            const auto on = *rc::gen::element<std::string>("press", "shear", "direction");
            return fmt::format(
                "do = \"steps\"\non = \"{}\"\n{} = {}\ncount = {}\nin_s = {}\nhold_s = 0.02\ncourse = \"{}\"\n", on,
                on == "direction" ? "by_deg" : "to_N", between(0, on == "direction" ? 720 : full_N / 2),
                *rc::gen::inRange(1, 6), between(0, 0.1), course());
        }
        case 15:
            return fmt::format(
                "do = \"wander\"\ncount = {}\nseed = {}\npress_to_N = {}\nshear_to_N = {}\nwithin_m = {}\n"
                "in_s = {}\nhold_s = 0.02\ncourse = \"{}\"\n",
                *rc::gen::inRange(1, 6), *rc::gen::inRange(0, 100), between(0, full_N), between(0, full_N / 2),
                between(0, 6e-4), between(0.01, 0.1), course());
        case 2: return fmt::format("do = \"rotate\"\nby_deg = {}\nin_s = {}\n", between(-360, 360), between(0.05, 0.5));
        case 3: return fmt::format("do = \"hold\"\nfor_s = {}\n", between(0.01, 0.5));
        case 4:
            return fmt::format("do = \"move\"\nx_m = {}\ny_m = {}\nin_s = {}\ncourse = \"{}\"\n", between(-6e-4, 6e-4),
                               between(-6e-4, 6e-4), between(0.05, 0.5), course());
        case 5: return fmt::format("do = \"slide\"\nspeed_m_s = {}\nin_s = {}\n", between(0, 0.1), between(0.05, 0.5));
        case 6: return fmt::format("do = \"slip\"\nspeed_m_s = {}\nfor_s = {}\n", between(0, 0.1), between(0.02, 0.3));
        case 7: return fmt::format("do = \"tap\"\npeak_N = {}\nfor_s = {}\n", between(0, full_N / 2), between(0.01, 0.2));
        case 8:
            return fmt::format("do = \"shake\"\non = \"{}\"\namplitude_N = {}\nfrom_Hz = {}\nto_Hz = {}\nfor_s = {}\n",
                               *rc::gen::element<std::string>("press", "shear"), between(0, full_N / 4), between(0.5, 60),
                               between(0.5, 60), between(0.1, 0.5));
        case 9:
            return fmt::format("do = \"square\"\namplitude_N = {}\nfrom_Hz = {}\nfor_s = {}\n", between(0, full_N / 4),
                               between(0.5, 20), between(0.1, 0.5));
        case 10:
            return fmt::format("do = \"warm\"\nambient_by_K = {}\nbody_by_K = {}\nin_s = {}\n", between(-5, 5),
                               between(-5, 5), between(0.05, 0.5));
        case 11:
            return fmt::format("do = \"lift\"\nacceleration_m_s2 = {}\ndirection_deg = {}\n", between(0, 3),
                               between(0, 360));
        case 12: return fmt::format("do = \"release\"\nin_s = {}\n", between(0.01, 0.3));
        default: return "do = \"drop\"\n";
    }
}

// Few scenes set parameters of effects, and only of few effects: anywhere in their ranges, by orders of magnitude.
inline std::string random_parameters() {
    if (*rc::gen::inRange(0, 3) != 0) return "";
    std::string tables;
    for (const EffectEntry* effect : chain()) {
        if (effect->parameters.empty() || *rc::gen::inRange(0, 8) != 0) continue;
        tables += fmt::format("[effects.{}]\n", effect->name);
        for (const Parameter& p : effect->parameters) {
            const double reach = between(0, 1);
            const double value = *rc::gen::inRange(0, 4) == 0 ? p.min + (p.max - p.min) * reach
                                 : p.min > 0                  ? p.min * std::pow(p.max / p.min, reach)
                                                              : p.max * std::pow(10.0, -6 * reach);
            tables += fmt::format("{} = {:e}\n", p.name, std::clamp(value, p.min, p.max));
        }
    }
    return tables;
}

inline RandomScene random_scene() {
    RandomScene s;
    s.model = *rc::gen::element<std::string>("table", "hair", "capacitive");
    const double full_N = s.model == "table" ? 1 : s.model == "hair" ? 0.05 : 8;
    const auto shape = *rc::gen::element<std::string>("flat", "sphere", "textured", "edge");
    s.head = fmt::format(
        "format = 1\ntitle = \"random\"\nseed = {}\nrate_Hz = {}\n{}[body]\nshape = \"{}\"\nradius_m = {}\nfriction = {}\n"
        "kinetic_friction = 0.2\nmass_kg = {}\nadhesion_J_m2 = {}\ntemperature_C = {}\n[[sensor]]\nname = \"s\"\nmodel = "
        "\"{}\"\n"
        "turn_deg = {}\nshare = {}\n",
        *rc::gen::inRange(0, 1'000'000), *rc::gen::element(10, 50, 100, 500, 1000),
        *rc::gen::inRange(0, 5) == 0 ? fmt::format("length_s = {}\n", between(0, 3)) : "", shape, between(1e-4, 5e-3),
        between(0.2, 1.2), between(0.001, 0.05) * full_N, between(0, 0.1), between(18, 35), s.model, between(-180, 180),
        between(0.3, 1));
    if (*rc::gen::inRange(0, 5) == 0)
        s.head += fmt::format("array = [{}, {}]\npitch_m = {}\n", *rc::gen::inRange(1, 3), *rc::gen::inRange(1, 3),
                              between(3e-4, 3e-3));
    if (s.model == "hair" && *rc::gen::inRange(0, 3) == 0) s.head += "dummy = true\n";
    if (s.model == "table" && *rc::gen::inRange(0, 50) == 0)  // reading the map takes longer than running the scene
        s.head += "influence = \"" TACTILED_SOURCE_DIR "/config/calibration/table_influence.toml\"\n";
    s.motions.push_back(fmt::format("do = \"press\"\nto_N = {}\nin_s = {}\n", between(0, full_N), between(0.01, 0.5)));
    for (int n = *rc::gen::inRange(0, 6); n > 0; --n) s.motions.push_back(random_motion(full_N));
    s.tail = random_parameters();
    return s;
}

}  // namespace tactiled::sim
