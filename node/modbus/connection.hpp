// One client: what it has sent and what it has not taken yet. Never blocks.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "node/modbus/controls.hpp"

namespace tactiled::modbus {

// Answers a whole request into `out`, returns the answer's length.
using Answer = std::function<std::size_t(std::span<const std::uint8_t> adu, std::span<std::uint8_t, kMaxAdu> out)>;

class Connection {
public:
    static constexpr std::uint64_t kRequestNs = 1'000'000'000;  // from the first byte of a request to its last
    static constexpr std::uint64_t kDeafNs = 2'000'000'000;     // that a client may leave its answers untaken
    static constexpr std::uint64_t kIdleNs = 60'000'000'000;

    // Takes over `fd`, a non-blocking socket. `max_per_s` requests a second are answered, 0 = any number; more wait.
    Connection(int fd, std::uint64_t now_ns, int max_per_s = 0)
        : fd_(fd), heard_ns_(now_ns), cost_ns_(max_per_s > 0 ? 1'000'000'000u / std::uint64_t(max_per_s) : 0) {}
    ~Connection();
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    // Receives, answers whole requests in order, sends. Returns "" or why the connection must be closed.
    const char* serve(const Answer& answer, std::uint64_t now_ns);
    // As serve() says, for a client that is late.
    [[nodiscard]] const char* overdue(std::uint64_t now_ns) const noexcept;

    [[nodiscard]] bool wants_to_send() const noexcept { return !out_.empty(); }
    // When a whole request that waits may be answered although nothing new has come: serve() again then. 0: none waits.
    [[nodiscard]] std::uint64_t backlog_ns() const noexcept {
        return request_waits_ && out_.size() < kMaxWaiting ? std::max<std::uint64_t>(held_until_ns(), 1) : 0;
    }
    // What it waits for: EPOLLIN, EPOLLOUT or, while it is held back, nothing.
    [[nodiscard]] std::uint32_t interest() const noexcept;
    std::uint32_t watched = 0;  // what epoll was told

    modbus::Session session;
    [[nodiscard]] bool has_asked() const noexcept { return asked_; }
    [[nodiscard]] std::uint64_t heard_ns() const noexcept { return heard_ns_; }

private:
    static constexpr std::size_t kMaxWaiting = 16 * kMaxAdu;  // Guide 4.4.1.2: up to 16 transactions at a time
    static constexpr int kMaxAtOnce = 16;                     // then the other clients have their turn
    static constexpr std::uint64_t kBurst = 64;

    const char* receive(std::uint64_t now_ns);
    const char* answer_all(const Answer& answer, std::uint64_t now_ns);
    const char* send(std::uint64_t now_ns);

    int fd_;
    std::array<std::uint8_t, kMaxWaiting> in_{};
    std::size_t received_ = 0;
    std::vector<std::uint8_t> out_;  // not yet sent, at most kMaxWaiting + kMaxAdu bytes
    bool asked_ = false;             // at least one whole request
    bool request_waits_ = false;     // a whole one at the start of in_
    bool said_all_ = false;          // the client will send no more
    std::uint64_t heard_ns_;
    std::uint64_t request_began_ns_ = 0;  // 0: no request is incomplete
    std::uint64_t stuck_since_ns_ = 0;    // 0: the client takes its answers
    // Each answer costs so much time; a client may be kBurst answers ahead of its account.
    std::uint64_t cost_ns_;
    std::uint64_t account_ns_ = 0;  // when all that was answered so far will be paid
    [[nodiscard]] std::uint64_t held_until_ns() const noexcept {
        return account_ns_ > kBurst * cost_ns_ ? account_ns_ - kBurst * cost_ns_ : 0;
    }
};

}  // namespace tactiled::modbus
