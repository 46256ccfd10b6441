// Receives from a device without a configuration. Shared by `identify` and `capture`.
#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "drivers/wire/stream_format.hpp"

namespace tactiled::ctl {

// Result of listening to one device at one or several rates.
struct Heard {
    std::string device;                // path of a tty, or ADDRESS:PORT
    bool network = false;              // ADDRESS:PORT
    unsigned baud = 0;                 // rate at which a tty was recognised, or the last one tried
    double seconds = 0;                // spent at that rate
    std::vector<std::uint8_t> bytes;   // received in that time
    std::optional<StreamGuess> guess;  // by the format that accepts most of them

    // Returns the keys of a [[link]] except its name; "" if no format was recognised.
    [[nodiscard]] std::string keys() const;
};

// Returns the path or address that a word names: one with a slash or a colon is itself, and another one may be a terminal
// in this folder or in /dev. "" = the word is the name of a [[link]].
std::string device_of(const std::string& word);

// Receives for `seconds` at `baud`, or with 0 at each usual rate until a format recognises the bytes.
// setup: throws SetupError where the device cannot be opened
Heard listen(const std::string& device, unsigned baud, double seconds);

// Returns the text of a [[link]] table with these keys.
std::string link_text(const std::string& name, const std::string& keys);

// Returns the device or address, and the baud rate, of a [[link]] of `config`.
// setup: throws SetupError where there is no such link, or where it is no serial port and no TCP device
struct NamedDevice {
    std::string device;
    unsigned baud = 0;
};
NamedDevice device_of_link(const std::string& config, const std::string& link);

// Returns why bytes without a known format are none, with the line to send where they are words and numbers.
std::string why_no_format(const std::vector<std::uint8_t>& bytes);

// Returns up to `max` of the bytes, control characters as '.'.
std::string printable(const std::vector<std::uint8_t>& bytes, std::size_t max);

}  // namespace tactiled::ctl
