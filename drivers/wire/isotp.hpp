// The receiver of messages longer than a CAN frame, ISO 15765-2 (ISO-TP). Converts frames to messages, pure. A
// message is complete or is not delivered.
#pragma once
#include <array>
#include <cstdint>
#include <span>

namespace tactiled {

class IsoTp {
public:
    // limit of a message here; the standard's field allows 4095
    static constexpr std::size_t kMaxBytes = 512;
    static constexpr std::uint64_t kPatience_ns = 1'000'000'000;  // N_Cr: between two frames of a message

    enum class Found : std::uint8_t {
        nothing,
        message,  // message() is complete
        first,    // first of several frames: send answer() to receive the others
        bad       // not a frame of the protocol
    };
    // Takes a frame that arrived at `t_ns`. rt: bounded by 64 bytes
    Found take(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept;

    // The message, valid until the next take(). rt: wait-free
    [[nodiscard]] std::span<const std::uint8_t> message() const noexcept { return {bytes_.data(), wanted_}; }
    // Arrival of the message's first frame: a later time would make the numbers look newer. rt: wait-free
    [[nodiscard]] std::uint64_t t_ns() const noexcept { return began_ns_; }
    // A flow control frame: send all frames without pauses; or, for a message that does not fit here, send none.
    // rt: wait-free
    [[nodiscard]] std::array<std::uint8_t, 8> answer() const noexcept;

    // Returns the number of messages since the last call that began and did not end. A message whose beginning was
    // missed is not counted. rt: wait-free
    [[nodiscard]] std::uint32_t take_lost() noexcept;
    // Resets the state after the bus was opened again. rt: wait-free
    void reset() noexcept;

private:
    Found begin(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept;
    Found go_on(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept;
    Found single(std::span<const std::uint8_t> frame, std::uint64_t t_ns) noexcept;
    void drop() noexcept;

    std::array<std::uint8_t, kMaxBytes> bytes_{};
    std::size_t wanted_ = 0, size_ = 0;
    bool under_way_ = false;
    std::uint8_t next_ = 0;  // number of the next frame, 4 bits
    std::uint64_t began_ns_ = 0, last_ns_ = 0;
    std::uint32_t lost_ = 0;
};

}  // namespace tactiled
