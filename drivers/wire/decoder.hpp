// Bytes -> Frame, whatever the wire format: pure, no I/O, bounded, so that it can be fuzzed and replayed.
#pragma once
#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include "drivers/driver.hpp"
#include "drivers/frame.hpp"

namespace tactiled {

// A stream of bytes in which frames stand one after the other. What comes out does not depend on how the bytes were cut
// into chunks. A format derives from it and says, byte by byte, when a frame is complete.
class StreamDecoder {
public:
    static constexpr std::size_t kMaxBytes = 4096;  // of one push; a kernel's tty buffer

    explicit StreamDecoder(LinkCounts& counts) : counts_(counts) {}
    virtual ~StreamDecoder() = default;

    // Takes bytes of which the last one arrived at `t_ns`, and none before `since_ns`; every earlier one must have been
    // used: next() has returned false. rt: wait-free
    void push(std::span<const std::uint8_t> bytes, std::uint64_t t_ns, std::uint64_t since_ns) noexcept {
        assert(at_ == size_ && bytes.size() <= kMaxBytes);
        std::memcpy(bytes_.data(), bytes.data(), bytes.size());
        at_ = 0;
        size_ = bytes.size();
        since_ns_ = std::min(t_ns, std::max(since_ns, t_ns_));
        t_ns_ = t_ns;
        counts_[TACTILED_LINK_BYTES] += std::uint32_t(bytes.size());
    }

    void push(std::span<const std::uint8_t> bytes, std::uint64_t t_ns) noexcept { push(bytes, t_ns, t_ns); }

    // The next complete frame. Its stamp is when its last byte arrived, as if those of a push had come evenly: several
    // frames that waited together are as far apart as they were sent, and the newest one has the time of the push. rt:
    // wait-free
    [[nodiscard]] bool next(Frame& frame) noexcept {
        if (!is_ready()) return false;
        frame = ahead_;
        ready_ = false;
        return true;
    }

    // True when next() will give a frame. rt: wait-free
    [[nodiscard]] bool is_ready() noexcept {
        while (!ready_ && at_ < size_) ready_ = take(bytes_[at_++], ahead_);
        if (ready_ && ahead_.t_ns == 0) {
            ahead_.t_ns = t_ns_ - (t_ns_ - since_ns_) / size_ * (size_ - at_);
            ahead_.taken_ns = t_ns_;
            ++counts_[TACTILED_LINK_FRAMES];
        }
        return ready_;
    }

    // Forgets the stream: the device was opened anew. The first frame may be a partial one and is then dropped quietly.
    virtual void reset() noexcept {
        at_ = size_ = 0;
        ready_ = false;
    }

    // Text for the user: the proof of age that the frames carry on a path that may delay them, and a change that the user
    // should make ("" = none). setup
    [[nodiscard]] virtual std::string freshness() const { return "arrival (no clock and no counter: a delay is not seen)"; }
    [[nodiscard]] virtual std::string advice() const { return ""; }

    // Bytes that a device must be sent to begin and to end its stream; empty for one that sends by itself. rt: wait-free
    [[nodiscard]] virtual std::span<const std::uint8_t> start_bytes() const noexcept { return {}; }
    [[nodiscard]] virtual std::span<const std::uint8_t> stop_bytes() const noexcept { return {}; }

protected:
    // Uses one byte; true when it completed `frame` (stamp and counting are the base's). rt: wait-free
    [[nodiscard]] virtual bool take(std::uint8_t byte, Frame& frame) noexcept = 0;

    LinkCounts& counts_;

private:
    std::array<std::uint8_t, kMaxBytes> bytes_{};
    std::size_t at_ = 0, size_ = 0;
    std::uint64_t t_ns_ = 0, since_ns_ = 0;
    Frame ahead_;
    bool ready_ = false;
};

}  // namespace tactiled
