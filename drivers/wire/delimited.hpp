// The common part of COBS frames and lines of text: each ends with a byte that does not occur elsewhere in it.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/wire/decoder.hpp"

namespace tactiled {

template <std::uint8_t kEnd, std::size_t kMax>
class DelimitedDecoder : public StreamDecoder {
public:
    // `max`: bytes between two ends. setup
    explicit DelimitedDecoder(LinkCounts& counts, std::size_t max = kMax) : StreamDecoder(counts), bytes_(max) {}
    void reset() noexcept override {
        StreamDecoder::reset();
        length_ = 0;
        synchronised_ = false;
    }

protected:
    // Decodes the bytes between two ends. Returns true if they are `frame`. rt: wait-free
    [[nodiscard]] virtual bool finish(std::span<const std::uint8_t> bytes, Frame& frame) noexcept = 0;

    // Count bytes that give no frame, including the end. Each returns false. rt: wait-free
    bool skip() noexcept {
        counts_[TACTILED_LINK_SKIPPED] += std::uint32_t(length_ + 1);
        return false;
    }
    bool reject(tactiled_link_count kind) noexcept {
        if (synchronised_) ++counts_[kind];  // else the decoder began in the middle of a frame, which is no error
        return skip();
    }

    // The times of the push with the first byte of the present frame. rt: wait-free
    [[nodiscard]] Arrival began() const noexcept { return began_; }

    // True if an end was seen since reset(), so that the present frame is whole. rt: wait-free
    [[nodiscard]] bool is_synchronised() const noexcept { return synchronised_; }

private:
    [[nodiscard]] std::size_t take(std::span<const std::uint8_t> bytes, Frame& frame, bool& is_complete) noexcept final {
        const void* const end = std::memchr(bytes.data(), kEnd, bytes.size());
        const std::size_t n =
            end == nullptr ? bytes.size() : std::size_t(static_cast<const std::uint8_t*>(end) - bytes.data());
        if (length_ == 0) began_ = arrival();
        if (length_ < bytes_.size())
            std::memcpy(bytes_.data() + length_, bytes.data(), std::min(n, bytes_.size() - length_));
        length_ += n;
        if (end == nullptr) return n;
        is_complete = length_ > bytes_.size() ? reject(TACTILED_LINK_BAD_LENGTH) : finish({bytes_.data(), length_}, frame);
        length_ = 0;
        synchronised_ = true;
        return n + 1;
    }

    std::vector<std::uint8_t> bytes_;
    Arrival began_;
    std::size_t length_ = 0;  // bytes since the last end, including those that did not fit
    bool synchronised_ = false;
};

// Text: each line ends with "\n" or "\r\n", together at most kMax + 1 bytes.
template <std::size_t kMax>
class LineDecoder : public DelimitedDecoder<'\n', kMax> {
public:
    using DelimitedDecoder<'\n', kMax>::DelimitedDecoder;

protected:
    // Decodes a line without its end. Returns true if it is `frame`. rt: wait-free
    [[nodiscard]] virtual bool read_line(std::string_view line, Frame& frame) noexcept = 0;

private:
    [[nodiscard]] bool finish(std::span<const std::uint8_t> bytes, Frame& frame) noexcept final {
        std::string_view line(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        if (line.ends_with('\r')) line.remove_suffix(1);
        return read_line(line, frame);
    }
};

}  // namespace tactiled
