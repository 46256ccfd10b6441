#include "drivers/sim/pressure.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "tests/unit/sim/scene_of.hpp"

namespace tactiled::sim {
namespace {

Scene scene_with_body(const std::string& body, double turn_deg = 0) {
    return scene_of(
        fmt::format("format = 1\ntitle = \"t\"\n[body]\n{}\n[[sensor]]\nname = \"s\"\nmodel = \"taxel\"\n"
                    "taxels = [12, 10]\npitch_m = 2e-3\nturn_deg = {}\n[[motion]]\ndo = \"hold\"\nfor_s = 1\n",
                    body, turn_deg));
}

const std::vector<std::string> kBodies{
    "shape = \"sphere\"\nradius_m = 8e-3",
    "shape = \"sphere\"\nradius_m = 5e-4\nstiffness_Pa = 1e9",
    "shape = \"fingers\"\nradius_m = 4e-3\napart_m = 7e-3\nturn_deg = 20",
    "shape = \"cylinder\"\nradius_m = 6e-3\nlength_m = 9e-3\nturn_deg = 35",
    "shape = \"edge\"\nradius_m = 1.3e-3\nlength_m = 8e-3\nturn_deg = -70",
    "shape = \"edge\"\nradius_m = 2e-3\nlength_m = 8e-3\nturn_deg = 90",
    "shape = \"flat\"",
};

// The centre of a body is the centre of its pressure: the first moments of the parts, which a sum over squares has to within
// a part of the pitch, are compared with a sum over small squares of one taxel each.
TEST(Pressure, IsTheIntegralOverEachTaxel) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> place(-5e-3, 5e-3), press(0.05, 8);
    for (const std::string& text : kBodies)
        for (int trial = 0; trial < 20; ++trial) {
            const Scene coarse = scene_with_body(text, 15 * trial), fine = [&] {
                Scene scene = scene_with_body(text, 15 * trial);
                scene.sensors[0].rows *= 16, scene.sensors[0].columns *= 16, scene.sensors[0].pitch_m /= 16;
                return scene;
            }();
            const double N = press(random), x = place(random), y = place(random);
            std::vector<double> part(coarse.sensors[0].taxels()), small(fine.sensors[0].taxels());
            const Pressure pressure(coarse.body, coarse.sensors[0]);
            const auto contact = pressure.spread(N, x, y, part);
            Pressure(fine.body, fine.sensors[0]).spread(N, x, y, small);
            double mx = 0, my = 0;
            std::vector<double> sum(part.size());
            for (std::size_t i = 0; i < small.size(); ++i) {
                const std::size_t row = i / 160, column = i % 160;
                sum[row / 16 * 10 + column / 16] += small[i];
                mx += small[i] * (double(column) - 79.5) * 2e-3 / 16;
                my += small[i] * (95.5 - double(row)) * 2e-3 / 16;
            }
            for (std::size_t i = 0; i < part.size(); ++i) {
                EXPECT_NEAR(part[i], sum[i], 1e-5) << text << " taxel " << i;
                EXPECT_LE(part[i], pressure.max_part(N)) << text;
            }
            if (!contact.is_whole || coarse.body.shape == Body::Shape::flat) continue;
            EXPECT_NEAR(std::accumulate(part.begin(), part.end(), 0.0), 1, 1e-12) << text;
            EXPECT_NEAR(mx, x, 3e-5) << text;
            EXPECT_NEAR(my, y, 3e-5) << text;
        }
}

// The second moments of a contact are those of its law: a^2 / 5 of a ball, b^2 / 4 across a cylinder, and (length / 2)^2 / 3
// along it.
TEST(Pressure, HasTheWidthOfHertz) {
    const double modulus_Pa = 1 / ((1 - 0.49 * 0.49) / 1e6 + (1 - 0.3 * 0.3) / 3e9);
    const auto second = [](const std::string& text) {
        Scene scene = scene_with_body(text);
        scene.sensors[0].rows = scene.sensors[0].columns = 200;
        scene.sensors[0].pitch_m = 1e-4;
        std::vector<double> part(40'000);
        Pressure(scene.body, scene.sensors[0]).spread(3, 0, 0, part);
        std::pair<double, double> sum;
        for (std::size_t i = 0; i < part.size(); ++i) {
            sum.first += part[i] * std::pow((double(i % 200) - 99.5) * 1e-4, 2);
            sum.second += part[i] * std::pow((99.5 - double(i / 200)) * 1e-4, 2);
        }
        return sum;
    };
    const double a = std::cbrt(0.75 * 3 * 8e-3 / modulus_Pa);
    EXPECT_NEAR(second("shape = \"sphere\"\nradius_m = 8e-3").first / (a * a / 5), 1, 0.01);
    EXPECT_NEAR(second("shape = \"sphere\"\nradius_m = 8e-3").second / (a * a / 5), 1, 0.01);
    const auto line = second("shape = \"cylinder\"\nradius_m = 6e-3\nlength_m = 12e-3");
    const double b2 = 4 * 3 * 6e-3 / (3.14159265 * 12e-3 * modulus_Pa);
    EXPECT_NEAR(line.first / (6e-3 * 6e-3 / 3), 1, 0.01);
    EXPECT_NEAR(line.second / (b2 / 4), 1, 0.01);
}

TEST(Pressure, KnowsHowFastAPartChanges) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> place(-4e-3, 4e-3), press(0.05, 8), angle(0, 6.3);
    for (const std::string& text : kBodies)
        for (int trial = 0; trial < 50; ++trial) {
            const Scene scene = scene_with_body(text);
            const Pressure pressure(scene.body, scene.sensors[0]);
            const double N = press(random), x = place(random), y = place(random), turn = angle(random), step_m = 1e-4;
            std::vector<double> here(120), there(120), more(120);
            pressure.spread(N, x, y, here);
            pressure.spread(N, x + step_m * std::cos(turn), y + step_m * std::sin(turn), there);
            pressure.spread(N * 1.02, x, y, more);
            for (std::size_t i = 0; i < 120; ++i) {
                EXPECT_LE(std::abs(there[i] - here[i]), pressure.max_slope_1_m(N) * step_m + 1e-5) << text;
                EXPECT_GE(more[i] * 1.02 - here[i], -1e-5) << text;
                EXPECT_LE(more[i] * 1.02 - here[i], 0.02 + 1e-5) << text;
            }
        }
}

TEST(Pressure, LosesWhatIsBesideTheArray) {
    const Scene scene = scene_with_body("shape = \"edge\"\nradius_m = 1e-3\nlength_m = 8e-3");
    std::vector<double> part(120);
    const auto contact = Pressure(scene.body, scene.sensors[0]).spread(1, 10e-3, 0, part);  // half of it is beyond x = 10 mm
    EXPECT_FALSE(contact.is_whole);
    EXPECT_NEAR(std::accumulate(part.begin(), part.end(), 0.0), 0.5, 1e-12);
    EXPECT_NEAR(contact.area_m2, 16e-6, 1e-12);
}

}  // namespace
}  // namespace tactiled::sim
