// Follows a device's sequence counter: gaps, repeats, restarts, and two devices that count under one name.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tactiled {

// A step ahead by less than half the counter's range is a gap of that many frames. A step back is a frame that was
// sent twice or overtaken: it is dropped, unless the device has restarted: its clock went back, or the frame after it
// counts on from it. So a restart costs no frame of a device that sends its time, and one frame of another.
//
// One restart, or another frame of a number that was here, is a disturbance. More than one in kOrderly frames are a second
// device under the same name; nobody knows then whose a number is, until at most kMostDoubt frames in a row have come in
// order.
class SequenceTracker {
public:
    static constexpr unsigned kOrderly = 32, kContested = 4 * kOrderly, kMostDoubt = 6 * kOrderly;

    struct Verdict {
        bool accept;
        bool contested;      // two devices count here
        std::uint32_t lost;  // frames missing right before this one
    };

    // `bits`: width of the counter. `content`: of the frame, the same for the same bytes; a frame that was sent twice is no
    // second device's. rt: wait-free
    Verdict next(std::uint32_t sequence, unsigned bits, std::uint32_t content, bool clock_went_back) noexcept {
        const std::uint32_t mask = bits >= 32 ? ~0u : (1u << bits) - 1;
        const std::uint32_t step = (sequence - last_ - 1) & mask;  // 0: the one that follows
        const bool behind = step > mask / 2;
        const bool counts_on = behind && dropped_ && ((sequence - last_dropped_ - 1) & mask) == 0;
        const bool restart = !started_ || clock_went_back || counts_on;
        if (behind && !restart) {
            const std::uint32_t back = (last_ - sequence) & mask;
            if (is_overtaken(back)) return {false, contested_, 0};
            if (back != 0 || content != content_) suspect();
            dropped_ = true;
            last_dropped_ = sequence;
            return {false, contested_, 0};
        }
        if (!restart)
            trust();
        else if (started_)
            suspect();
        seen_ = restart ? 0xFF : step >= 8 ? 0 : std::uint8_t(seen_ << (step + 1) | 1u << step);
        started_ = true;
        dropped_ = false;
        last_ = sequence;
        content_ = content;
        return {true, contested_, restart || contested_ ? 0 : step};
    }
    // A part of a sample came that cannot be of the device of the others. rt: wait-free
    void suspect() noexcept {
        doubt_ = std::min(doubt_ + kOrderly, kMostDoubt);
        contested_ = contested_ || doubt_ >= kContested;
    }
    void reset() noexcept { *this = {}; }

private:
    // One of the last eight, that was missing. It is not any more.
    bool is_overtaken(std::uint32_t back) noexcept {
        if (back == 0 || back > 8 || (seen_ >> (back - 1) & 1u) != 0) return false;
        seen_ = std::uint8_t(seen_ | 1u << (back - 1));
        return true;
    }
    void trust() noexcept {
        doubt_ -= doubt_ == 0 ? 0 : 1;
        contested_ = contested_ && doubt_ != 0;
    }

    std::uint32_t last_ = 0, last_dropped_ = 0, content_ = 0;
    std::uint8_t seen_ = 0xFF;  // bit n: number last_ - 1 - n was here, or is of another life
    bool started_ = false, dropped_ = false, contested_ = false;
    unsigned doubt_ = 0;  // frames in order until there is none
};

}  // namespace tactiled
