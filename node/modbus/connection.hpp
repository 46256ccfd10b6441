// One TCP client: receives its requests and answers them in order. Never blocks.
//
// Answers go directly into the client's socket. Its kernel buffer has room for the answers that a reading client may
// leave there: 16 at a time (Guide 4.4.1.2). If more requests wait, the next ones are answered only when the socket
// has room again. An answer that the kernel does not take completely ends the connection.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "drivers/descriptor.hpp"
#include "node/modbus/controls.hpp"
#include "node/modbus/responder.hpp"

namespace tactiled::modbus {

class Connection {
public:
    static constexpr std::uint64_t kRequestNs = 1'000'000'000;  // from the first byte of a request to its last
    static constexpr std::uint64_t kStuckNs = 2'000'000'000;    // longest wait of a request for room in the socket
    static constexpr std::uint64_t kIdleNs = 60'000'000'000;

    // The send buffer that `fd` needs, as the argument of SO_SNDBUF; the kernel doubles it. Small answers occupy
    // about 1.5 KiB each until they are acknowledged, and the kernel reports room when a third is free: more than
    // kMaxAtOnce answers need.
    static constexpr int kSendBuffer = 64 * 1024;

    // Takes over `fd`, a non-blocking socket. `max_per_s` requests a second are answered, 0 = any number; further
    // ones wait.
    Connection(int fd, std::uint64_t now_ns, int max_per_s = 0)
        : fd_(fd),
          heard_ns_(now_ns),
          asked_ns_(now_ns),
          cost_ns_(max_per_s > 0 ? 1'000'000'000u / std::uint64_t(max_per_s) : 0) {}

    // Receives, and has whole requests answered in order on the socket. Returns "" or the reason why the connection
    // must be closed.
    // rt: at most 2 system calls besides those of kMaxAtOnce answers; does not block
    const char* serve(const Answer& answer, std::uint64_t now_ns);
    // Returns the same for a client that has exceeded a time limit.
    [[nodiscard]] const char* overdue(std::uint64_t now_ns) const noexcept;

    // Returns the time at which serve() must be called although nothing new has arrived, for a request that waits; 0
    // if there is none.
    [[nodiscard]] std::uint64_t backlog_ns() const noexcept {
        return request_waits_ && stuck_since_ns_ == 0 ? std::max<std::uint64_t>(held_until_ns(), 1) : 0;
    }
    // Returns the events to call serve() for: EPOLLIN, EPOLLOUT or, while it is held back, none.
    [[nodiscard]] std::uint32_t interest() const noexcept;
    std::uint32_t watched = 0;  // the events that epoll watches for

    modbus::Session session;
    // Returns the time of the last complete request; before the first one, that of the connection.
    [[nodiscard]] std::uint64_t asked_ns() const noexcept { return asked_ns_; }
    [[nodiscard]] bool has_asked() const noexcept { return has_asked_; }

private:
    static constexpr int kMaxAtOnce = 16;  // limit of one call, in favour of the other clients
    static constexpr std::uint64_t kBurst = 64;

    [[nodiscard]] bool has_room(std::uint64_t now_ns) noexcept;
    const char* receive(std::uint64_t now_ns);
    const char* answer_all(const Answer& answer, std::uint64_t now_ns);

    Descriptor fd_;
    std::array<std::uint8_t, kMaxAtOnce * kMaxAdu> in_{};
    std::size_t received_ = 0;
    bool request_waits_ = false;  // a complete request is at the start of in_
    bool peer_finished_ = false;  // the client has shut down its direction
    std::uint64_t heard_ns_;      // time of the last byte
    std::uint64_t asked_ns_;
    bool has_asked_ = false;
    std::uint64_t request_began_ns_ = 0;  // 0: no request is incomplete
    std::uint64_t stuck_since_ns_ = 0;    // a request waits for room in the socket; 0: none does
    // Each answer costs this much time; a client may be kBurst answers ahead of its account.
    std::uint64_t cost_ns_;
    std::uint64_t account_ns_ = 0;  // time at which all answers so far are paid
    [[nodiscard]] std::uint64_t held_until_ns() const noexcept {
        return account_ns_ > kBurst * cost_ns_ ? account_ns_ - kBurst * cost_ns_ : 0;
    }
};

}  // namespace tactiled::modbus
