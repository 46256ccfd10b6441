#include "drivers/mcap/reader.hpp"

#include <fmt/format.h>

#include <cstring>

#include "drivers/mcap/format.hpp"

namespace tactiled::mcap {
namespace {

// Reads numbers and texts in sequence; failed() is true once one of them ended too early.
class Fields {
public:
    explicit Fields(std::string_view bytes) : bytes_(bytes) {}
    template <class T>
    T number() {
        T value{};
        const std::string_view raw = take(sizeof value);
        if (!failed_) std::memcpy(&value, raw.data(), sizeof value);
        return value;
    }
    std::string_view text() { return take(number<std::uint32_t>()); }
    std::string_view long_text() { return take(number<std::uint64_t>()); }
    std::string_view take(std::uint64_t size) {
        if (failed_ || size > bytes_.size() - at_) {
            failed_ = true;
            return {};
        }
        at_ += std::size_t(size);
        return bytes_.substr(at_ - std::size_t(size), std::size_t(size));
    }
    [[nodiscard]] std::size_t at() const { return at_; }
    [[nodiscard]] bool more() const { return !failed_ && at_ < bytes_.size(); }
    [[nodiscard]] bool failed() const { return failed_; }

private:
    std::string_view bytes_;
    std::size_t at_ = 0;
    bool failed_ = false;
};

}  // namespace

Reader::Reader(std::string_view bytes)
    : bytes_(bytes), is_mcap_(bytes.substr(0, kMagic.size()) == kMagic), at_(is_mcap_ ? kMagic.size() : bytes.size()) {}

void Reader::feed(std::string_view records) {
    bytes_ = records;
    at_ = 0;
    cut_ = false;
}

void Reader::declare(std::string_view records) {
    for (std::size_t at = 0; const auto record = take_record(records, at);) take_named(*record);
}

std::optional<Reader::Record> Reader::take_record(std::string_view bytes, std::size_t& at) {
    Fields head(bytes.substr(at));
    const auto op = head.number<std::uint8_t>();
    const std::string_view content = head.long_text();
    if (head.failed()) return std::nullopt;
    at += head.at();
    return Record{op, content};
}

std::optional<Message> Reader::next() {
    for (;;) {
        while (chunk_at_ < chunk_.size()) {
            const auto record = take_record(chunk_, chunk_at_);
            if (!record) {  // the CRC was right, so the writer wrote a damaged record
                ++damaged_;
                chunk_at_ = chunk_.size();
                break;
            }
            if (Op(record->op) != Op::message) {
                take_named(*record);
                continue;
            }
            Fields fields(record->content);
            Message message;
            const auto channel = channels_.find(fields.number<std::uint16_t>());
            message.sequence = fields.number<std::uint32_t>();
            message.time_ns = fields.number<std::uint64_t>();
            (void)fields.number<std::uint64_t>();  // publish_time
            if (fields.failed() || channel == channels_.end()) {
                ++damaged_;
                continue;
            }
            message.channel = &channel->second;
            message.data = {record->content.data() + fields.at(), record->content.size() - fields.at()};
            return message;
        }
        if (ended_ || at_ >= bytes_.size()) {
            cut_ = cut_ || (is_mcap_ && !ended_);
            return std::nullopt;
        }
        const auto record = take_record(bytes_, at_);
        if (!record) {
            cut_ = true;
            at_ = bytes_.size();
            return std::nullopt;
        }
        switch (Op(record->op)) {
            case Op::data_end: ended_ = true; break;  // the summary that follows repeats known records
            case Op::chunk: enter_chunk(record->content); break;
            case Op::attachment: take_attachment(record->content); break;
            default: take_named(*record);
        }
    }
}

void Reader::take_named(const Record& record) {
    if (frozen_) return;
    Fields fields(record.content);
    if (Op(record.op) == Op::schema) {
        const auto id = fields.number<std::uint16_t>();
        const std::string_view name = fields.text();
        if (!fields.failed()) schemas_[id] = name;
    } else if (Op(record.op) == Op::channel) {
        const auto id = fields.number<std::uint16_t>();
        if (channels_.contains(id)) return;  // the first channel of a number stays, because messages point to it
        const auto schema = schemas_.find(fields.number<std::uint16_t>());
        Channel channel;
        channel.topic = fields.text();
        channel.message_encoding = fields.text();
        if (schema != schemas_.end()) channel.schema = schema->second;
        Fields entries(fields.text());
        while (entries.more()) {
            const std::string key(entries.text());
            channel.metadata[key] = entries.text();
        }
        if (!fields.failed() && !entries.failed()) channels_.try_emplace(id, channel);
    }
}

void Reader::enter_chunk(std::string_view content) {
    Fields fields(content);
    fields.take(8 + 8);
    const auto size = fields.number<std::uint64_t>();
    const auto crc = fields.number<std::uint32_t>();
    const std::string_view compression = fields.text();
    std::string_view records = fields.long_text();
    if (fields.failed()) {
        ++damaged_;
        return;
    }
    if (!compression.empty()) {
        const auto plain = decompressed(compression, records, size);
        if (!plain) return;
        records = *plain;
    }
    if (crc != 0 && crc32(records) != crc) {  // 0: the writer computed none
        ++bad_crc_;
    } else {
        chunk_ = records;
        chunk_at_ = 0;
    }
}

std::optional<std::string_view> Reader::decompressed(std::string_view kind, std::string_view records, std::uint64_t size) {
    if (!is_known_compression(kind) || size > kMaxPlain || (frozen_ && plain_ == nullptr)) {
        ++compressed_;
        return std::nullopt;
    }
    if (plain_ == nullptr) {
        plain_.reset(new char[kMaxPlain]);
        decompressor_ = std::make_unique<Decompressor>();
    }
    if (decompressor_->run(kind, records, plain_.get(), std::size_t(size)))
        return std::string_view(plain_.get(), std::size_t(size));
    ++damaged_;
    return std::nullopt;
}

void Reader::take_attachment(std::string_view content) {
    Fields fields(content);
    fields.take(8 + 8);
    const std::string_view name = fields.text();
    fields.text();
    const std::string_view data = fields.long_text();
    const std::size_t guarded = fields.at();
    const auto crc = fields.number<std::uint32_t>();
    if (fields.failed())
        ++damaged_;
    else if (crc != 0 && crc32(content.substr(0, guarded)) != crc)
        ++bad_crc_;
    else
        attachments_.push_back({std::string(name), data});
}

std::string Reader::why() const {
    if (!is_mcap_) return "is no MCAP file";
    std::string why;
    const auto say = [&](unsigned count, const char* what) {
        if (count != 0) why += fmt::format("{}{} {}", why.empty() ? "" : ", ", count, what);
    };
    say(compressed_, "chunks of a compression or size that this reader does not know (mcap compress --compression none)");
    say(bad_crc_, "parts with a wrong CRC left out");
    say(damaged_, "records that do not fit");
    if (cut_) why += why.empty() ? "was cut: its end is missing" : ", and its end is missing";
    return why;
}

}  // namespace tactiled::mcap
