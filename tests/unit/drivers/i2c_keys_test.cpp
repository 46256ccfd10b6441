// The keys of driver "i2c" and of its chips: each error states the place and the right value.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <fstream>

#include "drivers/chips/chip.hpp"
#include "drivers/driver.hpp"

namespace tactiled {
namespace {

std::string i2c_problems_of(const std::string& text) {
    Problems problems;
    std::string all = "bus = \"/dev/i2c-1\"\n";
    all += text;
    Options options = Options::parse_text(all, "test.toml", problems);
    const auto driver = Drivers::find("i2c")->make(options);
    options.finish();
    return fmt::format("{}", fmt::join(problems.lines(), "\n"));
}

TEST(I2cKeys, AreReadForEveryChip) {
    EXPECT_EQ(i2c_problems_of(R"(
timeout_ms = 100
[[chip]]
device = 0
chip = "ad7746"
address = 0x48
mux = {address = 0x70, channel = 2}
rate_Hz = 84
channels = 2
capdac_a = [64, 70]
capdac_b = [0]
excitation = "both"
temperature = true
differential = false
[[chip]]
device = 1
chip = "ad7746"
mux = {address = 0x71, channel = 2}
[[chip]]
device = 2
chip = "nau7802"
rate_Hz = 80
gain = 64
channels = 2
avdd_V = 3.3
[[chip]]
device = 3
chip = "ads1115"
address = 0x4b
inputs = ["AIN0-AIN1", "AIN3"]
rate_Hz = 475
range_V = 0.256
[[chip]]
device = 4
chip = "ads122c04"
input = "AIN2-AIN3"
gain = 128
rate_Hz = 330
turbo = true
crc = false
reference = "supply"
[[chip]]
device = 5
chip = "fdc1004"
inputs = ["CIN1", "CIN2", "CIN3-CIN4"]
capdac = [3, 4]
rate_Hz = 100
[[chip]]
device = 6
chip = "mpr121"
electrodes = 12
samples = 10
interval_ms = 2
charge_uA = 32
charge_us = 1
)"),
              "");
}

TEST(I2cKeys, SayWhatIsWrongWithLineAndRemedy) {
    EXPECT_EQ(i2c_problems_of(""), "test.toml:1: no chip: add [[link.chip]] with device and chip");
    EXPECT_EQ(
        i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ad7747\""),
        "test.toml:4: [[chip]]: chip = \"ad7747\" is unknown; did you mean \"ad7746\"? known: \"ad7746\", \"ads1115\", "
        "\"ads122c04\", \"demo16\", \"fdc1004\", \"mpr121\", \"nau7802\"");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ad7746\"\naddress = 0x49"),
              "test.toml:5: [[chip]]: address = 73 is outside 72 .. 72");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ad7746\"\nrate_Hz = 90"),
              "test.toml:5: [[chip]]: rate_Hz = 90 is not possible; one of 91, 84, 50, 26, 16, 13, 11, 9");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ads1115\"\ninputs = [\"AIN4\"]"),
              "test.toml:5: [[chip]]: input \"AIN4\" is unknown; known: AIN0 .. AIN3, AIN0-AIN1, AIN0-AIN3, AIN1-AIN3, "
              "AIN2-AIN3");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"fdc1004\""),
              "test.toml:2: [[chip]]: key \"inputs\" is missing, such as [\"CIN1\", \"CIN2\"]");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"fdc1004\"\ninputs = [\"CIN2-CIN1\"]"),
              "test.toml:5: [[chip]]: input \"CIN2-CIN1\" is unknown; known: CIN1 .. CIN4, and pairs such as CIN1-CIN2, the "
              "lower number first");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ads122c04\"\ninput = \"AIN0\"\ngain = 8"),
              "test.toml:6: [[chip]]: gain > 4 needs a pair of inputs, such as \"AIN0-AIN1\"");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ad7746\"\nrate = 9"),
              "test.toml:5: [[chip]]: unknown key \"rate\"; did you mean \"rate_Hz\"?");
    EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ad7746\"\nmux = {address = 0x50, channel = 1}"),
              "test.toml:5: [[chip]] [mux]: address = 80 is outside 112 .. 119");
}

TEST(I2cKeys, ADataReadyLineIsForChipsThatConvertByThemselves) {
    const std::string line = "data_ready = {chip = \"gpiochip0\", line = \"17\"}\n";
    for (const std::string chip : {"ad7746", "nau7802", "ads122c04"})
        EXPECT_EQ(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"" + chip + "\"\n" + line), "");
    for (const std::string chip : {"mpr121\"", "ads1115\"\ninputs = [\"AIN0\"]", "ad7746\"\nchannels = 2"})
        EXPECT_NE(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"" + chip + "\n" + line).find("does not convert by itself"),
                  std::string::npos);
    EXPECT_NE(i2c_problems_of("[[chip]]\ndevice = 0\nchip = \"ad7746\"\ndata_ready = {chip = \"gpiochip0\"}")
                  .find("\"line\" is missing"),
              std::string::npos);
}

TEST(I2cKeys, ASwitchInFrontOfAChipNeedsElectrodesAndLinesEnough) {
    const std::string chip = "[[chip]]\ndevice = 0\nchip = \"ad7746\"\n";
    const auto select = [](const std::string& lines) {
        return "select = {chip = \"gpiochip0\", lines = [" + lines + "]}\n";
    };
    EXPECT_EQ(i2c_problems_of(chip + "electrodes = 5\n" + select("\"5\", \"6\", \"MUX_C\"")), "");
    EXPECT_NE(
        i2c_problems_of(chip + "electrodes = 5\n" + select("\"5\", \"6\"")).find("select one of 4, not of 5 electrodes"),
        std::string::npos);
    EXPECT_NE(i2c_problems_of(chip + "electrodes = 5\n").find("electrodes needs select"), std::string::npos);
    EXPECT_NE(i2c_problems_of(chip + select("\"5\"")).find("ad7746 with electrodes"), std::string::npos);
    EXPECT_NE(i2c_problems_of(chip + "electrodes = 2\nchannels = 2\n" + select("\"5\"")).find("cannot both be there"),
              std::string::npos);
    EXPECT_NE(i2c_problems_of(chip + "electrodes = 1\n" + select("\"5\"")).find("needs no switch"), std::string::npos);
    EXPECT_NE(
        i2c_problems_of(chip + "electrodes = 2\n" + select("\"5\"") + "data_ready = {chip = \"gpiochip0\", line = \"7\"}\n")
            .find("does not convert by itself"),
        std::string::npos);
}

// Inputs of one converter are measured one after the other: the first is the oldest when the frame is complete.
TEST(I2cKeys, GiveEachChannelTheDelayOfItsConversion) {
    Problems problems;
    Options options = Options::parse_text(
        "bus = \"/dev/i2c-1\"\n[[chip]]\ndevice = 3\nchip = \"ads1115\"\nrate_Hz = 8\n"
        "inputs = [\"AIN0\", \"AIN1\", \"AIN2\", \"AIN3\"]\n",
        "test.toml", problems);
    const auto driver = Drivers::find("i2c")->make(options);
    const double last_s = driver->delay_s(3, 3);
    EXPECT_NEAR(last_s, 0.5 / 8, 1e-3);  // half of its conversion
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(driver->delay_s(3, k), double(7 - 2 * k) * last_s, 1e-9);
    EXPECT_EQ(driver->delay_s(3, 4), last_s);
    EXPECT_EQ(driver->delay_s(4, 0), 0);  // not a device of this link
}

TEST(I2cKeys, TwoChipsThatWouldAnswerAtOnceAreRefused) {
    const std::string one = "[[chip]]\ndevice = 0\nchip = \"ad7746\"\n";
    const std::string two = "[[chip]]\ndevice = 1\nchip = \"ads1115\"\ninputs = [\"AIN0\"]\n";
    const std::string left = "mux = {address = 0x70, channel = 0}\n", right = "mux = {address = 0x70, channel = 1}\n";
    EXPECT_NE(i2c_problems_of(one + two).find("another chip of this bus answers at 0x48, too"), std::string::npos);
    EXPECT_NE(i2c_problems_of(one + two + left).find("too"), std::string::npos);
    EXPECT_NE(i2c_problems_of(one + left + two + left).find("too"), std::string::npos);
    EXPECT_EQ(i2c_problems_of(one + left + two + right), "");
    EXPECT_NE(i2c_problems_of(one + left + "[[chip]]\ndevice = 0\nchip = \"mpr121\"\n").find("device = 0 is another chip's"),
              std::string::npos);
}

TEST(I2cKeys, OfTheExampleInTheDocumentedConfigurationAreGood) {
    std::ifstream file(TACTILED_SOURCE_DIR "/config/tactiled.toml");
    std::string text, block;
    for (std::string line; std::getline(file, line);) {
        if (line.rfind("#", 0) == 0) {
            block += line.substr(std::min<std::size_t>(2, line.size()));
            block += '\n';
            continue;
        }
        if (const auto at = block.find("[[link]]"); block.find("driver = \"i2c\"") != block.npos && at != block.npos)
            text = block.substr(at);
        block.clear();
    }
    Problems problems;
    Options options = Options::parse_text(text, "example.toml", problems);
    auto links = options.tables("link");
    ASSERT_EQ(links.size(), 1u) << text;
    EXPECT_EQ(links[0].text("name"), "i2c1");
    EXPECT_EQ(links[0].text("driver"), "i2c");
    Drivers::find("i2c")->make(links[0]);
    options.finish();
    EXPECT_EQ(fmt::format("{}", fmt::join(problems.lines(), "\n")), "");
}

TEST(I2cKeys, ABusThatIsNotThereIsSaid) {
    Problems problems;
    Options options =
        Options::parse_text("bus = \"/dev/i2c-99\"\n[[chip]]\ndevice = 0\nchip = \"ad7746\"", "test.toml", problems);
    const auto driver = Drivers::find("i2c")->make(options);
    EXPECT_EQ(driver->open(), "/dev/i2c-99: no such bus: load the module i2c-dev, plug the adapter in, see i2cdetect -l");
    options = Options::parse_text("bus = \"/dev/null\"\n[[chip]]\ndevice = 0\nchip = \"ad7746\"", "test.toml", problems);
    EXPECT_EQ(Drivers::find("i2c")->make(options)->open(), "/dev/null: is no I2C bus; should be such as /dev/i2c-1");
}

}  // namespace
}  // namespace tactiled
