// A file that the daemon writes must not be another file of its configuration.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "loaded.hpp"

namespace tactiled {
namespace {

using test::Lines;
using test::Loaded;

const std::string kRest = std::string(test::kLink) + test::kSensor;

TEST(WrittenFiles, SettingsControlAndConfigurationAreThree) {
    EXPECT_EQ(
        test::errors("[node]\ncontrol = '/tmp/a'\n[modbus]\nsettings = '/tmp/x/../a'\n" + kRest),
        Lines{"t.toml:4: [modbus]: settings = \"/tmp/x/../a\" is the file of [node] control, too; the daemon writes it: "
              "give each its own"});
    EXPECT_EQ(test::errors("[node]\ncontrol = '/tmp/a'\n[modbus]\nsettings = '/tmp/b'\n" + kRest), Lines{});
    EXPECT_EQ(test::errors("[node]\ncontrol = '/tmp/a'\nzeros = '/tmp/a'\n" + kRest).size(), 1u);
}

TEST(WrittenFiles, NoneIsTheConfigurationOrACalibrationUnderAnyName) {
    test::Folder folder;
    const std::string path = folder.write("t.toml", "");
    const std::string link = folder.path() + "/link.toml", twin = folder.path() + "/twin.toml";
    std::filesystem::create_symlink(path, link);
    std::filesystem::create_hard_link(path, twin);
    (void)folder.write("left.toml", "");
    for (const auto& [name, role] : {std::pair{path, "this configuration"},
                                     {link, "this configuration"},
                                     {twin, "this configuration"},
                                     {folder.path() + "/left.toml", "the calibration of sensor \"left\""}}) {
        // The file is written in place: a new one would have no second name.
        std::ofstream(path) << "[modbus]\nsettings = '" << name << "'\n" << kRest;
        Problems problems;
        load_config(path, problems);
        ASSERT_EQ(problems.lines().size(), 1u) << name;
        EXPECT_NE(problems.lines().front().find(std::string("is the file of ") + role), std::string::npos)
            << problems.lines().front();
    }
}

TEST(WrittenFiles, ObjectsAreAFileOfTheirOwn) {
    const std::string grasp =
        "[grasp]\nobjects = '/tmp/a'\n[[grasp.jaw]]\nsensor = 'left'\nx_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n";
    EXPECT_EQ(test::errors("[modbus]\nsettings = '/tmp/a'\n" + grasp + kRest).size(), 1u);
}

}  // namespace
}  // namespace tactiled
