// Registration: drivers, serial formats and chips are found by the name of their entries, for any order of linking.
#include "config/registry.hpp"

#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <random>

#include "drivers/chips/chip.hpp"
#include "drivers/driver.hpp"
#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;

struct Fruit {
    std::string_view name;
    Required<bool> is_sweet;
    Registry<Fruit> in_list{this};
};
using Fruits = Registry<Fruit>;
// Neither this order nor its reverse is sorted.
const Fruit lemon{.name = "lemon", .is_sweet = false}, pear{.name = "pear", .is_sweet = true};
const Fruit apple{.name = "apple", .is_sweet = true}, fig{.name = "fig", .is_sweet = true};

TEST(Registry, NamesAreSortedWhateverTheOrderOfLinking) {
    EXPECT_EQ(Fruits::names(), (Lines{"apple", "fig", "lemon", "pear"}));
    EXPECT_EQ(Fruits::names([](const Fruit& fruit) { return bool(fruit.is_sweet); }), (Lines{"apple", "fig", "pear"}));
}

TEST(Registry, FindsByTheWholeName) {
    EXPECT_EQ(Fruits::find("lemon"), &lemon);
    EXPECT_EQ(Fruits::find("lemo"), nullptr);
    EXPECT_EQ(Fruits::find(""), nullptr);
    EXPECT_EQ(Fruits::find("lemon", [](const Fruit& fruit) { return bool(fruit.is_sweet); }), nullptr);
}

struct Stone {
    std::string_view name;
    Registry<Stone> in_list{this};
};

TEST(RegistryDeathTest, RefusesTwoEntriesWithOneName) {
    [[maybe_unused]] static const Stone one{.name = "flint"}, same{.name = "flint"};
    EXPECT_DEATH((void)Registry<Stone>::find("flint"), "two entries have the same name");
    EXPECT_EQ(Registry<Stone>::find("chalk"), nullptr);
}

// An entry that does not state whether its driver measures does not compile.
static_assert(!std::is_default_constructible_v<Required<bool>>);

template <class Entry>
void each_name_stands_once() {
    const Lines names = Registry<Entry>::names();
    EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
    EXPECT_GE(names.size(), 5u);
    for (const auto& name : names) {
        ASSERT_NE(Registry<Entry>::find(name), nullptr) << name;
        EXPECT_NE(Registry<Entry>::find(name)->make, nullptr) << name;
    }
}

TEST(Registration, EachNameStandsOnce) {
    each_name_stands_once<DriverEntry>();
    each_name_stands_once<StreamFormat>();
    each_name_stands_once<ChipEntry>();
}

TEST(Registration, AToyDriverIsFoundAndRuns) {
    Problems problems;
    Options options = Options::parse_text("first = 7\ndevice = \"/dev/toy\"", "test.toml", problems);
    const DriverEntry* const entry = Drivers::find("toy");
    ASSERT_NE(entry, nullptr);
    EXPECT_FALSE(entry->measures);
    const auto driver = entry->make(options);
    options.finish();
    EXPECT_EQ(problems.lines(), Lines{});
    ASSERT_EQ(driver->open(), "");
    Frame frame;
    for (int n = 7; n < 10; ++n) {
        ASSERT_EQ(driver->read(frame, 50), Status::frame);
        EXPECT_EQ(frame.channel[0], n);
    }
    ASSERT_EQ(entry->requirements(options).size(), 1u);
    EXPECT_EQ(entry->requirements(options)[0].name, "/dev/toy");
}

// The problems of a [[link]] with these keys.
Lines problems_of(const std::string& driver, const std::string& keys) {
    Problems problems;
    Options options = Options::parse_text(keys, "test.toml", problems);
    (void)Drivers::find(driver)->make(options);
    options.finish();
    return problems.lines();
}

TEST(Registration, AToyFormatIsReadOverAPty) {
    int master = -1, slave = -1;
    char name[128];
    ASSERT_EQ(::openpty(&master, &slave, name, nullptr, nullptr), 0);
    Problems problems;
    Options options =
        Options::parse_text("format = \"toy\"\nunit = 0.5\ndevice = \"" + std::string(name) + "\"", "test.toml", problems);
    const auto driver = Drivers::find("uart")->make(options);
    options.finish();
    EXPECT_EQ(problems.lines(), Lines{});
    ASSERT_EQ(driver->open(), "");
    const std::uint8_t bytes[] = {1, 0xA5, 7, 0xA5, 0xA5, 0xA5};
    ASSERT_EQ(::write(master, bytes, sizeof bytes), ssize_t(sizeof bytes));
    Frame frame;
    for (const double value : {3.5, 82.5}) {
        Status status = Status::timeout;
        for (int i = 0; i < 20 && status == Status::timeout; ++i) status = driver->read(frame, 100);
        ASSERT_EQ(status, Status::frame);
        EXPECT_EQ(frame.channel[0], value);
    }
    EXPECT_EQ(driver->counts[TACTILED_LINK_SKIPPED], 1u);
    driver->close();
    ::close(master);
    ::close(slave);
    EXPECT_EQ(problems_of("uart", "device = \"/dev/null\"\nformat = \"toy\"\nunit = 0"),
              Lines{"test.toml:3: unit = 0 is outside 0.001 .. 1000"});
    EXPECT_EQ(problems_of("uart", "device = \"/dev/null\"\nformat = \"cobs\"\nunit = 1").size(), 1u);  // not a key of it
}

TEST(Registration, AMisspeltFormatIsAnErrorThatListsThoseOfTheLink) {
    EXPECT_EQ(problems_of("uart", "device = \"/dev/null\"\nformat = \"cosb\""),
              Lines{"test.toml:2: format = \"cosb\" is unknown; did you mean \"cobs\"? known: \"adc\", \"cobs\", \"ft300\", "
                    "\"hex\", \"lines\", \"orca\", \"toy\""});
    EXPECT_EQ(problems_of("uart", "device = \"/dev/null\"\nformat = \"kms40\""),
              Lines{"test.toml:2: format = \"kms40\" is unknown; known: \"adc\", \"cobs\", \"ft300\", \"hex\", \"lines\", "
                    "\"orca\", \"toy\""});
    EXPECT_EQ(problems_of("tcp", "address = \"127.0.0.1\"\nformat = \"toi\""),
              Lines{"test.toml:2: format = \"toi\" is unknown; known: \"adc\", \"cobs\", \"hex\", \"kms40\", \"lines\""});
}

TEST(Registration, AMisspeltChipIsAnErrorThatListsAll) {
    EXPECT_EQ(problems_of("i2c", "bus = \"/dev/null\"\n[[chip]]\ndevice = 0\nchip = \"mrp121\""),
              Lines{"test.toml:4: [[chip]]: chip = \"mrp121\" is unknown; did you mean \"mpr121\"? known: \"ad7746\", "
                    "\"ads1115\", \"ads122c04\", \"demo16\", \"fdc1004\", \"mpr121\", \"nau7802\""});
}

// Tests any format's decoder, also of a new one: the result does not depend on how the bytes were cut.
TEST(Registration, EachFormatGivesTheSameFramesHoweverTheBytesAreCut) {
    std::mt19937 random(7);
    std::vector<std::uint8_t> bytes(4000);
    const std::string_view often = "\n\n,5 0A\xA5\x20\x4E";
    for (auto& byte : bytes) byte = std::uint8_t(random() % 2 ? random() : unsigned(often[random() % often.size()]));
    for (const auto& name : StreamFormats::names()) {
        const auto decode = [&](std::size_t chunk) {
            Problems problems;
            Options options = Options::parse_text("channels = 1\ndigits = 1", "test.toml", problems);
            LinkCounts counts;
            const auto decoder = StreamFormats::find(name)->make(options, counts);
            EXPECT_EQ(problems.lines(), Lines{}) << name;
            std::vector<double> values;
            Frame frame;
            for (std::size_t at = 0; at < bytes.size(); at += chunk) {
                decoder->push(std::span(bytes).subspan(at, std::min(chunk, bytes.size() - at)), 1);
                while (decoder->next(frame))
                    values.insert(values.end(), frame.channel.begin(), frame.channel.begin() + frame.n_channels);
            }
            EXPECT_EQ(counts[TACTILED_LINK_BYTES], bytes.size()) << name;
            return values;
        };
        const auto whole = decode(StreamDecoder::kMaxBytes);
        for (const std::size_t chunk : {1u, 2u, 7u, 100u}) {
            const auto cut = decode(chunk);
            ASSERT_EQ(cut.size(), whole.size()) << name;
            for (std::size_t i = 0; i < cut.size(); ++i)
                EXPECT_EQ(std::memcmp(&cut[i], &whole[i], sizeof cut[i]), 0) << name;
        }
    }
}

// Formats that a device can be played with: encoded frames are decoded.
TEST(Registration, EachFormatThatIsPlayedIsReadBack) {
    const auto has_encoder = [](const StreamFormat& format) { return format.encode != nullptr; };
    EXPECT_EQ(StreamFormats::names(has_encoder), (Lines{"cobs", "lines"}));
    for (const auto& name : StreamFormats::names(has_encoder)) {
        const StreamFormat& format = *StreamFormats::find(name);
        Problems problems;
        Options options = Options::parse_text("channels = 2\nsequence = true", "test.toml", problems);
        LinkCounts counts;
        const auto decoder = format.make(options, counts);
        Frame sent, frame;
        sent.n_channels = 2;
        for (std::uint32_t n = 0; n < 3; ++n) {
            sent.sequence = n;
            sent.device = std::uint16_t(format.max_devices - 1);
            sent.channel[1] = -5.0 * n;
            decoder->push(format.encode(sent, {.sequence = true}), n + 1);
            if (!decoder->next(frame)) {
                EXPECT_EQ(n, 0u) << name;  // a line without a checksum counts from the second one on
                continue;
            }
            EXPECT_EQ(frame.channel[1], sent.channel[1]) << name;
            EXPECT_EQ(frame.sequence, n) << name;
            EXPECT_EQ(frame.device, sent.device) << name;
        }
        EXPECT_GE(counts[TACTILED_LINK_FRAMES], 2u) << name;
    }
}

// For `tactilectl doctor`.
TEST(Registration, ADriverNamesTheDevicesThatItNeeds) {
    using Kind = Requirement::Kind;
    const auto required = [](const std::string& driver, const std::string& keys) {
        Problems problems;
        Options options = Options::parse_text(keys, "test.toml", problems);
        const auto list = Drivers::find(driver)->requirements(options);
        EXPECT_EQ(problems.lines(), Lines{}) << driver;
        EXPECT_LE(list.size(), 1u) << driver;
        return list.empty() ? Requirement{Kind::file, "nothing"} : list[0];
    };
    EXPECT_EQ(required("uart", "device = '/dev/ttyUSB0'").name, "/dev/ttyUSB0");
    EXPECT_EQ(required("uart", "device = '/dev/ttyUSB0'").kind, Kind::serial_port);
    EXPECT_EQ(required("modbus", "device = '/dev/ttyUSB0'").name, "/dev/ttyUSB0");
    EXPECT_EQ(required("modbus", "device = '/dev/ttyUSB0'").kind, Kind::serial_port);
    EXPECT_EQ(required("modbus", "address = '192.168.1.1'").name, "nothing");
    EXPECT_EQ(required("i2c", "bus = '/dev/i2c-1'").name, "/dev/i2c-1");
    EXPECT_EQ(required("i2c", "bus = '/dev/i2c-1'").kind, Kind::file);
    EXPECT_EQ(required("can", "interface = 'can1'").name, "can1");
    EXPECT_EQ(required("can", "interface = 'can1'").kind, Kind::network_interface);
    EXPECT_EQ(required("can", "interface = 'can1'").bring_up, "ip link set can1 up type can bitrate 1000000");
    EXPECT_EQ(required("udp", "address = '10.0.0.2'\ntaxels = 4\nlisten = 5\nclock_ppm = 5\necho = true").kind,
              Kind::socket_buffer);
    EXPECT_GE(required("udp", "address = '10.0.0.2'\ntaxels = 1024\nvalues = 3").bytes, 1024u * 3 * 4 * 100);
    for (const char* driver : {"tcp", "replay"}) EXPECT_EQ(Drivers::find(driver)->requirements, nullptr) << driver;
}

// ---- the examples of drivers/README.md: tests/toys/example_*.cpp ----

TEST(ReadmeExamples, TheDriverRunsAndIsNotTakenForAMeasurement) {
    Problems problems;
    Options options = Options::parse_text("period_ms = 2", "test.toml", problems);
    ASSERT_NE(Drivers::find("ramp"), nullptr);
    EXPECT_FALSE(Drivers::find("ramp")->measures);
    const auto driver = Drivers::find("ramp")->make(options);
    ASSERT_EQ(driver->open(), "");
    Frame frame;
    for (int n = 0; n < 3; ++n) {
        ASSERT_EQ(driver->read(frame, 50), Status::frame);
        EXPECT_EQ(frame.channel[0], n);
    }
}

TEST(ReadmeExamples, TheFormatReadsItsLines) {
    Problems problems;
    Options options = Options::parse_text("bits = 12", "test.toml", problems);
    LinkCounts counts;
    const auto decoder = StreamFormats::find("adc")->make(options, counts);
    const std::string text = "ADC 1\nADC 4095\r\nADC 4096\nADD 1\n";
    decoder->push({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, 5);
    Frame frame;
    ASSERT_TRUE(decoder->next(frame));
    EXPECT_EQ(frame.channel[0], 1);
    EXPECT_EQ(frame.saturated, 0u);
    ASSERT_TRUE(decoder->next(frame));
    EXPECT_EQ(frame.channel[0], 4095);
    EXPECT_EQ(frame.saturated, 1u);
    EXPECT_FALSE(decoder->next(frame));
    EXPECT_EQ(counts[TACTILED_LINK_BAD_VALUE], 2u);
}

// Registers: 0 settings, 1 and 2 the code, 0xFF the identity.
class Demo16Bus final : public I2cBus {
public:
    Answer transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) noexcept override {
        if (address != 0x1A) return Answer::absent;
        if (out.size() == 2) registers[out[0]] = out[1];
        for (std::size_t i = 0; i < in.size(); ++i) in[i] = registers[(out[0] + i) % 256];
        return Answer::ok;
    }
    std::uint64_t now_ns() const noexcept override { return 0; }
    void wait_until(std::uint64_t) noexcept override {}
    std::array<std::uint8_t, 256> registers{};
};

TEST(ReadmeExamples, TheChipIsSetUpAndRead) {
    Problems problems;
    Options options = Options::parse_text("rate_Hz = 50", "test.toml", problems);
    const ChipEntry* const entry = Chips::find("demo16");
    ASSERT_NE(entry, nullptr);
    const auto chip = entry->make(options);
    EXPECT_EQ(chip->conversion_ns(), 20'000'000u);
    Demo16Bus bus;
    Muxes muxes(bus);
    LinkCounts counts;
    Port port(bus, muxes, {.address = 0x1A}, counts);
    EXPECT_EQ(chip->set_up(port, 0).kind, Chip::Progress::wrong);
    bus.registers[0xFF] = 0xD1;
    EXPECT_EQ(chip->set_up(port, 0).kind, Chip::Progress::done);
    Frame frame;
    EXPECT_EQ(chip->read(port, frame).kind, Chip::Reading::nothing);
    bus.registers[0] |= 0x80;
    bus.registers[1] = 0x7F;
    bus.registers[2] = 0xFF;
    EXPECT_EQ(chip->read(port, frame).kind, Chip::Reading::frame);
    EXPECT_EQ(frame.channel[0], 32767);
    EXPECT_EQ(frame.saturated, 1u);
    bus.registers[0] = 0;
    EXPECT_EQ(chip->read(port, frame).kind, Chip::Reading::was_reset);
}

}  // namespace
}  // namespace tactiled
