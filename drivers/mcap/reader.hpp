// Reads the messages of an MCAP file in the order of the file. Pure: it has bytes as input and no I/O;
// message_file.hpp reads from the disk. It needs no index, so that a truncated file is read up to its last whole
// chunk. Chunks of an unknown compression are counted.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/mcap/compression.hpp"

namespace tactiled::mcap {

struct Channel {
    std::string topic, schema, message_encoding;
    std::map<std::string, std::string> metadata;
};

struct Message {
    const Channel* channel = nullptr;  // valid as long as the Reader exists
    std::uint32_t sequence = 0;
    std::uint64_t time_ns = 0;
    std::span<const char> data;  // points into the input
};

class Reader {
public:
    // size of a decompressed chunk; writers make chunks of 0.8 to 8 MiB
    static constexpr std::uint64_t kMaxPlain = 10u << 20;

    // `bytes` are the whole file and must outlive the Reader. A file that is not MCAP gives no message: see why().
    explicit Reader(std::string_view bytes);

    // Adds the next part of a file that is read in pieces, for a Reader that was constructed with the magic alone.
    // `records` are whole records that follow the ones that next() has read. They must outlive the messages in them.
    // attachments() is then undefined.
    // rt: a channel that is new allocates; see freeze()
    void feed(std::string_view records);
    // Adds schemas and channels that are declared elsewhere, such as in the summary; known ones stay. setup
    void declare(std::string_view records);
    // Declares that no channel is new from now on: messages of a new channel count as records that do not fit.
    // Compressed chunks are read only if one was read before.
    void freeze() { frozen_ = true; }

    // Returns the next message; nullopt at the end of the file, or of its readable part: see why().
    std::optional<Message> next();

    // Returns "" or the fault of the file: no MCAP, truncated, compressed chunks, chunks with a wrong CRC.
    [[nodiscard]] std::string why() const;
    // Numbers of parts skipped so far, by kind.
    [[nodiscard]] unsigned bad_crc() const { return bad_crc_; }
    [[nodiscard]] unsigned unreadable() const { return compressed_ + damaged_; }
    // The channels declared so far, by number.
    [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const { return channels_; }
    struct Attachment {
        std::string name;
        std::string_view data;
    };
    [[nodiscard]] const std::vector<Attachment>& attachments() const { return attachments_; }

private:
    struct Record {
        std::uint8_t op;
        std::string_view content;
    };
    static std::optional<Record> take_record(std::string_view bytes, std::size_t& at);
    void take_named(const Record& record);
    void enter_chunk(std::string_view content);
    // Returns the records of a compressed chunk; nullopt if that is not possible.
    std::optional<std::string_view> decompressed(std::string_view kind, std::string_view records, std::uint64_t size);
    void take_attachment(std::string_view content);

    std::string_view bytes_;
    bool is_mcap_ = false;
    std::size_t at_ = 0;
    std::string_view chunk_;
    std::size_t chunk_at_ = 0;
    std::unique_ptr<Decompressor> decompressor_;  // created with the first compressed chunk
    std::unique_ptr<char[]> plain_;               // the chunk, decompressed
    std::map<std::uint16_t, std::string> schemas_;
    std::map<std::uint16_t, Channel> channels_;
    std::vector<Attachment> attachments_;
    bool ended_ = false, cut_ = false, frozen_ = false;
    unsigned compressed_ = 0, bad_crc_ = 0, damaged_ = 0;
};

}  // namespace tactiled::mcap
