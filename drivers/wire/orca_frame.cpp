// Serial format "orca": the tactile pads of the ORCA hand (PaXini), 363 taxels at 921600 baud, after two writes that
// request the stream. Numbers are little-endian.
//
//     write    55 AA 00 10 address(2) length(2) data LRC          0x0016: type, 2 = taxels; 0x0017: 1 = on
//     frame    AA 56 00 length(2) error taxels LRC                length counts error and taxels
//     taxel    i8 Fx, i8 Fy, u8 Fz, in 0.1 N; thumb 51, three fingers 87 each, little finger 51
//
// The LRC is the two's complement of the sum of all bytes before it. Pads that are not connected send no taxels. The facts
// are those of a public client of the maker (orca_core, MIT); none was tried on a device, the meaning of the error byte is
// unknown, and so is whether the device takes two writes without a pause.
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <vector>

#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr std::uint16_t kHandTaxels = 51 + 3 * 87 + 51, kValues = 3;
constexpr std::size_t kHead = 5, kError = kHead, kData = kHead + 1, kLrc = 1;

std::uint8_t lrc_of(std::span<const std::uint8_t> bytes) noexcept {
    unsigned sum = 0;
    for (const std::uint8_t byte : bytes) sum += byte;
    return std::uint8_t(0u - sum);
}

void append_write(std::vector<std::uint8_t>& bytes, std::uint16_t address, std::uint8_t value) {
    std::vector<std::uint8_t> write{0x55, 0xAA, 0,    0x10, std::uint8_t(address & 0xFF), std::uint8_t(address >> 8),
                                    1,    0,    value};
    write.push_back(lrc_of(write));
    bytes.insert(bytes.end(), write.begin(), write.end());
}

// The limits of the range are saturated, except an Fz of 0: no load.
float value_of(std::uint8_t byte, bool is_signed) noexcept {
    constexpr float kInfinite = std::numeric_limits<float>::infinity();
    if (!is_signed) return byte == UINT8_MAX ? kInfinite : float(byte);
    const auto number = std::int8_t(byte);
    return number == INT8_MAX ? kInfinite : number == INT8_MIN ? -kInfinite : float(number);
}

class OrcaDecoder final : public StreamDecoder {
public:
    OrcaDecoder(std::uint16_t taxels, LinkCounts& counts)
        : StreamDecoder(counts), shape_{taxels, kValues}, bytes_(kData + shape_.size() + kLrc), values_(shape_.size()) {
        const std::size_t length = 1 + shape_.size();
        head_ = {0xAA, 0x56, 0, std::uint8_t(length & 0xFF), std::uint8_t(length >> 8)};
        append_write(start_, 0x0016, 2);
        append_write(start_, 0x0017, 1);
        append_write(stop_, 0x0017, 0);
    }
    void reset() noexcept override {
        StreamDecoder::reset();
        size_ = 0;
    }
    std::span<const std::uint8_t> start_bytes() const noexcept override { return start_; }
    std::span<const std::uint8_t> stop_bytes() const noexcept override { return stop_; }
    TaxelShape taxel_shape() const noexcept override { return shape_; }
    Taxels taxels() const noexcept override { return {shape_, values_}; }

private:
    std::size_t take(std::span<const std::uint8_t> bytes, Frame& frame, bool& is_complete) noexcept override {
        if (size_ == 0) began_ = arrival();
        const std::size_t n = std::min(bytes.size(), bytes_.size() - size_);
        std::memcpy(bytes_.data() + size_, bytes.data(), n);
        size_ += n;
        drop_until_head(0);
        if (size_ < bytes_.size()) return n;
        if (lrc_of({bytes_.data(), size_ - kLrc}) != bytes_[size_ - kLrc]) {
            ++counts_[TACTILED_LINK_BAD_CHECKSUM];
            drop_until_head(1);  // the next frame may begin inside
            return n;
        }
        read_frame(frame);
        size_ = 0;
        is_complete = true;
        return n;
    }

    // Drops `from` bytes, and then those before the next one at which a frame may begin.
    void drop_until_head(std::size_t from) noexcept {
        std::size_t at = from;
        while (at < size_ && !is_head(at)) ++at;
        if (at == 0) return;
        size_ -= at;
        std::memmove(bytes_.data(), bytes_.data() + at, size_);
        counts_[TACTILED_LINK_SKIPPED] += std::uint32_t(at);
    }

    bool is_head(std::size_t at) noexcept {
        const std::size_t n = std::min(head_.size(), size_ - at);
        if (std::memcmp(bytes_.data() + at, head_.data(), n) == 0) return true;
        const bool is_other_length = n == head_.size() && std::memcmp(bytes_.data() + at, head_.data(), 3) == 0;
        counts_[TACTILED_LINK_BAD_LENGTH] += is_other_length ? 1 : 0;  // another set of pads, or another type
        return false;
    }

    void read_frame(Frame& frame) noexcept {
        frame = Frame{};
        if (began_.t_ns < arrival().t_ns) {
            frame.since_ns = began_.since_ns;
            frame.slice_ns = arrival().t_ns - began_.t_ns;
        }
        if (bytes_[kError] != 0) return std::fill(values_.begin(), values_.end(), std::numeric_limits<float>::quiet_NaN());
        for (std::size_t v = 0; v < kValues; ++v)
            for (std::size_t i = 0; i < shape_.taxels; ++i)
                values_[v * shape_.taxels + i] = value_of(bytes_[kData + kValues * i + v], v < 2);
    }

    TaxelShape shape_;
    std::array<std::uint8_t, kHead> head_{};
    std::vector<std::uint8_t> start_, stop_;
    std::vector<std::uint8_t> bytes_;  // bytes of one frame
    std::size_t size_ = 0;
    Arrival began_;  // time of the first one
    std::vector<float> values_;
};

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    const auto taxels = std::uint16_t(options.integer("taxels", {1, kHandTaxels}, kHandTaxels));
    return std::make_unique<OrcaDecoder>(taxels, counts);
}

const StreamFormat entry{.name = "orca", .on_tcp = false, .make = make};

}  // namespace
}  // namespace tactiled
