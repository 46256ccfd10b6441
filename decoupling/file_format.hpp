// Formats that are no text, by their first bytes.
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

// Bytes from which every format of the list is recognised.
inline constexpr std::size_t kFormatBytes = 64;

// Returns the sentence for a file of a format that is not read: its name, and the command that converts it. "" if the
// bytes may be text, gzip or npy. setup
std::string other_format(std::string_view first_bytes, const std::string& path);

// Returns the topics of a recording in MCAP; none if it cannot be read twice. setup
std::vector<std::string> mcap_topics(const std::string& path);

}  // namespace tactiled
