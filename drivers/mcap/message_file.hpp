// Reads the messages of a recording from the disk, in their order. Only one chunk is in memory.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/descriptor.hpp"
#include "drivers/mcap/reader.hpp"

namespace tactiled::mcap {

class MessageFile {
public:
    // longer chunks are skipped; writers make chunks of 0.8 to 8 MiB
    static constexpr std::uint64_t kMaxRecord = 10u << 20;
    static constexpr std::size_t kMaxPiece = 64u << 10;  // per read

    // Opens the file. Returns "" or the fault; the first message is then next. The cost does not depend on the file's
    // length. setup
    [[nodiscard]] std::string open(const std::string& path);
    // Declares the channels of the file's summary, if there is one, in addition to those seen so far; the first
    // chunks may be anywhere in the file. No channel is new from now on, so that next() does not allocate. setup
    void declare_all();
    void close() noexcept;

    // Returns the next message, valid until the next call; nullopt at_end(), or if `max_bytes` were read without a whole
    // message. The file is read and not mapped, because truncating a mapped file would end the process.
    // rt: blocks on the disk; bounded by `max_bytes` and a chunk. May throw std::bad_alloc before declare_all(), never after
    std::optional<Message> next(std::uint64_t max_bytes = UINT64_MAX);
    // True at the end of the file, or of its intact part.
    [[nodiscard]] bool at_end() const { return at_end_; }

    [[nodiscard]] std::uint64_t bytes_read() const { return bytes_read_; }
    [[nodiscard]] std::uint64_t memory_bytes() const { return record_.capacity(); }
    [[nodiscard]] unsigned too_long() const { return too_long_; }
    [[nodiscard]] const Reader& reader() const { return *reader_; }
    // Returns "" or a description of the skipped parts, as Reader::why().
    [[nodiscard]] std::string why() const;

private:
    // Continues to read the present record, by one piece at most. Returns true if a record with messages or
    // declarations is complete.
    bool read_piece() noexcept;
    void read_head() noexcept;
    std::size_t read(char* to, std::uint64_t size) noexcept;  // 0: the file ends before

    Descriptor fd_;
    std::uint64_t size_ = 0, bytes_read_ = 0;
    std::uint64_t have_ = 0, want_ = 0;  // bytes of the present record; want_ = 0: its head is next
    std::uint64_t at_ = 0;               // position in the file
    bool at_end_ = true;
    unsigned too_long_ = 0;
    std::string record_;
    std::optional<Reader> reader_;
};

// Returns the files that are attached to a recording before its messages, by name; empty if there are none or none
// can be read. setup
[[nodiscard]] std::vector<std::pair<std::string, std::string>> attached_files(const std::string& path);

}  // namespace tactiled::mcap
