#include "drivers/wire/isotp.hpp"

#include <algorithm>
#include <utility>

namespace tactiled {
namespace {

enum Kind : std::uint8_t { kSingle = 0, kFirst = 1, kConsecutive = 2, kFlowControl = 3 };  // ISO 15765-2:2016, table 9
constexpr std::uint8_t kSendAll = 0x30, kOverflow = 0x32, kPadding = 0xCC;
constexpr std::size_t kClassic = 8;

}  // namespace

IsoTp::Found IsoTp::take(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept {
    if (frame.empty()) return Found::bad;
    switch (frame[0] >> 4) {
        case kSingle: return single(frame, t_ns);
        case kFirst: return begin(frame, t_ns);
        case kConsecutive: return go_on(frame, t_ns);
        case kFlowControl: return Found::nothing;  // sent by another node that the device talks to
        default: return Found::bad;
    }
}

IsoTp::Found IsoTp::single(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept {
    // Messages above 8 bytes have a separate length byte: 9.6.2.
    const bool is_long = frame.size() > kClassic;
    const std::size_t head = is_long ? 2 : 1, length = is_long ? frame[1] : frame[0] & 0x0F;
    if (length == 0 || head + length > frame.size() || (is_long && (frame[0] & 0x0F) != 0)) return Found::bad;
    drop();
    std::copy_n(frame.begin() + std::ptrdiff_t(head), length, bytes_.begin());
    wanted_ = length;
    began_ns_ = t_ns;
    return Found::message;
}

IsoTp::Found IsoTp::begin(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept {
    if (frame.size() < kClassic) return Found::bad;
    const std::size_t length = std::size_t(frame[0] & 0x0F) << 8 | frame[1];
    if (length <= frame.size() - 2) return Found::bad;  // it would have fitted one frame; 0: longer than 4095
    drop();
    wanted_ = length;
    if (length > kMaxBytes) {
        ++lost_;
        return Found::first;
    }
    size_ = frame.size() - 2;
    std::copy(frame.begin() + 2, frame.end(), bytes_.begin());
    under_way_ = true;
    next_ = 1;
    began_ns_ = last_ns_ = t_ns;
    return Found::first;
}

IsoTp::Found IsoTp::go_on(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept {
    if (under_way_ && t_ns > last_ns_ + kPatience_ns) drop();
    if (!under_way_) return Found::nothing;  // a part of a message that is lost already, or that began earlier
    const std::size_t taken = std::min(frame.size() - 1, wanted_ - size_);
    const bool is_last = size_ + taken == wanted_;
    if ((frame[0] & 0x0F) != next_ || taken == 0 || (!is_last && frame.size() < kClassic)) {
        drop();
        return Found::nothing;
    }
    std::copy_n(frame.begin() + 1, taken, bytes_.begin() + std::ptrdiff_t(size_));
    size_ += taken;
    next_ = std::uint8_t((next_ + 1) & 0x0F);
    last_ns_ = t_ns;
    if (!is_last) return Found::nothing;
    under_way_ = false;
    return Found::message;
}

std::array<std::uint8_t, 8> IsoTp::answer() const noexcept {
    std::array<std::uint8_t, 8> flow;
    flow.fill(kPadding);
    flow[0] = under_way_ ? kSendAll : kOverflow;
    flow[1] = flow[2] = 0;  // any number of frames, no pause between them
    return flow;
}

void IsoTp::drop() noexcept { lost_ += std::exchange(under_way_, false) ? 1 : 0; }

std::uint32_t IsoTp::take_lost() noexcept { return std::exchange(lost_, 0); }

void IsoTp::reset() noexcept {
    under_way_ = false;
    lost_ = 0;
}

}  // namespace tactiled
