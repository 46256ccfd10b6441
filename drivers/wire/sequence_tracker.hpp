// Follows a device's sequence counter: gaps, repetitions, restarts, and two devices that use one number.
#pragma once
#include <algorithm>
#include <cstdint>

#include "drivers/frame.hpp"

namespace tactiled {

// A step ahead by less than half the counter's range is a gap of that many frames. A step back is a frame that was sent
// twice or overtaken, and is dropped, unless the device has restarted: its clock went back, or the next frame continues its
// count. A restart therefore costs no frame if the device sends its time, else one frame.
//
// Events that are rare with one device raise a doubt: a number that was used already, with another content; a restart, which
// counts twice. Each doubt is forgotten after kDoubt consecutive frames in order. Five doubts that are not forgotten
// indicate a second device with the same number; frames can then not be assigned until at most seven times kDoubt frames in
// a row are in order. A second device that sends at least each 20th frame is detected before 20 of its readings were taken
// for the first one's; a device that sends less than each 32nd may not be detected (sequence_tracker_test).
class SequenceTracker {
public:
    static constexpr unsigned kDoubt = 32, kContested = 5 * kDoubt, kMax = 7 * kDoubt;
    static constexpr unsigned kOvertaken = 4;   // weight of a late frame, in frames in order
    static constexpr unsigned kJudgedBits = 8;  // with a shorter counter, a few lost frames look like a second device

    struct Verdict {
        bool accept;
        bool contested;      // two devices use this counter
        std::uint32_t lost;  // frames missing directly before this one; 0 if contested
    };

    // Judges the next frame. `bits`: width of the counter. `content`: a value that is equal for equal bytes; a frame
    // that was sent twice does not indicate a second device. rt: wait-free
    Verdict next(std::uint32_t sequence, unsigned bits, std::uint32_t content, bool clock_went_back) noexcept {
        judged_ = bits >= kJudgedBits;
        const std::uint32_t mask = bits >= 32 ? ~0u : (1u << bits) - 1;
        const std::uint32_t step = (sequence - last_ - 1) & mask;  // 0: the next number
        const bool behind = step > mask / 2;
        const bool counts_on = behind && dropped_ && ((sequence - last_dropped_ - 1) & mask) == 0;
        const std::uint32_t back = (last_ - sequence) & mask;
        if (started_ && behind && !counts_on && is_overtaken(back)) {  // the clock of a reordered frame is behind, too
            doubt(kOvertaken);
            return {false, contested_, 0};
        }
        const bool restart = !started_ || (clock_went_back && step != 0) || counts_on;
        if (behind && !restart) {
            // A number after the dropped ones raises no further doubt: a restart whose second frame is lost.
            const bool more = dropped_ && ((sequence - last_dropped_ - 1) & mask) <= mask / 2;
            if (!more && (back != 0 || content != content_)) doubt(kDoubt);
            dropped_ = true;
            last_dropped_ = sequence;
            return {false, contested_, 0};
        }
        if (!restart)
            trust();
        else if (started_)
            doubt(counts_on ? kDoubt : 2 * kDoubt);  // if the count goes on, the dropped frame raised a doubt already
        seen_ = std::uint8_t(restart ? 0xFFu : step >= 8 ? 0u : unsigned{seen_} << (step + 1) | 1u << step);
        started_ = true;
        dropped_ = false;
        last_ = sequence;
        content_ = content;
        return {true, contested_, restart || contested_ ? 0 : step};
    }
    // Reports a frame that cannot be of the same device as the others. rt: wait-free
    void suspect() noexcept { doubt(kDoubt); }
    void reset() noexcept { *this = {}; }

private:
    // Returns true if the number is one of the last eight and was missing, and marks it as received.
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
    std::uint8_t seen_ = 0xFF;  // bit n: number last_ - 1 - n was received, or is from before a restart
    bool started_ = false, dropped_ = false, contested_ = false, judged_ = true;
    unsigned doubt_ = 0;  // frames in order until there is no doubt
};

// Estimates the width of a counter if the format states none: a counter that goes from 255 or 65535 to 0 has 8 or 16 bits,
// until it exceeds that.
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

// Sets the number of an accepted frame, whose n_channels must be set. If two devices use one counter, n_channels becomes 0,
// because the channels cannot be assigned. rt: wait-free
inline void put_number(Frame& frame, std::uint32_t sequence, unsigned bits,
                       const SequenceTracker::Verdict& verdict) noexcept {
    frame.sequence = sequence;
    frame.sequence_bits = std::uint8_t(bits);
    frame.has_sequence = true;
    if (verdict.contested) frame.n_channels = 0;
}

}  // namespace tactiled
