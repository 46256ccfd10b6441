// Driver "sim" as used by the daemon.
#include "drivers/driver.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>

namespace tactiled {
namespace {

// A lost frame of the scene is counted once: by `lost` of the next frame, and by the gap in its counter.
TEST(SimDriver, CountsEachLostFrameOnce) {
    const std::string scene = ::testing::TempDir() + "lost." + std::to_string(::getpid()) + ".toml";
    std::ofstream(scene) << "format = 1\ntitle = \"t\"\n[[sensor]]\nname = \"s\"\nmodel = \"table\"\n[[motion]]\ndo = "
                            "\"hold\"\nfor_s = 20\n[effects.lost_frames]\nbegins = 0.01\nends = 0.25\n";
    Problems problems;
    Options options =
        Options::parse_text("scene = \"" + scene + "\"\neffects = \"lost_frames\"\nspeed = 1000\n", "test.toml", problems);
    const auto driver = Drivers::find("sim")->make(options);
    problems.throw_if_any();
    ASSERT_EQ(driver->open(), "");
    Frame frame{};
    std::uint64_t frames = 0, lost = 0, gaps = 0;
    for (Status status = Status::timeout; status != Status::disconnected;) {
        const std::uint32_t before = frame.sequence;
        status = driver->read(frame, 10);
        if (status != Status::frame) continue;
        if (frames > 0) gaps += frame.sequence - before - 1;
        lost += frame.lost;
        ++frames;
    }
    EXPECT_GT(lost, 100u);
    EXPECT_EQ(lost, gaps);
    EXPECT_NEAR(double(frames + lost), 20'000, 20);  // a burst may be at the end
    std::remove(scene.c_str());
}

}  // namespace
}  // namespace tactiled
