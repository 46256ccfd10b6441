// Data that were not measured are published as simulated, for any driver; a driver with an unknown name is an error.
#include <gtest/gtest.h>

#include "node/setup.hpp"
#include "tactiled/reader.hpp"
#include "tests/unit/config/folder.hpp"
#include "tests/unit/node/unit_calibration.hpp"
#include "tests/unit/shm/segment_fixture.hpp"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;

// A node with one link of these keys.
class Simulated : public SegmentTest {
protected:
    Node load(const std::string& link) {
        (void)folder_.write("c.toml", test::unit_calibration());
        Node node = load_node(folder_.write("t.toml", "[node]\nname = '" + name_ + "'\n[[link]]\nname = 'usb0'\n" + link +
                                                          "[[sensor]]\nname = 'left'\nlink = 'usb0'\nmodel = 'generic'\n"
                                                          "calibration = 'c.toml'\n"),
                              problems_);
        for (const auto& line : problems_.lines()) lines_.push_back(line.substr(folder_.path().size() + 1));
        return node;
    }

    // Returns the link's entry in the directory, as a reader sees it.
    bool is_published_as_simulated(const std::string& link) {
        const Node node = load(link);
        EXPECT_EQ(lines_, Lines{}) << link;
        if (!lines_.empty()) return false;
        const SegmentWriter writer(node.plan);
        const Segment segment = Segment::open(name_);
        const bool simulated = segment.link(0).simulated != 0;
        EXPECT_EQ(node.simulated, simulated) << link;  // STATUS, bit 9
        return simulated;
    }

    test::Folder folder_;
    Problems problems_;
    Lines lines_;
};

constexpr char kUart[] = "driver = 'uart'\ndevice = '/dev/null'\nformat = 'lines'\nchannels = 1\n";

TEST_F(Simulated, AreTheDataOfADriverThatDoesNotMeasure) {
    EXPECT_TRUE(is_published_as_simulated("driver = 'toy'\n"));
    EXPECT_TRUE(is_published_as_simulated("driver = 'toy'\nsimulated = true\n"));
    EXPECT_TRUE(is_published_as_simulated("driver = 'replay'\nfile = 'r.mcap'\n"));
}

// The example of drivers/README.md, copied without changes, is not taken for a measurement.
TEST_F(Simulated, AreTheDataOfTheExampleOfThePage) { EXPECT_TRUE(is_published_as_simulated("driver = 'ramp'\n")); }

TEST_F(Simulated, AreTheDataOfADriverThatMeasuresOnlyWhereTheLinkSaysSo) {
    EXPECT_FALSE(is_published_as_simulated(kUart));
    EXPECT_FALSE(is_published_as_simulated(std::string(kUart) + "simulated = false\n"));
    EXPECT_TRUE(is_published_as_simulated(std::string(kUart) + "simulated = true\n"));
}

TEST_F(Simulated, CannotBeDenied) {
    const std::string keys[] = {"'sim'\nscene = '" TACTILED_SOURCE_DIR "/config/scenes/array.toml'", "'replay'\nfile = 'r'",
                                "'toy'", "'ramp'"};
    for (const std::string& key : keys) {
        const std::string driver = key.substr(1, key.find('\'', 1) - 1);
        lines_.clear();
        problems_ = {};
        (void)load("simulated = false\ndriver = " + key + "\n");
        EXPECT_EQ(lines_, Lines{"t.toml:5: link \"usb0\": driver \"" + driver + "\" measures nothing: simulated = true"});
    }
}

TEST_F(Simulated, AWrongValueIsOneError) {
    (void)load("driver = 'toy'\nsimulated = 'no'\n");
    EXPECT_EQ(lines_.size(), 1u);
}

TEST_F(Simulated, AMisspeltDriverIsAnErrorThatListsAll) {
    (void)load("driver = 'uert'\nbaud = 9600\n");  // baud may be a key of the intended driver
    ASSERT_EQ(lines_.size(), 1u);
    EXPECT_EQ(lines_[0],
              "t.toml:5: link \"usb0\": driver = \"uert\" is unknown; did you mean \"uart\"? known: \"can\", \"i2c\", "
              "\"modbus\", \"ramp\", \"replay\", \"sim\", \"tcp\", \"toy\", \"uart\", \"udp\"");
}

TEST_F(Simulated, AMisspeltFormatIsTheOnlyError) {
    (void)load("driver = 'uart'\ndevice = '/dev/ttyUSB0'\nformat = 'lnes'\nchannels = 3\n");
    ASSERT_EQ(lines_.size(), 1u);
    EXPECT_NE(lines_[0].find("format = \"lnes\" is unknown; did you mean \"lines\"?"), std::string::npos) << lines_[0];
}

}  // namespace
}  // namespace tactiled
