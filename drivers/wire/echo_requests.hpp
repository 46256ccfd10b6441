// The requests for a device's time, and the proof that an answer gives to the next frame. Pure: the caller passes the time.
#pragma once
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <span>
#include <utility>

#include "drivers/frame.hpp"
#include "drivers/wire/decoder.hpp"

namespace tactiled {

class EchoRequests {
public:
    // The link was opened: no answer comes to a request before that. rt: wait-free
    void open() noexcept {
        answered_ = {};
        number_ += number_ % 2;
        asked_ns_ = 0;
    }

    // Returns the line to send now; empty if no request is due. One request at a time. `frame_ns`: time of the opening or of
    // the last frame. The result is valid until the next call. rt: wait-free
    [[nodiscard]] std::span<const std::uint8_t> request(std::uint64_t now, std::uint64_t frame_ns) noexcept {
        const bool is_answered = number_ % 2 == 0, is_silent = now - std::min(frame_ns, now) > kSilentNs;
        const std::uint64_t interval_ns = !is_answered ? kLostNs : is_silent ? kSilentEchoNs : kEchoNs;
        if (now - std::min(asked_ns_, now) < interval_ns) return {};
        number_ += is_answered ? 1 : 2;  // the number of a request is odd
        line_[0] = '?';
        char* const end = std::to_chars(line_.data() + 1, line_.data() + line_.size() - 1, number_).ptr;
        *end = '\n';
        asked_ns_ = now;
        return {reinterpret_cast<const std::uint8_t*>(line_.data()), std::size_t(end + 1 - line_.data())};
    }

    // rt: wait-free
    void answer(const StreamDecoder::Echo& echo) noexcept {
        if (echo.number == 0 || echo.number != number_) return;
        number_ += number_ % 2;  // answered: even
        answered_ = {asked_ns_, echo.time_us, echo.device};
    }

    // Gives the proof to the next frame of the device that answered. rt: wait-free
    void prove(Frame& frame) noexcept {
        if (frame.device != answered_.device) return;
        frame.asked_ns = answered_.asked_ns;
        frame.answered_us = answered_.time_us;
        answered_ = {};
    }

private:
    // Interval of the requests, and the same while no frame comes: the frame that ends a silence is then known to be as
    // young as the last answer.
    static constexpr std::uint64_t kEchoNs = 200'000'000, kSilentEchoNs = 25'000'000, kSilentNs = kSilentEchoNs;
    static constexpr std::uint64_t kLostNs = 2'000'000'000;  // a request without an answer for this time is repeated

    std::array<char, 16> line_{};
    std::uint32_t number_ = 0;    // the last request's: odd, and even once it was answered
    std::uint64_t asked_ns_ = 0;  // its time
    struct {
        std::uint64_t asked_ns = 0;
        std::uint32_t time_us = 0;
        std::uint16_t device = 0;
    } answered_;  // the last answer since the last frame
};

}  // namespace tactiled
