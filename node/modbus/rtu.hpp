// Modbus RTU on a tty (Modbus over Serial Line 1.02, 2.5). Length and checksum determine the end of a request, which
// is answered after 3.5 characters of silence; a longer silence ends all other data, which are dropped.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "config/config.hpp"
#include "drivers/descriptor.hpp"
#include "node/modbus/connection.hpp"

namespace tactiled::modbus {

// Returns true if `frame` has the length of a frame and a correct checksum.
[[nodiscard]] bool is_rtu_frame(std::span<const std::uint8_t> frame) noexcept;
// Returns true if `bytes` are a whole request: a frame of the length that its function code and byte count state.
[[nodiscard]] bool is_whole_request(std::span<const std::uint8_t> bytes) noexcept;
// Returns true if `frame` has the form of the answer to `request` (both whole frames) rather than that of another
// request of the same length. The data of a read are not compared.
[[nodiscard]] bool is_answer_to(std::span<const std::uint8_t> request, std::span<const std::uint8_t> frame) noexcept;

class RtuLine {
public:
    explicit RtuLine(const RtuSettings& settings);

    // Returns the descriptor to watch for input; -1 while the device is missing. tick() opens it again.
    [[nodiscard]] int fd() const noexcept { return fd_; }
    // Returns the time at which tick() must be called.
    [[nodiscard]] std::uint64_t due_ns() const noexcept {
        return fd_ < 0 ? open_again_ns_ : silent_since_ns_ ? frame_ends_ns() : 0;
    }

    // Receives bytes. Returns false if the device was disconnected: it is then closed.
    [[nodiscard]] bool receive(std::uint64_t now_ns);
    // Opens the device when that is due. Ends the frame after enough silence and has it answered.
    void tick(const Answer& answer, std::uint64_t now_ns);

    Session session;
    Responder responder{ModbusWire::rtu};  // has the descriptor
    struct Counts {
        std::uint64_t frames = 0, bad_frames = 0, for_others = 0, broadcasts = 0, echoes = 0;
    };
    [[nodiscard]] const Counts& counts() const noexcept { return counts_; }

private:
    void open(std::uint64_t now_ns);
    void take_frame(const Answer& answer, std::uint64_t now_ns);
    [[nodiscard]] std::uint64_t frame_ends_ns() const noexcept {
        return silent_since_ns_ + (is_whole_ ? silence_ns_ : pieces_ns_);
    }

    RtuSettings settings_;
    std::uint64_t silence_ns_;  // t3.5, between a request and its answer
    std::uint64_t pieces_ns_;   // between the pieces in which an adapter delivers a frame, at most
    Descriptor fd_;
    std::uint64_t open_again_ns_ = 0;
    std::uint64_t silent_since_ns_ = 0;  // 0: no frame waits for its end
    std::array<std::uint8_t, kMaxRtu> frame_{};
    std::size_t received_ = 0;
    bool too_long_ = false, is_whole_ = false;
    // The last answered request, until its answer can no longer come back: the echo of an adapter must not be
    // answered.
    std::array<std::uint8_t, kMaxRtu> answered_{};
    std::size_t answered_size_ = 0, sent_size_ = 0;
    std::uint64_t echo_until_ns_ = 0;
    std::string complaint_;
    Counts counts_;
};

}  // namespace tactiled::modbus
