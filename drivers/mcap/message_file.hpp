// The messages of a recording from the disk, in their order: of a file of any length one chunk is in memory.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/mcap/reader.hpp"

namespace tactiled::mcap {

class MessageFile {
public:
    static constexpr std::uint64_t kMaxRecord = 10u << 20;  // longer chunks are left out; writers make them of 0.8 to 8 MiB
    static constexpr std::size_t kMaxPiece = 64u << 10;     // read at once

    MessageFile() = default;
    ~MessageFile() { close(); }
    MessageFile(const MessageFile&) = delete;
    MessageFile& operator=(const MessageFile&) = delete;

    // "" or what is wrong; then the first message comes next. Its work does not depend on the file's length. setup
    [[nodiscard]] std::string open(const std::string& path);
    // The channels that the file's summary names, where it has one, beside those that have come: those that come first may
    // be in any chunk. No channel is new from now on, so that next() does not allocate. setup
    void declare_all();
    void close() noexcept;

    // The next message, valid until the next call; nullopt at_end(), or once it has read `max_bytes` and there is more.
    // Read, not mapped: a file that somebody shortens while it is mapped would end the process.
    // rt: blocks on the disk; bounded by `max_bytes` and a chunk. Throws for want of memory before declare_all(), never after
    std::optional<Message> next(std::uint64_t max_bytes = UINT64_MAX);
    // There is no further message: the end of the file, or of what is whole of it.
    [[nodiscard]] bool at_end() const { return at_end_; }

    [[nodiscard]] std::uint64_t bytes_read() const { return bytes_read_; }
    [[nodiscard]] std::uint64_t memory_bytes() const { return record_.capacity(); }
    [[nodiscard]] unsigned too_long() const { return too_long_; }
    [[nodiscard]] const Reader& reader() const { return *reader_; }
    // "" or what was left out, as Reader::why().
    [[nodiscard]] std::string why() const;

private:
    // Reads on in the record that comes next, a piece at most. True when a record that holds or declares messages is whole.
    bool read_piece() noexcept;
    void read_head() noexcept;
    std::size_t read(char* to, std::uint64_t size) noexcept;  // 0: the file ends before

    int fd_ = -1;
    std::uint64_t size_ = 0, bytes_read_ = 0;
    std::uint64_t have_ = 0, want_ = 0;  // of the record that is being read; 0: its head comes next
    std::uint64_t at_ = 0;               // in the file
    bool at_end_ = true;
    unsigned too_long_ = 0;
    std::string record_;
    std::optional<Reader> reader_;
};

// The files that stand in a recording before its messages, by name. Empty where there are none, or none can be read. setup
[[nodiscard]] std::vector<std::pair<std::string, std::string>> attached_files(const std::string& path);

}  // namespace tactiled::mcap
