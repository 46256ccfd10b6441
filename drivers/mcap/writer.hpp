// Writes an MCAP file: chunks with a CRC and an index. A file that is truncated loses only its last chunk.
#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "config/options.hpp"
#include "drivers/descriptor.hpp"

namespace tactiled::mcap {

class Writer {
public:
    // Creates a file; an existing one is replaced only with `overwrite`. `compression` of the chunks: none, lz4 or zstd.
    // setup: throws SetupError if the file cannot be created, or if this program was built without the compression
    Writer(const std::string& path, bool overwrite, const std::string& compression = "none");

    // Adds a schema; call it before the first message. `data` in `encoding` "ros2msg" is the definition and the
    // definitions that it uses.
    std::uint16_t add_schema(const std::string& name, const std::string& encoding, const std::string& data);
    std::uint16_t add_channel(std::uint16_t schema, const std::string& topic, const std::string& message_encoding,
                              const std::map<std::string, std::string>& metadata = {});
    // Writes a whole file beside the messages.
    void attach(const std::string& name, const std::string& media_type, std::string_view data, std::uint64_t now_ns);

    // Adds a message; `time_ns` is since 1970. Messages are kept until flush(), which is called automatically at
    // kMaxPending bytes.
    void message(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time_ns, std::string_view data);
    void flush();
    // Flushes and writes the index. Messages that were not written by then are lost. Without this call the file stays as
    // after a truncation.
    void close();

    [[nodiscard]] std::uint64_t bytes() const { return offset_ + chunk_.size(); }
    [[nodiscard]] std::uint64_t messages() const { return messages_; }

    static constexpr std::size_t kMaxPending = 1u << 20;

private:
    struct Named {
        std::string record;  // the record in the data section, repeated in the summary
        std::uint64_t messages = 0;
        std::vector<std::pair<std::uint64_t, std::uint64_t>> index;  // time and offset of each message in the chunk
    };
    void write(std::string_view bytes);  // throws std::runtime_error; the file then ends with the last whole record
    std::string summary_group(const std::vector<std::string>& records, std::uint8_t op, std::string& offsets);

    std::string path_, compression_;  // "": none
    Descriptor fd_;
    std::uint64_t offset_ = 0, messages_ = 0;
    std::uint64_t begin_ns_ = 0, end_ns_ = 0;  // times of the first and the last message
    std::vector<Named> schemas_, channels_;
    std::string chunk_;
    std::uint64_t chunk_begin_ns_ = 0, chunk_end_ns_ = 0;
    std::vector<std::string> chunk_indices_, attachment_indices_;
};

}  // namespace tactiled::mcap
