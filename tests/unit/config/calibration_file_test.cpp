// Saving a calibration: the old file stays where the new one cannot be written, or could not be read again.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <limits>

#include "example_calibration.hpp"
#include "folder.hpp"

namespace tactiled {
namespace {

using test::example;
using test::Folder;

std::size_t files_in(const Folder& folder) {
    std::size_t n = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) n += entry.exists() ? 1 : 0;
    return n;
}

TEST(CalibrationFile, ReplacesTheOldOne) {
    const Folder folder;
    const std::string path = folder.write("c.toml", "old");
    save_calibration(example(), path);
    EXPECT_EQ(test::read_file(path), calibration_text(example()));
    EXPECT_EQ(files_in(folder), 1u);
    struct stat about {};
    ASSERT_EQ(::stat(path.c_str(), &about), 0);
    EXPECT_EQ(about.st_mode & 0444u, 0444u);  // the daemon runs as another user than the calibration
}

TEST(CalibrationFile, KeepsTheOldOneWhenTheDiskRefuses) {
    const Folder folder;
    const std::string path = folder.write("c.toml", "old");
    ::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    rlimit small = before;
    small.rlim_cur = 100;  // bytes: the write stops half-way, as on a full disk
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    EXPECT_THROW(save_calibration(example(), path), SetupError);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    EXPECT_EQ(test::read_file(path), "old");
    EXPECT_EQ(files_in(folder), 1u);
}

TEST(CalibrationFile, SaysWhyItWasNotSaved) {
    const Folder folder;
    EXPECT_THROW(save_calibration(example(), folder / "none/c.toml"), SetupError);
    EXPECT_THROW(save_calibration(example(), folder / ""), SetupError);
    std::filesystem::create_directory(folder / "c.toml");
    try {
        save_calibration(example(), folder / "c.toml");
        FAIL() << "a folder was replaced";
    } catch (const SetupError& error) {
        EXPECT_EQ(std::string(error.what()), folder / "c.toml" + ": not saved: rename: Is a directory");
    }
    EXPECT_EQ(files_in(folder), 1u);
}

TEST(CalibrationFile, DoesNotFollowALinkLaidForItsTemporaryFile) {
    const Folder folder;
    const std::string victim = folder.write("victim", "precious");
    const std::string temporary = folder / (".c.toml." + std::to_string(::getpid()) + ".tmp");
    std::filesystem::create_symlink(victim, temporary);
    save_calibration(example(), folder / "c.toml");
    EXPECT_EQ(test::read_file(victim), "precious");
    EXPECT_EQ(test::read_file(folder / "c.toml"), calibration_text(example()));
    EXPECT_EQ(files_in(folder), 2u);
}

TEST(CalibrationFile, IsNeverOneThatCannotBeReadAgain) {
    const Folder folder;
    const std::string path = folder.write("c.toml", "old");
    const auto refused = [&](auto change) {
        Calibration c = example();
        change(c);
        EXPECT_THROW(save_calibration(c, path), SetupError);
        EXPECT_EQ(test::read_file(path), "old");
    };
    refused([](Calibration& c) { c.zero[0] = std::numeric_limits<double>::quiet_NaN(); });
    refused([](Calibration& c) { c.matrix[0][0] = std::numeric_limits<double>::infinity(); });
    refused([](Calibration& c) { c.matrix[0][0] = 1e301; });
    refused([](Calibration& c) { c.zero.pop_back(); });
    refused([](Calibration& c) { c.channels[0] = "a b"; });
    refused([](Calibration& c) { c.model = ""; });
    refused([](Calibration& c) { c.serial = "\xff"; });
    refused([](Calibration& c) { c.parameters["x y"] = 1; });
    refused([](Calibration& c) { c.parameters["x = 5\nparameters.y"] = 1; });
}

}  // namespace
}  // namespace tactiled
