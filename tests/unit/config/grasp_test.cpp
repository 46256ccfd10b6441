// [grasp]: valid and invalid tables about jaws, and the messages for invalid ones.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "loaded.hpp"

namespace tactiled {
namespace {

using test::Lines;

constexpr const char* kSensors =
    "[[link]]\nname = 'usb0'\ndriver = 'uart'\n"
    "[[sensor]]\nname = 'left'\nlink = 'usb0'\nmodel = 'generic'\ncalibration = 'l.toml'\n"
    "[[sensor]]\nname = 'right'\nlink = 'usb0'\ndevice = 1\nmodel = 'generic'\ncalibration = 'r.toml'\n";

// With two sensors, and without errors about drivers' keys.
struct LoadedGrasp : test::Loaded {
    explicit LoadedGrasp(const std::string& grasp) : Loaded(grasp + kSensors) { config.root.finish(); }
};

std::string jaw(const std::string& sensor, const std::string& more = "x_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n") {
    return "[[grasp.jaw]]\nsensor = '" + sensor + "'\n" + more;
}

bool has(const Lines& lines, const std::string& start, const std::string& part) {
    for (const auto& line : lines)
        if (line.rfind(start, 0) == 0 && line.find(part) != line.npos) return true;
    return false;
}
#define EXPECT_SAYS(lines, start, part) EXPECT_TRUE(has(lines, start, part)) << testing::PrintToString(lines)

TEST(GraspConfig, IsNotThereUnlessItIsWritten) {
    const LoadedGrasp loaded("");
    EXPECT_FALSE(loaded.config.grasp.has_value());
    EXPECT_EQ(loaded.config.modbus.objects, "");
}

TEST(GraspConfig, HasDefaults) {
    const LoadedGrasp loaded("[grasp]\n" + jaw("left") + jaw("right"));
    EXPECT_EQ(loaded.lines(), Lines{});
    const GraspSettings& g = loaded.config.grasp.value();
    EXPECT_EQ(g.jaws_of_gripper, 2);
    EXPECT_EQ(g.gravity_G_m_s2, (std::array<double, 3>{0, 0, 0}));
    EXPECT_EQ(g.friction, 0);
    EXPECT_EQ(g.margin, 1.5);
    EXPECT_EQ(g.weigh_window_ms, 100);
    EXPECT_EQ(g.slip_sensitivity, 0.5);
    EXPECT_EQ(g.share_sd, 0.01);
    EXPECT_EQ(g.lift_acceleration_m_s2, 2);
    EXPECT_EQ(g.lift_accelerates_ms, 1000);
    EXPECT_EQ(g.objects, "/var/lib/tactiled/gripper.objects.toml");
    EXPECT_EQ(loaded.config.modbus.objects, g.objects);
}

TEST(GraspConfig, AFileNamedWithoutAFolderIsInTheCurrentOne) {
    const test::Folder folder;
    (void)folder.write("t.toml", "[grasp]\nobjects = 'o.toml'\n" + jaw("left") + kSensors);
    std::filesystem::current_path(folder.path());
    Problems problems;
    const Config config = load_config("t.toml", problems);
    std::filesystem::current_path("/");
    EXPECT_EQ(problems.lines(), Lines{});
    EXPECT_EQ(config.grasp->objects, folder / "o.toml");
}

TEST(GraspConfig, AJawIsTurnedAsItsAxesSay) {
    // The right finger of a parallel gripper: its skin faces -x of G, its connector z, out of the palm.
    const LoadedGrasp loaded("[grasp]\nobjects = 'o.toml'\n" + jaw("left", "x_S_in_G = [0, 0, 2]\nz_S_in_G = [-1, 0, 0]\n"));
    ASSERT_EQ(loaded.lines(), Lines{});
    const auto& R = loaded.config.grasp->jaws[0].S_from_G;
    const auto in_S = [&](double x, double y, double z) {
        std::array<double, 3> v{};
        for (std::size_t i = 0; i < 3; ++i) v[i] = R[i][0] * x + R[i][1] * y + R[i][2] * z;
        return v;
    };
    EXPECT_EQ(in_S(0, 0, -9.81), (std::array<double, 3>{-9.81, 0, 0}));  // gravity, while the palm looks up
    EXPECT_EQ(in_S(1, 0, 0), (std::array<double, 3>{0, 0, -1}));         // out of the palm's x is into the skin
    EXPECT_EQ(in_S(0, 1, 0), (std::array<double, 3>{0, 1, 0}));          // right-handed: y is z x x
    EXPECT_EQ(loaded.config.grasp->objects, loaded.folder / "o.toml");
}

TEST(GraspConfig, SaysWhereItIsWrongAndWhatIsRight) {
    EXPECT_SAYS(LoadedGrasp("[grasp]\n").lines(), "t.toml:1: [grasp]", "no [[grasp.jaw]]");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaw("lef")).lines(), "t.toml:3:", "did you mean \"left\"?");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaw("left") + jaw("left")).lines(), "t.toml:7:", "has a [[grasp.jaw]] already");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaw("left", "")).lines(), "t.toml:2:", "x_S_in_G is missing");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaw("left", "x_S_in_G = [0, 0, 0]\nz_S_in_G = [0, 1, 0]\n")).lines(),
                "t.toml:4:", "no direction");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaw("left", "x_S_in_G = [0, 1, 0]\nz_S_in_G = [0, 1, 1]\n")).lines(),
                "t.toml:5:", "45.0 degrees");
    EXPECT_SAYS(LoadedGrasp("[grasp]\ngravity_G_m_s2 = [0, 0, -1]\n" + jaw("left")).lines(), "t.toml:2:", "9.81 m/s^2");
    EXPECT_SAYS(LoadedGrasp("[grasp]\ngravity_G_m_s2 = [1e-300, 0, 0]\n" + jaw("left")).lines(), "t.toml:2:", "9.81 m/s^2");
    EXPECT_SAYS(LoadedGrasp("[grasp]\njaws_of_gripper = 1\n" + jaw("left") + jaw("right")).lines(),
                "t.toml:2:", "2 have a sensor");
    EXPECT_SAYS(LoadedGrasp("[grasp]\nmargin = 0.5\n" + jaw("left")).lines(), "t.toml:2:", "1 .. 10");
    EXPECT_SAYS(LoadedGrasp("[grasp]\nfricton = 0.5\n" + jaw("left")).lines(), "t.toml:2:", "friction");
    const std::string axes = "x_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n";
    EXPECT_SAYS(
        LoadedGrasp("[grasp]\n" + jaw("left", axes + "share = 0.6\n") + jaw("right", axes + "share = 0.6\n")).lines(),
        "t.toml:2:", "1 at most");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaw("left", axes + "share = 0.6\n") + jaw("right")).lines(),
                "t.toml:2:", "its share, or none");
}

TEST(GraspConfig, SharesOfAllJawsAddUpToOne) {
    const std::string axes = "x_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n";
    const std::string jaws = jaw("left", axes + "share = 0.4\n") + jaw("right", axes + "share = 0.4\n");
    EXPECT_SAYS(LoadedGrasp("[grasp]\n" + jaws).lines(), "t.toml:2:", "0.8 of the weight together, not 1");
    EXPECT_EQ(LoadedGrasp("[grasp]\njaws_of_gripper = 3\n" + jaws).lines(), Lines{});  // the third one carries the rest
}

TEST(GraspConfig, AdvisesOnJawsThatCannotHoldOrWeigh) {
    const auto advice = [](const std::string& left_z, const std::string& right_z, const std::string& gravity) {
        const auto at = [](const std::string& z) { return "x_S_in_G = [0, 0, -1]\nz_S_in_G = " + z + "\n"; };
        const LoadedGrasp loaded("[grasp]\ngravity_G_m_s2 = " + gravity + "\n" + jaw("left", at(left_z)) +
                                 jaw("right", at(right_z)));
        return grasp_advice(loaded.config.grasp.value());
    };
    EXPECT_EQ(advice("[1, 0, 0]", "[-1, 0, 0]", "[0, 0, 9.81]"), Lines{});
    EXPECT_SAYS(advice("[1, 0, 0]", "[1, 0, 0]", "[0, 0, 9.81]"), "[[grasp.jaw]] \"left\"", "faces no other jaw");
    EXPECT_SAYS(advice("[1, 0, 0]", "[-1, 0, 0]", "[9.81, 0, 0]"), "[[grasp.jaw]] \"right\"",
                "gravity points into its skin");
}

TEST(GraspConfig, AxesThatAreNotQuitePerpendicularBecomeAFrame) {
    const LoadedGrasp loaded("[grasp]\n" + jaw("left", "x_S_in_G = [1, 0.01, 0]\nz_S_in_G = [0, 1, 0]\n"));
    EXPECT_EQ(loaded.lines(), Lines{});
    const auto& R = loaded.config.grasp->jaws[0].S_from_G;
    EXPECT_NEAR(R[0][0] * R[2][0] + R[0][1] * R[2][1] + R[0][2] * R[2][2], 0, 1e-12);
    EXPECT_EQ(R[2][1], 1);  // out of the skin stays as written
}

}  // namespace
}  // namespace tactiled
