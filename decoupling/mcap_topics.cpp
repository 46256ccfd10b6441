// The topics of an MCAP file (mcap.dev, version 0): records of 1 byte opcode, 8 bytes length and a body. Channel records
// stand before their messages and, in files with chunks, once more in the summary, whose place the footer states.
#include <algorithm>
#include <cstdint>
#include <fstream>

#include "decoupling/file_format.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kMagic_bytes = 8, kHead_bytes = 9, kFooter_bytes = 20;
constexpr unsigned char kFooter = 2, kChannel = 4;
constexpr int kMaxRecords = 10'000;  // in the start of a file without a summary
constexpr std::uint64_t kLongestTopic = 256;

std::uint64_t number(const char* bytes, std::size_t n) {
    std::uint64_t value = 0;
    for (std::size_t i = n; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[i]);
    return value;
}

// The body of a channel begins with id and schema (2 bytes each) and the topic (4 bytes length, text).
std::string topic_of(std::ifstream& file) {
    char head[8];
    if (!file.read(head, sizeof head)) return "";
    std::string topic(std::min(number(head + 4, 4), kLongestTopic), 0);
    if (!file.read(topic.data(), std::streamsize(topic.size()))) return "";
    std::replace_if(
        topic.begin(), topic.end(), [](char c) { return c < '!' || c > '~'; }, '?');
    return topic;
}

}  // namespace

std::vector<std::string> mcap_topics(const std::string& path) {
    std::vector<std::string> topics;
    std::ifstream file(path, std::ios::binary);
    char head[kHead_bytes], footer[kFooter_bytes];
    std::uint64_t at = kMagic_bytes;
    file.seekg(-std::streamoff(kMagic_bytes + kFooter_bytes + kHead_bytes), std::ios::end);
    if (file.read(head, sizeof head) && head[0] == char(kFooter) && file.read(footer, sizeof footer))
        if (const std::uint64_t summary = number(footer, 8); summary > 0) at = summary;
    file.clear();
    for (int i = 0; i < kMaxRecords && at < UINT64_MAX / 4; ++i) {
        file.seekg(std::streamoff(at));
        if (!file.read(head, sizeof head)) break;
        if (head[0] == char(kChannel))
            if (std::string topic = topic_of(file); std::find(topics.begin(), topics.end(), topic) == topics.end())
                topics.push_back(std::move(topic));
        const std::uint64_t length = number(head + 1, 8);
        if (length > UINT64_MAX / 4) break;
        at += kHead_bytes + length;
    }
    return topics;
}

}  // namespace tactiled
