// The last line of a file that a program wrote, crc = "0x1234": a checksum of the lines above. It is read as text and not as
// TOML, because it is outside of every table.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tactiled {

struct Seal {
    std::size_t start;  // start of the line in the file; the file's end if there is none
    std::optional<std::uint16_t> crc;
};

// setup
Seal find_seal(std::string_view file);

// CRC-16/CCITT-FALSE: polynomial 0x1021, starts at 0xFFFF, 0x29B1 of "123456789". setup
std::uint16_t crc_of_lines(std::string_view lines);

// Returns `lines` with their seal. setup
std::string sealed(const std::string& lines);

}  // namespace tactiled
