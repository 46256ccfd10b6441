// A serial format: how the bytes of a tty or a TCP connection become frames. A new format is one new file, with an entry at
// its end, and one line in drivers/CMakeLists.txt. To add one: drivers/README.md.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "config/registry.hpp"
#include "drivers/wire/decoder.hpp"

namespace tactiled {

// The properties of a device that is played (`tactilectl play`, `simulate --pty`). A format ignores those that it does not
// have.
struct StreamSettings {
    int bits = 24;          // bits of a channel, 24 or 32: binary formats
    bool checksum = false;  // each frame has one, by exclusive or: text formats
    bool sequence = false;  // each frame has a counter: text formats
    bool time_us = false;   // each frame has the device's time
    bool crc16 = false;     // each frame has a CRC-16: text formats
};

// A format's reading of bytes that an unknown device sent (`tactilectl identify`).
struct StreamGuess {
    std::string keys;                // lines of a [[link]] table: format and its own keys
    std::size_t good = 0;            // frames that these keys accept
    std::size_t bad = 0;             // frames or lines that they refuse
    std::string last_bad;            // the last of these, printable
    std::vector<std::string> notes;  // data that the device should send in addition
};

struct StreamFormat {
    std::string_view name;  // name in `format = "lines"`
    // The links on which devices with this format exist.
    bool on_tty = true, on_tcp = true;
    // Number of devices that one stream can contain: Frame::device is 0 .. max_devices - 1.
    unsigned max_devices = 1;
    // Reads the format's own keys of a [[link]] table; errors go to the options' Problems. `counts` outlives the decoder.
    // setup
    std::unique_ptr<StreamDecoder> (*make)(Options& options, LinkCounts& counts);
    // The bytes that a device sends for `frame`. nullptr: `tactilectl play` does not offer this format. setup
    std::vector<std::uint8_t> (*encode)(const Frame& frame, const StreamSettings& settings) = nullptr;
    // The bytes that a device answers to a line without its end, at `time_us` of its clock; empty: no answer. nullptr: no
    // device with this format answers. setup
    std::vector<std::uint8_t> (*answer)(std::string_view request, std::uint32_t time_us,
                                        const StreamSettings& settings) = nullptr;
    // Returns the keys with which `bytes`, received within `seconds`, are frames; nullopt if they are not of this format.
    // nullptr: `identify` does not look for this format. setup
    std::optional<StreamGuess> (*recognise)(std::span<const std::uint8_t> bytes, double seconds) = nullptr;
    Registry<StreamFormat> in_list{this};
};

using StreamFormats = Registry<StreamFormat>;

}  // namespace tactiled
