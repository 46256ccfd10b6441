// Bytes and texts for the tests of the wire formats, and their decoded frames.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/wire/decoder.hpp"

namespace tactiled {

using Bytes = std::vector<std::uint8_t>;

inline Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

inline Bytes hex(const std::string& text) {
    Bytes bytes;
    for (std::size_t at = 0; at < text.size(); at += 3)
        bytes.push_back(std::uint8_t(std::stoi(text.substr(at, 2), nullptr, 16)));
    return bytes;
}

// Returns the example after the line with that beginning, from the format's own page.
inline std::string line_after(const std::string& page, const std::string& beginning) {
    std::ifstream file(TACTILED_SOURCE_DIR "/drivers/wire/" + page);
    std::string line;
    while (std::getline(file, line) && !line.starts_with(beginning)) {}
    std::getline(file, line);
    std::getline(file, line);
    return line.substr(line.find_first_not_of(' '));
}

inline std::vector<Frame> decode(StreamDecoder& decoder, const Bytes& bytes, std::size_t chunk = 4096) {
    std::vector<Frame> frames;
    Frame frame;
    std::uint64_t t_ns = 1;
    for (std::size_t at = 0; at < bytes.size(); at += chunk, ++t_ns) {
        decoder.push({bytes.data() + at, std::min(chunk, bytes.size() - at)}, t_ns);
        while (decoder.next(frame)) frames.push_back(frame);
    }
    return frames;
}

inline Frame frame_of(std::uint32_t sequence, std::initializer_list<double> channels) {
    Frame frame;
    frame.sequence = sequence;
    for (const double value : channels) frame.channel[frame.n_channels++] = value;
    return frame;
}

}  // namespace tactiled
