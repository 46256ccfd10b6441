// Reads the messages of an MCAP file in the order of the file. Pure: bytes in, no I/O; message_file.hpp reads from the disk.
// It needs no index, so that a file that was cut is read up to its last whole chunk. Chunks of an unknown compression are
// counted.
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
    const Channel* channel = nullptr;  // valid as long as the Reader
    std::uint32_t sequence = 0;
    std::uint64_t time_ns = 0;
    std::span<const char> data;  // in the bytes that were given
};

class Reader {
public:
    static constexpr std::uint64_t kMaxPlain = 10u << 20;  // of a chunk, decompressed; writers make them of 0.8 to 8 MiB

    // The whole file; must outlive the Reader. A file that is no MCAP gives no message: why().
    explicit Reader(std::string_view bytes);

    // For a file that comes in pieces, to a Reader of the magic alone: whole records that follow those which next() has used
    // up. They must outlive the messages in them. attachments() has no meaning then.
    // rt: a channel that is new allocates; see freeze()
    void feed(std::string_view records);
    // Schemas and channels that records elsewhere declare, such as the summary's; those that are known stay. setup
    void declare(std::string_view records);
    // From now on no channel is new: messages of such a one are records that do not fit. Compressed chunks are read only
    // where one has come before.
    void freeze() { frozen_ = true; }

    // The next message, nullopt at the end: of the file, or of what can be read of it: why().
    std::optional<Message> next();

    // "" or what is wrong with the file: no MCAP, cut, compressed chunks, chunks with a wrong CRC.
    [[nodiscard]] std::string why() const;
    // Parts that were left out so far, by kind.
    [[nodiscard]] unsigned bad_crc() const { return bad_crc_; }
    [[nodiscard]] unsigned unreadable() const { return compressed_ + damaged_; }
    // Those that were declared so far, by their number.
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
    // The records of a compressed chunk; nullopt where they cannot be had.
    std::optional<std::string_view> decompressed(std::string_view kind, std::string_view records, std::uint64_t size);
    void take_attachment(std::string_view content);

    std::string_view bytes_;
    bool is_mcap_ = false;
    std::size_t at_ = 0;
    std::string_view chunk_;
    std::size_t chunk_at_ = 0;
    std::unique_ptr<Decompressor> decompressor_;  // from the first compressed chunk on
    std::unique_ptr<char[]> plain_;               // the chunk, decompressed
    std::map<std::uint16_t, std::string> schemas_;
    std::map<std::uint16_t, Channel> channels_;
    std::vector<Attachment> attachments_;
    bool ended_ = false, cut_ = false, frozen_ = false;
    unsigned compressed_ = 0, bad_crc_ = 0, damaged_ = 0;
};

}  // namespace tactiled::mcap
