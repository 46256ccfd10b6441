// Converts bytes to frames, for any wire format. Pure: no I/O and bounded, so that it can be fuzzed and replayed.
#pragma once
#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>

#include "drivers/driver.hpp"
#include "drivers/frame.hpp"

namespace tactiled {

// A stream of bytes with consecutive frames. The result does not depend on how the bytes were cut into chunks.
class StreamDecoder {
public:
    static constexpr std::size_t kMaxBytes = 4096;  // bytes of one push; size of a kernel's tty buffer

    explicit StreamDecoder(LinkCounts& counts) : counts_(counts) {}
    virtual ~StreamDecoder() = default;

    // Takes bytes; the last one arrived at `t_ns`, and none before `since_ns`. All earlier bytes must have been used:
    // next() has returned false. rt: wait-free
    void push(std::span<const std::uint8_t> bytes, std::uint64_t t_ns, std::uint64_t since_ns) noexcept {
        assert(at_ == size_ && bytes.size() <= kMaxBytes);
        std::memcpy(bytes_.data(), bytes.data(), bytes.size());
        at_ = 0;
        size_ = bytes.size();
        earliest_ns_ = std::min(t_ns, since_ns);
        since_ns_ = std::max(earliest_ns_, std::min(t_ns, t_ns_));
        t_ns_ = t_ns;
        counts_[TACTILED_LINK_BYTES] += std::uint32_t(bytes.size());
    }

    void push(std::span<const std::uint8_t> bytes, std::uint64_t t_ns) noexcept { push(bytes, t_ns, t_ns); }

    // Returns the next complete frame. Its timestamp is the arrival of its last byte, with the bytes of a push spread
    // evenly: several frames that waited together keep their distances, and the newest one has the time of the push.
    // rt: wait-free
    [[nodiscard]] bool next(Frame& frame) noexcept {
        if (!is_ready()) return false;
        frame = ahead_;
        ready_ = false;
        return true;
    }

    // True if next() will return a frame. rt: wait-free
    [[nodiscard]] bool is_ready() noexcept {
        while (!ready_ && at_ < size_) at_ += take({bytes_.data() + at_, size_ - at_}, ahead_, ready_);
        if (ready_ && ahead_.t_ns == 0) {
            ahead_.t_ns = t_ns_ - (t_ns_ - since_ns_) / size_ * (size_ - at_);
            ahead_.taken_ns = t_ns_;
            ++counts_[TACTILED_LINK_FRAMES];
        }
        return ready_;
    }

    // Forgets the stream, after the device was opened again. The first frame may be a partial one, which is dropped
    // without being counted.
    virtual void reset() noexcept {
        at_ = size_ = 0;
        ready_ = false;
        echo_ = {};
    }

    // Text for the user: the proof of age that the frames carry on a path that may delay them, and a recommended
    // change of the format ("" = none). setup
    [[nodiscard]] virtual std::string freshness() const {
        return "arrival (no clock and no counter: a delay is not detected)";
    }
    [[nodiscard]] virtual std::string advice() const { return ""; }

    // An answer of the device to a request for an echo: the number of the request, and the device's time. Frames of this
    // device that come after it were measured after the request.
    struct Echo {
        std::uint32_t number = 0, time_us = 0;
        std::uint16_t device = 0;
    };
    // True if the format has such answers. setup
    [[nodiscard]] virtual bool has_echo() const noexcept { return false; }
    // Returns the last answer once; number 0 = none. rt: wait-free
    [[nodiscard]] Echo take_echo() noexcept { return std::exchange(echo_, {}); }

    // The shape of the arrays of this stream, and the taxels of the last frame that next() returned; valid until the next
    // call of next() or is_ready(). rt: wait-free
    [[nodiscard]] virtual TaxelShape taxel_shape() const noexcept { return {}; }
    [[nodiscard]] virtual Taxels taxels() const noexcept { return {}; }

    // Bytes that start and stop the stream of a device; empty if the device sends by itself. rt: wait-free
    [[nodiscard]] virtual std::span<const std::uint8_t> start_bytes() const noexcept { return {}; }
    [[nodiscard]] virtual std::span<const std::uint8_t> stop_bytes() const noexcept { return {}; }

protected:
    // The times of the bytes of the last push(): the last one came at `t_ns`, and none before `since_ns`.
    struct Arrival {
        std::uint64_t since_ns = 0, t_ns = 0;
    };
    [[nodiscard]] Arrival arrival() const noexcept { return {earliest_ns_, t_ns_}; }

    // Uses bytes from the beginning of `bytes`, at least one, and none after the end of a frame. Returns their number, and
    // sets `is_complete` if they completed `frame`; the base class sets the timestamp and counts. A format whose frames may
    // come in several pushes sets since_ns and slice_ns, see Frame. rt: wait-free
    [[nodiscard]] virtual std::size_t take(std::span<const std::uint8_t> bytes, Frame& frame,
                                           bool& is_complete) noexcept = 0;

    LinkCounts& counts_;
    Echo echo_;

private:
    std::array<std::uint8_t, kMaxBytes> bytes_{};
    std::size_t at_ = 0, size_ = 0;
    std::uint64_t t_ns_ = 0;
    std::uint64_t since_ns_ = 0;     // not before the push before, to spread the times of its frames
    std::uint64_t earliest_ns_ = 0;  // the earliest arrival that push() was told
    Frame ahead_;
    bool ready_ = false;
};

// A format that decides for each byte whether a frame is complete.
class ByteDecoder : public StreamDecoder {
public:
    using StreamDecoder::StreamDecoder;

protected:
    // Uses one byte. Returns true if it completed `frame`. rt: wait-free
    [[nodiscard]] virtual bool take(std::uint8_t byte, Frame& frame) noexcept = 0;

private:
    [[nodiscard]] std::size_t take(std::span<const std::uint8_t> bytes, Frame& frame, bool& is_complete) noexcept final {
        std::size_t used = 0;
        while (!is_complete && used < bytes.size()) is_complete = take(bytes[used++], frame);
        return used;
    }
};

}  // namespace tactiled
