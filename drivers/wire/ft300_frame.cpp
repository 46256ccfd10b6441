#include "drivers/wire/ft300_frame.hpp"

#include <algorithm>
#include <cstring>

#include "drivers/wire/modbus_message.hpp"
#include "drivers/wire/stream_format.hpp"

namespace tactiled {
namespace {

constexpr std::uint8_t kHead[] = {0x20, 0x4E};
constexpr std::size_t kChecked = kFt300Bytes - 2;
constexpr double kPerUnit[] = {100, 100, 100, 1000, 1000, 1000};  // per N, per Nm

}  // namespace

Ft300Decoder::Ft300Decoder(std::uint8_t unit, LinkCounts& counts) : ByteDecoder(counts) {
    std::array<std::uint8_t, kModbusMaxRequest> request;
    encode_modbus(ModbusWire::rtu, {.unit = unit, .function = 16, .at = 410, .value = 0x0200}, request);
    std::copy_n(request.begin(), start_.size(), start_.begin());
    stop_.fill(0xFF);
}

void Ft300Decoder::reset() noexcept {
    ByteDecoder::reset();
    size_ = 0;
}

bool Ft300Decoder::take(std::uint8_t byte, Frame& frame) noexcept {
    bytes_[size_++] = byte;
    while (size_ != 0 && (bytes_[0] != kHead[0] || (size_ > 1 && bytes_[1] != kHead[1]))) drop_first();
    if (size_ < kFt300Bytes) return false;
    const std::uint16_t crc = modbus_crc({bytes_.data(), kChecked});
    if (bytes_[kChecked] != (crc & 0xFF) || bytes_[kChecked + 1] != crc >> 8) {
        ++counts_[TACTILED_LINK_BAD_CHECKSUM];
        do drop_first();  // the next frame may begin inside
        while (size_ != 0 && (bytes_[0] != kHead[0] || (size_ > 1 && bytes_[1] != kHead[1])));
        return false;
    }
    frame = Frame{};
    frame.n_channels = 6;
    for (std::size_t k = 0; k < 6; ++k) {
        const auto number = std::int16_t(bytes_[2 + 2 * k] | bytes_[3 + 2 * k] << 8);
        frame.channel[k] = number / kPerUnit[k];
        if (number == INT16_MAX || number == INT16_MIN) frame.saturated |= 1u << k;
    }
    size_ = 0;
    return true;
}

void Ft300Decoder::drop_first() noexcept {
    std::memmove(bytes_.data(), bytes_.data() + 1, --size_);
    ++counts_[TACTILED_LINK_SKIPPED];
}

namespace {

std::unique_ptr<StreamDecoder> make(Options& options, LinkCounts& counts) {
    return std::make_unique<Ft300Decoder>(std::uint8_t(options.integer("unit", {1, 247}, 9)), counts);
}

const StreamFormat entry{.name = "ft300", .on_tcp = false, .make = make};

}  // namespace
}  // namespace tactiled
