// Follows a device's sequence counter: gaps, repeats, restarts, and two devices that count under one name.
#pragma once
#include <algorithm>
#include <cstdint>

#include "drivers/frame.hpp"

namespace tactiled {

// A step ahead by less than half the counter's range is a gap of that many frames. A step back is a frame that was
// sent twice or overtaken: it is dropped, unless the device has restarted: its clock went back, or the frame after it
// counts on from it. A restart therefore costs no frame of a device that sends its time, and one frame of another.
//
// Whose the frames are is doubted by what one device does seldom: a number that was here already, with another content; a
// restart, which counts twice. Each takes kDoubt frames in order to forget. Five that are not forgotten are a second device
// under the same name; nobody knows then whose a number is, until at most seven times kDoubt frames in a row come in order.
// A second device that sends at least each 20th frame is told before 20 of its readings have passed for the first one's; one
// that sends less than each 32nd may not be (sequence_tracker_test).
class SequenceTracker {
public:
    static constexpr unsigned kDoubt = 32, kContested = 5 * kDoubt, kMax = 7 * kDoubt;
    static constexpr unsigned kOvertaken = 4;   // frames in order that one is worth that comes late
    static constexpr unsigned kJudgedBits = 8;  // of a shorter counter a few lost frames are as good as a second device

    struct Verdict {
        bool accept;
        bool contested;      // two devices count here
        std::uint32_t lost;  // frames missing right before this one; 0 where two count
    };

    // `bits`: width of the counter. `content`: of the frame, the same for the same bytes; a frame that was sent twice is no
    // second device's. rt: wait-free
    Verdict next(std::uint32_t sequence, unsigned bits, std::uint32_t content, bool clock_went_back) noexcept {
        judged_ = bits >= kJudgedBits;
        const std::uint32_t mask = bits >= 32 ? ~0u : (1u << bits) - 1;
        const std::uint32_t step = (sequence - last_ - 1) & mask;  // 0: the one that follows
        const bool behind = step > mask / 2;
        const bool counts_on = behind && dropped_ && ((sequence - last_dropped_ - 1) & mask) == 0;
        const std::uint32_t back = (last_ - sequence) & mask;
        if (started_ && behind && !counts_on && is_overtaken(back)) {  // its clock went back, too
            doubt(kOvertaken);
            return {false, contested_, 0};
        }
        const bool restart = !started_ || (clock_went_back && step != 0) || counts_on;
        if (behind && !restart) {
            // More of what was dropped just before is the same doubt: a restart whose second frame is lost.
            const bool more = dropped_ && ((sequence - last_dropped_ - 1) & mask) <= mask / 2;
            if (!more && (back != 0 || content != content_)) doubt(kDoubt);
            dropped_ = true;
            last_dropped_ = sequence;
            return {false, contested_, 0};
        }
        if (!restart)
            trust();
        else if (started_)
            doubt(counts_on ? kDoubt : 2 * kDoubt);  // the frame before was dropped, and doubted, where it counts on
        seen_ = std::uint8_t(restart ? 0xFFu : step >= 8 ? 0u : unsigned{seen_} << (step + 1) | 1u << step);
        started_ = true;
        dropped_ = false;
        last_ = sequence;
        content_ = content;
        return {true, contested_, restart || contested_ ? 0 : step};
    }
    // Something came that cannot be of the device of the rest. rt: wait-free
    void suspect() noexcept { doubt(kDoubt); }
    void reset() noexcept { *this = {}; }

private:
    // One of the last eight, that was missing. It is not any more.
    bool is_overtaken(std::uint32_t back) noexcept {
        if (back == 0 || back > 8 || (seen_ >> (back - 1) & 1u) != 0) return false;
        seen_ = std::uint8_t(seen_ | 1u << (back - 1));
        return true;
    }
    void doubt(unsigned frames) noexcept {
        if (!judged_) return;
        doubt_ = std::min(doubt_ + frames, kMax);
        contested_ = contested_ || doubt_ >= kContested;
    }
    void trust() noexcept {
        doubt_ -= doubt_ == 0 ? 0 : 1;
        contested_ = contested_ && doubt_ != 0;
    }

    std::uint32_t last_ = 0, last_dropped_ = 0, content_ = 0;
    std::uint8_t seen_ = 0xFF;  // bit n: number last_ - 1 - n was here, or is of another life
    bool started_ = false, dropped_ = false, contested_ = false, judged_ = true;
    unsigned doubt_ = 0;  // frames in order until there is none
};

// The width of a counter of which the format states none: one that goes from 255 or 65535 to 0 has 8 or 16 bits, until it
// counts further.
class CounterWidth {
public:
    // rt: wait-free
    [[nodiscard]] unsigned of(std::uint32_t sequence) noexcept {
        if (bits_ < 32 && sequence >> bits_ != 0) bits_ = 32;
        if (sequence == 0 && (last_ == 0xFF || last_ == 0xFFFF)) bits_ = last_ == 0xFF ? 8 : 16;
        last_ = sequence;
        return bits_;
    }

private:
    unsigned bits_ = 32;
    std::uint32_t last_ = 0;
};

// An accepted frame gets its number, and loses its n_channels, which are set by then, where two devices count: nobody knows
// whose they are. rt: wait-free
inline void put_number(Frame& frame, std::uint32_t sequence, unsigned bits,
                       const SequenceTracker::Verdict& verdict) noexcept {
    frame.sequence = sequence;
    frame.sequence_bits = std::uint8_t(bits);
    frame.has_sequence = true;
    if (verdict.contested) frame.n_channels = 0;
}

}  // namespace tactiled
