#include "drivers/mcap/message_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/mcap/format.hpp"

namespace tactiled::mcap {
namespace {

// Skips other records (attachments, indices, the summary).
bool is_wanted(char op) {
    return Op(op) == Op::schema || Op(op) == Op::channel || Op(op) == Op::chunk || Op(op) == Op::data_end;
}

}  // namespace

std::string MessageFile::open(const std::string& path) {
    close();
    // O_NONBLOCK: does not wait for a writer if the path is a pipe
    fd_.reset(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    struct stat about {};
    if (fd_ < 0 || ::fstat(fd_, &about) != 0) return fmt::format("{}: {}", path, std::strerror(errno));
    if (!S_ISREG(about.st_mode)) return fmt::format("{}: is no file", path);
    size_ = std::uint64_t(about.st_size);
    record_.resize(std::size_t(std::clamp<std::uint64_t>(size_, kMagic.size() + kRecordHead, kMaxRecord)));
    have_ = want_ = at_ = bytes_read_ = 0;
    too_long_ = 0;
    at_end_ = read(record_.data(), kMagic.size()) == 0;
    const bool is_mcap = !at_end_ && record_.starts_with(kMagic);
    at_end_ = !is_mcap;
    reader_.emplace(is_mcap ? kMagic : std::string_view());
    return "";
}

void MessageFile::declare_all() {
    constexpr std::uint64_t kFooter = kRecordHead + 8 + 8 + 4, kEnd = kFooter + kMagic.size();
    constexpr std::uint64_t kMaxDeclared = 1u << 20;  // bytes of the summary in which declarations are expected
    std::array<char, kEnd> end{};
    std::uint64_t summary_at = 0;
    if (size_ > kEnd && ::pread(fd_, end.data(), kEnd, off_t(size_ - kEnd)) == ssize_t(kEnd) && Op(end[0]) == Op::footer &&
        std::string_view(&end[kFooter], kMagic.size()) == kMagic)
        std::memcpy(&summary_at, &end[kRecordHead], sizeof summary_at);
    if (summary_at != 0 && summary_at < size_ - kEnd) {
        std::string declared(std::size_t(std::min(kMaxDeclared, size_ - kEnd - summary_at)), 0);
        if (::pread(fd_, declared.data(), declared.size(), off_t(summary_at)) == ssize_t(declared.size()))
            reader_->declare(declared);
    }
    reader_->freeze();
}

void MessageFile::close() noexcept {
    fd_.reset();
    at_end_ = true;
}

std::optional<Message> MessageFile::next(std::uint64_t max_bytes) {
    if (!reader_) return std::nullopt;
    for (const std::uint64_t began = bytes_read_;;) {
        if (const auto message = reader_->next()) return message;
        if (at_end_ || bytes_read_ - began >= max_bytes) return std::nullopt;
        if (read_piece()) reader_->feed(std::string_view(record_).substr(0, std::size_t(std::exchange(want_, 0))));
    }
}

bool MessageFile::read_piece() noexcept {
    if (want_ == 0) read_head();
    if (at_end_) return false;
    const bool wanted = is_wanted(record_[0]), fits = want_ <= record_.size();
    if (have_ < want_) {
        // Skipped bytes overwrite each other behind the record's head.
        const std::uint64_t room =
            fits ? want_ - have_ : std::min<std::uint64_t>(want_ - have_, record_.size() - kRecordHead);
        const std::size_t got = read(record_.data() + (fits ? have_ : kRecordHead), room);
        at_end_ = got == 0;
        have_ += got;
    }
    if (at_end_ || have_ < want_) return false;
    if (wanted && fits) {
        at_end_ = Op(record_[0]) == Op::data_end;
        return true;
    }
    if (wanted) ++too_long_;
    want_ = 0;
    return false;
}

void MessageFile::read_head() noexcept {
    std::uint64_t content = 0;
    at_end_ = read(record_.data(), kRecordHead) != kRecordHead;
    if (at_end_) return;
    std::memcpy(&content, record_.data() + 1, sizeof content);
    at_end_ = content > size_ || at_ > size_ - content;  // the file is truncated
    have_ = kRecordHead;
    want_ = kRecordHead + content;
}

std::size_t MessageFile::read(char* to, std::uint64_t size) noexcept {
    ssize_t got = -1;
    do got = ::read(fd_, to, std::min<std::size_t>(size, kMaxPiece));
    while (got < 0 && errno == EINTR);
    if (got <= 0) return 0;
    at_ += std::uint64_t(got);
    bytes_read_ += std::uint64_t(got);
    return std::size_t(got);
}

std::string MessageFile::why() const {
    std::string why = reader_ ? reader_->why() : "";
    if (too_long_ != 0)
        why += fmt::format("{}{} chunks of more than {} MiB left out", why.empty() ? "" : ", ", too_long_, kMaxRecord >> 20);
    return why;
}

std::vector<std::pair<std::string, std::string>> attached_files(const std::string& path) {
    constexpr std::uint64_t kMaxAttachment = 32u << 20;  // the limit of a calibration is 16 MiB
    std::vector<std::pair<std::string, std::string>> files;
    const Descriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    std::string record(kRecordHead, 0);
    for (std::uint64_t at = kMagic.size(); fd >= 0;) {
        record.resize(kRecordHead);
        if (::pread(fd, record.data(), kRecordHead, off_t(at)) != ssize_t(kRecordHead)) break;
        std::uint64_t size = 0;
        std::memcpy(&size, &record[1], sizeof size);
        const Op op = Op(record[0]);
        if (op != Op::header && op != Op::schema && op != Op::channel && op != Op::attachment) break;
        if (size > kMaxAttachment) break;
        if (op == Op::attachment) {
            record.resize(kRecordHead + std::size_t(size));
            if (::pread(fd, &record[kRecordHead], std::size_t(size), off_t(at + kRecordHead)) != ssize_t(size)) break;
            const std::string whole = std::string(kMagic) + record;
            Reader reader(whole);
            while (reader.next()) {}
            for (const auto& each : reader.attachments()) files.emplace_back(each.name, each.data);
        }
        at += kRecordHead + size;
    }
    return files;
}

}  // namespace tactiled::mcap
