#include "decoupling/text_lines.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "config/options.hpp"
#include "decoupling/file_format.hpp"
#include "decoupling/npy.hpp"

namespace tactiled {
namespace {

constexpr std::size_t kLongestLine_bytes = 1u << 20;
constexpr std::size_t kChunk_bytes = 1u << 16;

class FileBytes : public Bytes {
public:
    explicit FileBytes(const std::string& path, const std::string& name)
        : name_(name), fd_(path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
        if (fd_ < 0) throw SetupError(fmt::format("{}: {}", name_, std::strerror(errno)));
    }
    FileBytes(const FileBytes&) = delete;
    FileBytes& operator=(const FileBytes&) = delete;
    ~FileBytes() override {
        if (fd_ != STDIN_FILENO) ::close(fd_);
    }
    bool read(std::string& buffer) override {
        const std::size_t before = buffer.size();
        buffer.resize(before + kChunk_bytes);
        ssize_t n;
        do n = ::read(fd_, buffer.data() + before, kChunk_bytes);
        while (n < 0 && errno == EINTR);
        buffer.resize(before + std::size_t(std::max<ssize_t>(n, 0)));
        if (n < 0) throw SetupError(fmt::format("{}: {}", name_, std::strerror(errno)));
        return n > 0;
    }

private:
    std::string name_;
    int fd_;
};

// RFC 1952, with several members one after the other.
class GzipBytes : public Bytes {
public:
    GzipBytes(std::unique_ptr<Bytes> packed, std::string first, std::string name)
        : packed_(std::move(packed)), in_(std::move(first)), name_(std::move(name)) {
        constexpr int kGzip = 16;
        if (inflateInit2(&stream_, MAX_WBITS + kGzip) != Z_OK) throw SetupError(name_ + ": zlib does not start");
    }
    GzipBytes(const GzipBytes&) = delete;
    GzipBytes& operator=(const GzipBytes&) = delete;
    ~GzipBytes() override { inflateEnd(&stream_); }
    bool read(std::string& buffer) override {
        const std::size_t before = buffer.size();
        while (buffer.size() == before) {
            if (stream_.avail_in == 0 && !more()) {
                if (!at_end_of_member_) throw SetupError(name_ + ": the gzip file is cut off; copy it again");
                return false;
            }
            if (at_end_of_member_) inflateReset(&stream_);
            buffer.resize(before + kChunk_bytes);
            stream_.next_out = reinterpret_cast<Bytef*>(buffer.data() + before);
            stream_.avail_out = uInt(kChunk_bytes);
            const int result = inflate(&stream_, Z_SYNC_FLUSH);
            buffer.resize(before + kChunk_bytes - stream_.avail_out);
            at_end_of_member_ = result == Z_STREAM_END;
            if (result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR)
                throw SetupError(name_ + ": the gzip file is damaged; copy it again");
        }
        return true;
    }

private:
    bool more() {
        if (!is_first_) {
            in_.clear();
            if (!packed_->read(in_)) return false;
        }
        is_first_ = false;
        stream_.next_in = reinterpret_cast<Bytef*>(in_.data());
        stream_.avail_in = uInt(in_.size());
        return true;
    }

    std::unique_ptr<Bytes> packed_;
    std::string in_, name_;
    z_stream stream_{};
    bool is_first_ = true, at_end_of_member_ = false;
};

void append_utf8(std::string& text, std::uint32_t code) {
    if (code < 0x80) {
        text += char(code);
    } else if (code < 0x800) {
        text += char(0xC0 | (code >> 6));
        text += char(0x80 | (code & 0x3F));
    } else if (code < 0x10000) {
        text += char(0xE0 | (code >> 12));
        text += char(0x80 | ((code >> 6) & 0x3F));
        text += char(0x80 | (code & 0x3F));
    } else {
        text += char(0xF0 | (code >> 18));
        text += char(0x80 | ((code >> 12) & 0x3F));
        text += char(0x80 | ((code >> 6) & 0x3F));
        text += char(0x80 | (code & 0x3F));
    }
}

// The forms of RFC 3629, without its tests of overlong forms and surrogates: TOML refuses these.
bool is_utf8(std::string_view text) {
    for (std::size_t i = 0; i < text.size();) {
        const auto c = static_cast<unsigned char>(text[i]);
        const std::size_t n = c < 0x80                ? 1
                              : c >= 0xC2 && c < 0xE0 ? 2
                              : c >= 0xE0 && c < 0xF0 ? 3
                              : c >= 0xF0 && c < 0xF5 ? 4
                                                      : 0;
        if (n == 0 || i + n > text.size()) return false;
        for (std::size_t k = 1; k < n; ++k)
            if ((static_cast<unsigned char>(text[i + k]) & 0xC0) != 0x80) return false;
        i += n;
    }
    return true;
}

std::string from_latin(std::string_view text) {
    std::string result;
    for (const char c : text) append_utf8(result, static_cast<unsigned char>(c));
    return result;
}

}  // namespace

TextLines::TextLines(const std::string& path) : name_(path == "-" ? "standard input" : path) {
    bytes_ = std::make_unique<FileBytes>(path, name_);
    recognise(path);
}

// Looks at the first bytes only: a line that has come through a pipe must not wait for the next one.
void TextLines::recognise(const std::string& path) {
    const auto starts = [&](std::string_view bytes) { return std::string_view(buffer_).starts_with(bytes); };
    while (buffer_.size() < kFormatBytes && buffer_.find('\n') == buffer_.npos)
        if (!bytes_->read(buffer_)) break;
    if (starts("\x1F\x8B")) {
        is_gzip_ = true;
        bytes_ = std::make_unique<GzipBytes>(std::move(bytes_), std::exchange(buffer_, {}), name_);
        while (buffer_.size() < kFormatBytes && bytes_->read(buffer_)) {}
    }
    if (const std::string other = other_format(buffer_, path); !other.empty()) throw SetupError(name_ + ": " + other);
    if (starts("\x93NUMPY")) {
        is_npy_ = true;
        bytes_ = npy_as_text(std::move(bytes_), std::exchange(buffer_, {}), name_);
        return;
    }
    const bool has_zeros = buffer_.size() > 3 && buffer_.find('\0') != buffer_.npos;
    if (starts("\xEF\xBB\xBF")) {
        at_ = 3;
    } else if (starts("\xFF\xFE") || (has_zeros && buffer_[1] == 0 && buffer_[0] != 0)) {
        encoding_ = Encoding::utf16_le;
        at_ = starts("\xFF\xFE") ? 2 : 0;
    } else if (starts("\xFE\xFF") || (has_zeros && buffer_[0] == 0 && buffer_[1] != 0)) {
        encoding_ = Encoding::utf16_be;
        at_ = starts("\xFE\xFF") ? 2 : 0;
    }
}

std::string TextLines::about() const {
    std::string text = is_gzip_ ? "gzip" : "";
    const char* const encoding = is_npy_ ? "npy" : encoding_ != Encoding::utf8 ? "UTF-16" : is_latin_ ? "Latin-1" : "";
    if (*encoding != 0) text += (text.empty() ? "" : ", ") + std::string(encoding);
    return text;
}

// Makes `bytes` more bytes available; false if the file ends before.
bool TextLines::fill(std::size_t bytes) {
    while (buffer_.size() - at_ < bytes) {
        if (at_ > 0) buffer_.erase(0, std::exchange(at_, 0));
        if (!bytes_->read(buffer_)) return false;
    }
    return true;
}

// Returns the next byte or, in UTF-16, the next code point; -1 at the end.
int TextLines::get() {
    if (encoding_ == Encoding::utf8) return fill(1) ? static_cast<unsigned char>(buffer_[at_++]) : -1;
    const auto unit = [&] {
        const auto a = static_cast<unsigned char>(buffer_[at_]), b = static_cast<unsigned char>(buffer_[at_ + 1]);
        at_ += 2;
        return encoding_ == Encoding::utf16_le ? a | b << 8 : a << 8 | b;
    };
    if (!fill(2)) {
        if (buffer_.size() > at_) throw SetupError(name_ + ": ends in the middle of a character of UTF-16; copy it again");
        return -1;
    }
    const int first = unit();
    if (first < 0xD800 || first > 0xDBFF || !fill(2)) return first;
    return 0x10000 + ((first - 0xD800) << 10) + (unit() & 0x3FF);
}

bool TextLines::next(std::string& line) {
    line.clear();
    ++line_;
    const auto refuse = [&](const std::string& text) { throw SetupError(fmt::format("{}:{}: {}", name_, line_, text)); };
    int c;
    bool is_empty = true;
    while ((c = get()) >= 0) {
        const bool ends_the_line_before = std::exchange(after_return_, false) && c == '\n';
        if (ends_the_line_before) continue;
        is_empty = false;
        after_return_ = c == '\r';
        if (c == '\n' || c == '\r') break;
        if (c == 0) refuse("has a byte 0, which no text has; is this a CSV file?");
        if (line.size() >= kLongestLine_bytes)
            refuse(fmt::format("longer than {} bytes; is this a CSV file?", kLongestLine_bytes));
        if (encoding_ == Encoding::utf8)
            line += char(c);
        else
            append_utf8(line, std::uint32_t(c));
    }
    if (c < 0 && is_empty) {
        --line_;
        return false;
    }
    if (!is_utf8(line)) {
        is_latin_ = true;
        line = from_latin(line);
    }
    return true;
}

}  // namespace tactiled
