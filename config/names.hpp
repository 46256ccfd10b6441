// Rules for names and channels in the configuration and in calibrations.
#pragma once
#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

namespace tactiled {

// the shared memory's TACTILED_NAME_SIZE without the terminating zero
inline constexpr std::size_t kLongestNameBytes = 31;
inline constexpr std::size_t kMaxChannels = 32;  // channels of a frame

inline bool valid_name(std::string_view name) {
    constexpr std::string_view kAllowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-";
    return !name.empty() && name.size() <= kLongestNameBytes && name.find_first_not_of(kAllowed) == name.npos;
}
inline constexpr const char* kValidName = "a name has 1 .. 31 of A-Z a-z 0-9 _ . -";

// Channels are the headers of CSV columns as well: no comma, no quote, no invisible character.
inline bool valid_channel(std::string_view name) {
    return !name.empty() && name.size() <= kLongestNameBytes && std::none_of(name.begin(), name.end(), [](char c) {
        return static_cast<unsigned char>(c) <= ' ' || c == ',' || c == '"' || c == '\x7f';  // char may be signed or not
    });
}
inline constexpr const char* kValidChannel = "a channel's name has 1 .. 31 bytes and no space, comma or quote";

}  // namespace tactiled
