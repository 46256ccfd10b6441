// Modbus RTU on a tty (Modbus over Serial Line 1.02, 2.5): silence ends a frame, the checksum says whether it is one.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "config/config.hpp"
#include "node/modbus/connection.hpp"

namespace tactiled::modbus {

inline constexpr std::size_t kMaxRtu = 256;  // address, PDU, CRC: 2.5.1.1

// CRC of a frame without its last two bytes, which hold it low byte first (2.5.1.2).
std::uint16_t rtu_crc(std::span<const std::uint8_t> bytes) noexcept;

// A frame with a right checksum as a request with an MBAP header, transaction 0; 0 when it is none. `out` holds kMaxAdu.
std::size_t adu_of_rtu(std::span<const std::uint8_t> frame, std::span<std::uint8_t, kMaxAdu> out) noexcept;
// An answer with an MBAP header as a frame with its checksum.
std::size_t rtu_of_adu(std::span<const std::uint8_t> adu, std::span<std::uint8_t, kMaxRtu> out) noexcept;

class RtuLine {
public:
    explicit RtuLine(const RtuSettings& settings);
    ~RtuLine() { close(); }
    RtuLine(const RtuLine&) = delete;
    RtuLine& operator=(const RtuLine&) = delete;

    // The descriptor to watch for input; -1 while the device is not there. tick() opens it again.
    [[nodiscard]] int fd() const noexcept { return fd_; }
    // When tick() wants to be called.
    [[nodiscard]] std::uint64_t due_ns() const noexcept {
        return fd_ < 0 ? open_again_ns_ : silent_since_ns_ ? frame_ends_ns() : 0;
    }

    // Takes what has come. False when the device is gone: it is closed then.
    [[nodiscard]] bool receive(std::uint64_t now_ns);
    // Opens the device when that is due; ends the frame when the line was silent for long enough, and answers it.
    void tick(const Answer& answer, std::uint64_t now_ns);

    Session session;
    struct Counts {
        std::uint64_t frames = 0, bad_frames = 0, for_others = 0, broadcasts = 0, echoes = 0;
    };
    [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

private:
    void open(std::uint64_t now_ns);
    void close() noexcept;
    void take_frame(const Answer& answer, std::uint64_t now_ns);
    [[nodiscard]] bool is_echo(std::uint64_t now_ns) noexcept;
    [[nodiscard]] std::uint64_t frame_ends_ns() const noexcept { return silent_since_ns_ + silence_ns_; }

    RtuSettings settings_;
    std::uint64_t silence_ns_;  // t3.5
    int fd_ = -1;
    std::uint64_t open_again_ns_ = 0;
    std::uint64_t silent_since_ns_ = 0;  // 0: nothing is waiting for its end
    std::array<std::uint8_t, kMaxRtu> frame_{};
    std::size_t received_ = 0;
    bool too_long_ = false;
    // What we sent last, until it cannot come back any more: an adapter that hears itself must not make us answer ourselves.
    std::array<std::uint8_t, kMaxRtu> sent_{};
    std::size_t sent_size_ = 0;
    std::uint64_t echo_until_ns_ = 0;
    std::string complaint_;
    Counts counts_;
};

}  // namespace tactiled::modbus
