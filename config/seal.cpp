#include "config/seal.hpp"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <charconv>

namespace tactiled {

Seal find_seal(std::string_view file) {
    std::size_t end = file.size();
    if (end > 0 && file[end - 1] == '\n') --end;
    if (end > 0 && file[end - 1] == '\r') --end;
    const std::size_t before = file.substr(0, end).rfind('\n');
    const std::size_t start = before == file.npos ? 0 : before + 1;
    const std::string_view line = file.substr(start, end - start);
    constexpr std::string_view kHead = "crc = \"0x";
    std::uint16_t crc = 0;
    if (line.size() != kHead.size() + 5 || line.substr(0, kHead.size()) != kHead || line.back() != '"')
        return {file.size(), {}};
    const char* digits_end = line.data() + kHead.size() + 4;
    const auto [stop, error] = std::from_chars(line.data() + kHead.size(), digits_end, crc, 16);
    if (error != std::errc{} || stop != digits_end) return {file.size(), {}};
    return {start, crc};
}

std::uint16_t crc_of_lines(std::string_view lines) {
    boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false> crc;
    crc.process_bytes(lines.data(), lines.size());
    return crc.checksum();
}

std::string sealed(const std::string& lines) { return lines + fmt::format("crc = \"0x{:04X}\"\n", crc_of_lines(lines)); }

}  // namespace tactiled
