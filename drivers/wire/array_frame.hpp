// Arrays of taxels: messages with a CRC-32, each a piece of a frame or an answer to a request for an echo. array_frame.md
// defines them. Pure: no I/O, and no allocation after construction.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "config/options.hpp"
#include "drivers/taxels.hpp"
#include "drivers/wire/decoder.hpp"
#include "drivers/wire/sequence_tracker.hpp"

namespace tactiled {

inline constexpr std::size_t kArrayMaxDevices = 16;
inline constexpr std::size_t kArrayHeader = 20;        // bytes before the bitmap or the numbers
inline constexpr std::size_t kArrayMaxPiece = 65'000;  // bytes, including the CRC

// The kinds of numbers of a piece, as they are sent.
enum class ArrayType : std::uint8_t { i8, u8, i16, u16, i32, f32 };

struct ArrayPiece {
    std::uint8_t device = 0;  // 0 .. 15
    ArrayType type = ArrayType::f32;
    std::uint32_t sequence = 0;
    std::optional<std::uint32_t> time_us = {};  // the device's clock
    TaxelShape shape = {};
    std::uint16_t first = 0, count = 0;  // the taxels of this piece
};

// Keys `taxels` and `values` of a [[link]]. Without `taxels` the shape is empty, or an error if `is_required`. setup
[[nodiscard]] TaxelShape read_taxel_shape(Options& options, bool is_required);

// Returns the largest number of bytes of a message of a link with this shape.
[[nodiscard]] std::size_t max_array_bytes(TaxelShape shape) noexcept;

// True if a message that begins with this byte is one of an array. rt: wait-free
[[nodiscard]] bool is_array_message(std::uint8_t format) noexcept;

// Puts the frames of up to 16 devices together. A frame is complete when all its taxels have come, in any order. A piece of
// a newer frame drops an incomplete one, which the next complete frame counts as lost. Pieces of one of the last eight
// frames, and pieces that came before, are `repeated`. Whole frames show restarts and a second device under one number by
// the rules of SequenceTracker.
class ArrayAssembler {
public:
    // When a message arrived, CLOCK_MONOTONIC: its first byte not before since_ns and before first_ns, its last one at t_ns.
    struct Arrival {
        std::uint64_t since_ns = 0, first_ns = 0, t_ns = 0;
    };
    enum class Taken {
        used,     // a piece, an answer, or a piece that was counted as repeated
        frame,    // the message completed `frame`
        refused,  // fault() has the reason, which the caller counts
    };

    // Allocates the buffers. setup
    ArrayAssembler(TaxelShape shape, LinkCounts& counts);
    void reset() noexcept;

    // Takes a message with its CRC. The caller sets t_ns and taken_ns of `frame`. If its pieces did not come at
    // one time, since_ns is the arrival of the first one and slice_ns the time until the last one: the measurement is
    // at least that old. rt: bounded by the length of the message
    [[nodiscard]] Taken take(std::span<const std::uint8_t> message, const Arrival& arrival, Frame& frame) noexcept;
    [[nodiscard]] tactiled_link_count fault() const noexcept { return fault_; }

    // Returns an answer once; number 0 = none. An answer that comes within a frame is returned with the next frame of its
    // device, which was measured after it. rt: wait-free
    [[nodiscard]] StreamDecoder::Echo take_echo() noexcept { return std::exchange(echo_, {}); }

    // Returns the arrival of the first piece of the frame that began last, 0 if it is complete. rt: wait-free
    [[nodiscard]] std::uint64_t open_since_ns() const noexcept { return open_ == nullptr ? 0 : open_->first.first_ns; }

    [[nodiscard]] TaxelShape shape() const noexcept { return shape_; }
    // The taxels of the last frame; none if two devices use its number. Valid until the next take(). rt: wait-free
    [[nodiscard]] Taxels taxels() const noexcept;

private:
    struct Device {
        SequenceTracker tracker;
        std::uint64_t time_us = 0;  // extended across the wraps of the 32 bits that are sent
        bool has_clock = false;     // time_us is that of the last frame
        // The frame of which pieces come, or the last one.
        bool has_begun = false;
        std::size_t left = 0;       // taxels that have not come; 0 = no frame is open
        std::uint32_t content = 0;  // sum of the CRCs
        ArrayPiece piece;           // the first one
        Arrival first;              // the first piece's
        std::vector<std::uint8_t> has;
        std::vector<float> value;
    };

    [[nodiscard]] Taken refuse(tactiled_link_count fault) noexcept;
    [[nodiscard]] Taken take_echo_answer(std::span<const std::uint8_t> message) noexcept;
    [[nodiscard]] Taken take_piece(std::span<const std::uint8_t> message, std::uint32_t crc, const Arrival& arrival,
                                   Frame& frame) noexcept;
    [[nodiscard]] bool begin(Device& device, const ArrayPiece& piece, const Arrival& arrival) noexcept;
    [[nodiscard]] bool complete(Device& device, const Arrival& arrival, Frame& frame) noexcept;

    TaxelShape shape_;
    LinkCounts& counts_;
    std::array<Device, kArrayMaxDevices> devices_;
    const Device* last_ = nullptr;  // device of the last frame; nullptr: none, or contested
    const Device* open_ = nullptr;  // device of the frame that began last; nullptr: it is complete
    tactiled_link_count fault_ = TACTILED_LINK_BAD_LENGTH;
    StreamDecoder::Echo echo_, later_;  // later_: its device's open frame may have been measured before
};

// Writes a message as a device sends it. `value` is the whole frame in the layout of Taxels: NaN is missing, and infinite
// numbers and those beyond the type's range are its limits. For tests and tools. setup: may allocate
[[nodiscard]] std::vector<std::uint8_t> encode_array_piece(const ArrayPiece& piece, std::span<const float> value);
[[nodiscard]] std::vector<std::uint8_t> encode_array_echo(std::uint8_t device, std::uint32_t number, std::uint32_t time_us);

}  // namespace tactiled
