#include "drivers/mcap/writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "drivers/mcap/compression.hpp"
#include "drivers/mcap/format.hpp"

namespace tactiled::mcap {
namespace {

template <class T>
void put(std::string& out, T value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
}
void put_text(std::string& out, std::string_view text) {
    put(out, std::uint32_t(text.size()));
    out += text;
}
// Writes a list of entries after its length in bytes.
void put_list(std::string& out, const std::string& entries) { put_text(out, entries); }

std::string record(Op op, std::string_view content) {
    std::string out(1, char(op));
    put(out, std::uint64_t(content.size()));
    return out.append(content);
}

}  // namespace

Writer::Writer(const std::string& path, bool overwrite, const std::string& compression)
    : path_(path), compression_(compression == "none" ? "" : compression) {
    if (!is_known_compression(compression_))
        throw SetupError(fmt::format("compression \"{}\": this program was built without its library", compression));
    if (overwrite) ::unlink(path.c_str());  // not O_TRUNC: a reader of the old file can continue
    fd_.reset(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_EXCL, 0644));
    if (fd_ < 0)
        throw SetupError(fmt::format("{}: {}{}", path, std::strerror(errno),
                                     errno == EEXIST ? " (--overwrite replaces it, another name keeps it)" : ""));
    std::string header;
    put_text(header, "ros2");  // the profile that defines "cdr"
    put_text(header, "tactiled " TACTILED_VERSION);
    write(std::string(kMagic) + record(Op::header, header));
}

std::uint16_t Writer::add_schema(const std::string& name, const std::string& encoding, const std::string& data) {
    std::string content;
    put(content, std::uint16_t(schemas_.size() + 1));  // 0 means none
    put_text(content, name);
    put_text(content, encoding);
    put_text(content, data);
    schemas_.push_back({record(Op::schema, content), 0, {}});
    write(schemas_.back().record);
    return std::uint16_t(schemas_.size());
}

std::uint16_t Writer::add_channel(std::uint16_t schema, const std::string& topic, const std::string& message_encoding,
                                  const std::map<std::string, std::string>& metadata) {
    std::string content, entries;
    put(content, std::uint16_t(channels_.size()));
    put(content, schema);
    put_text(content, topic);
    put_text(content, message_encoding);
    for (const auto& [key, value] : metadata) {
        put_text(entries, key);
        put_text(entries, value);
    }
    put_list(content, entries);
    channels_.push_back({record(Op::channel, content), 0, {}});
    write(channels_.back().record);
    return std::uint16_t(channels_.size() - 1);
}

void Writer::attach(const std::string& name, const std::string& media_type, std::string_view data, std::uint64_t now_ns) {
    std::string content;
    put(content, now_ns);
    put(content, now_ns);
    put_text(content, name);
    put_text(content, media_type);
    put(content, std::uint64_t(data.size()));
    content += data;
    put(content, crc32(content));
    const std::string whole = record(Op::attachment, content);
    std::string index;
    put(index, offset_);
    put(index, std::uint64_t(whole.size()));
    put(index, now_ns);
    put(index, now_ns);
    put(index, std::uint64_t(data.size()));
    put_text(index, name);
    put_text(index, media_type);
    write(whole);
    attachment_indices_.push_back(record(Op::attachment_index, index));
}

void Writer::message(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time_ns, std::string_view data) {
    if (messages_++ == 0) begin_ns_ = end_ns_ = time_ns;
    if (chunk_.empty()) chunk_begin_ns_ = chunk_end_ns_ = time_ns;
    for (std::uint64_t* min : {&begin_ns_, &chunk_begin_ns_}) *min = std::min(*min, time_ns);
    for (std::uint64_t* max : {&end_ns_, &chunk_end_ns_}) *max = std::max(*max, time_ns);
    channels_[channel].index.emplace_back(time_ns, chunk_.size());
    ++channels_[channel].messages;
    chunk_ += char(Op::message);
    put(chunk_, std::uint64_t(2 + 4 + 8 + 8 + data.size()));
    put(chunk_, channel);
    put(chunk_, sequence);
    put(chunk_, time_ns);
    put(chunk_, time_ns);
    chunk_ += data;
    if (chunk_.size() >= kMaxPending) flush();
}

void Writer::flush() {
    if (chunk_.empty()) return;
    std::string content;
    put(content, chunk_begin_ns_);
    put(content, chunk_end_ns_);
    put(content, std::uint64_t(chunk_.size()));
    put(content, crc32(chunk_));
    put_text(content, compression_);
    const std::string packed = compression_.empty() ? chunk_ : compress(compression_, chunk_);
    put(content, std::uint64_t(packed.size()));
    content += packed;
    const std::string chunk = record(Op::chunk, content);

    std::string indices, offsets;  // for the messages in the chunk
    for (std::size_t c = 0; c < channels_.size(); ++c) {
        auto& index = channels_[c].index;
        if (index.empty()) continue;
        std::sort(index.begin(), index.end());
        std::string entries, one;
        for (const auto& [time_ns, offset] : index) {
            put(entries, time_ns);
            put(entries, offset);
        }
        put(one, std::uint16_t(c));
        put_list(one, entries);
        put(offsets, std::uint16_t(c));
        put(offsets, offset_ + chunk.size() + indices.size());
        indices += record(Op::message_index, one);
    }
    std::string index;
    put(index, chunk_begin_ns_);
    put(index, chunk_end_ns_);
    put(index, offset_);
    put(index, std::uint64_t(chunk.size()));
    put_list(index, offsets);
    put(index, std::uint64_t(indices.size()));
    put_text(index, compression_);
    put(index, std::uint64_t(packed.size()));
    put(index, std::uint64_t(chunk_.size()));
    write(chunk + indices);
    chunk_indices_.push_back(record(Op::chunk_index, index));
    for (Named& channel : channels_) channel.index.clear();
    chunk_.clear();
}

std::string Writer::summary_group(const std::vector<std::string>& records, std::uint8_t op, std::string& offsets) {
    std::string group;
    for (const auto& each : records) group += each;
    if (!group.empty()) {
        std::string content(1, char(op));
        put(content, offset_);
        put(content, std::uint64_t(group.size()));
        offsets += record(Op::summary_offset, content);
    }
    return group;
}

void Writer::close() {
    flush();
    std::string end;
    put(end, std::uint32_t(0));  // 0: no CRC, because each chunk has its own
    write(record(Op::data_end, end));

    std::string statistics, counts;
    put(statistics, messages_);
    put(statistics, std::uint16_t(schemas_.size()));
    put(statistics, std::uint32_t(channels_.size()));
    put(statistics, std::uint32_t(attachment_indices_.size()));
    put(statistics, std::uint32_t(0));
    put(statistics, std::uint32_t(chunk_indices_.size()));
    put(statistics, begin_ns_);
    put(statistics, end_ns_);
    for (std::size_t c = 0; c < channels_.size(); ++c) {
        put(counts, std::uint16_t(c));
        put(counts, channels_[c].messages);
    }
    put_list(statistics, counts);

    const std::uint64_t summary_at = offset_;
    const auto records_of = [](const std::vector<Named>& all) {
        std::vector<std::string> records;
        for (const Named& each : all) records.push_back(each.record);
        return records;
    };
    std::string summary, offsets;
    for (const auto& [op, records] :
         {std::pair{Op::schema, records_of(schemas_)}, std::pair{Op::channel, records_of(channels_)},
          std::pair{Op::statistics, std::vector{record(Op::statistics, statistics)}},
          std::pair{Op::chunk_index, chunk_indices_}, std::pair{Op::attachment_index, attachment_indices_}}) {
        const std::string group = summary_group(records, std::uint8_t(op), offsets);
        summary += group;
        write(group);
    }
    const std::uint64_t offsets_at = offset_;
    write(offsets);
    std::string footer(1, char(Op::footer));
    put(footer, std::uint64_t(8 + 8 + 4));
    put(footer, summary_at);
    put(footer, offsets_at);
    put(footer, crc32(summary + offsets + footer));
    write(footer + std::string(kMagic));
    const bool is_stored = ::fsync(fd_) == 0;
    if (::close(fd_.release()) != 0 || !is_stored)
        throw std::runtime_error(fmt::format("{}: {}", path_, std::strerror(errno)));
}

void Writer::write(std::string_view bytes) {
    std::size_t done = 0;
    while (done < bytes.size()) {
        const ssize_t size = ::write(fd_, bytes.data() + done, bytes.size() - done);
        if (size < 0 && errno == EINTR) continue;
        if (size <= 0) {
            const int error = size < 0 ? errno : ENOSPC;
            [[maybe_unused]] const int cut = ::ftruncate(fd_, off_t(offset_));  // leaves no partial record
            throw std::runtime_error(fmt::format("{}: {}; recorded so far: {} bytes", path_, std::strerror(error), offset_));
        }
        done += std::size_t(size);
    }
    offset_ += bytes.size();
}

}  // namespace tactiled::mcap
