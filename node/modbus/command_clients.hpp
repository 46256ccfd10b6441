// The state of each client that writes: its heartbeat, the command block with its CMD_SEQ, and the outcome of commands of
// one register or coil.
//
// A client is an address, so that its state survives a reconnection, and two PLCs have separate states. The RTU line
// is one client. If there are more addresses than places, the one that has written least recently is forgotten.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "node/modbus/allow_list.hpp"
#include "node/modbus/table.hpp"
#include "tactiled/layout.h"

namespace tactiled::modbus {

// State and result of a command, as CMD_STATE and CMD_RESULT show them.
struct Outcome {
    tactiled_command_state state = TACTILED_COMMAND_IDLE;
    tactiled_command_result result = TACTILED_COMMAND_OK;
    [[nodiscard]] bool is_running() const noexcept { return state == TACTILED_COMMAND_RUNNING; }
};

// The words of a hint of up to three registers, in their order; further ones are 0.
using HintWords = std::array<std::uint16_t, 3>;

// A vector as a client writes it, by one request or by three: Z makes it whole, after X and Y.
struct VectorDraft {
    HintWords words{};
    unsigned written = 0;  // axes from X on, without a gap

    void put(unsigned axis, std::uint16_t word) noexcept {
        words[axis] = word;
        if (axis <= written) written = axis + 1;
    }
    [[nodiscard]] bool is_whole() const noexcept { return written == words.size(); }
};

// The words of hints that a client has written: what it has begun, and what has no effect. A silence ends them all.
struct HintDrafts {
    VectorDraft gravity, acceleration;
    std::optional<std::uint16_t> accel_count;  // the first one confirms nothing: its values may be old
    std::uint16_t gripper_force = kNoU16;      // without effect yet
};

struct CommandClient {
    static constexpr std::uint64_t kNever = UINT64_MAX;
    HostAddress host{};
    std::uint64_t wrote_ns = 0;  // 0: this place is free

    std::uint16_t heartbeat = 0, watchdog_ms = 0;  // the words that it wrote last
    std::uint64_t life_ns = 0;                     // its last sign of life; 0: none yet
    HintDrafts hints;

    std::array<std::uint16_t, 5> block{};  // registers 5000 .. 5004
    std::array<std::uint16_t, 5> taken{};  // the block when its number was taken
    bool has_number = false;               // a number was taken since the start: taken[4], CMD_SEQ_ACK
    bool outcome_was_read = false;
    std::uint16_t repeats = 0;
    Outcome outcome;           // outcome of the block
    std::uint32_t number = 0;  // the number of the block's command in the pipeline

    std::uint16_t direct_code = 0, direct_count = 0;  // command by one register or coil
    Outcome direct;
    std::uint32_t direct_number = 0;
    std::uint64_t direct_ns = 0;

    // The client has shown signs of life, and none for its PLC_WATCHDOG.
    [[nodiscard]] bool is_silent(std::uint64_t now_ns) const noexcept { return life_ns != 0 && now_ns > lives_until_ns(); }
    [[nodiscard]] std::uint64_t lives_until_ns() const noexcept {
        return watchdog_ms == 0 ? kNever : life_ns + std::uint64_t(watchdog_ms) * 1'000'000u;
    }
    // Its hints; axes from before a silence are those of an old direction.
    [[nodiscard]] HintDrafts drafts(std::uint64_t now_ns) const noexcept { return is_silent(now_ns) ? HintDrafts{} : hints; }

    // True if writing `cmd_seq` runs the block. The first number after a start does not: a PLC that writes its block
    // in every cycle writes its last command again, which must not run a second time.
    [[nodiscard]] bool runs(std::uint16_t cmd_seq) const noexcept { return has_number && cmd_seq != taken[4]; }
    // Takes the number in the block. Returns true if the block must run; else the outcome is settled. rt: wait-free
    [[nodiscard]] bool take_number() noexcept;
    void settle(Outcome now) noexcept {
        outcome = now;
        outcome_was_read = false;
    }
};

class CommandClients {
public:
    // `watchdog_ms`: the PLC_WATCHDOG of a client that has not written it.
    explicit CommandClients(std::uint16_t watchdog_ms) noexcept { unknown_.watchdog_ms = watchdog_ms; }
    // Returns the state of the client at `host`; the empty state if the address is unknown. rt: wait-free
    [[nodiscard]] const CommandClient& at(const HostAddress& host) const noexcept;
    // Returns the same for writing; an unknown address gets a place. rt: wait-free
    [[nodiscard]] CommandClient& of_writer(const HostAddress& host, std::uint64_t now_ns) noexcept;
    // Notes that the client at `host` has read its outcome. rt: wait-free
    void note_read(const HostAddress& host) noexcept;

    [[nodiscard]] auto begin() const noexcept { return clients_.begin(); }
    [[nodiscard]] auto end() const noexcept { return clients_.end(); }
    [[nodiscard]] auto begin() noexcept { return clients_.begin(); }
    [[nodiscard]] auto end() noexcept { return clients_.end(); }

private:
    [[nodiscard]] CommandClient* find(const HostAddress& host) noexcept;
    std::array<CommandClient, 32> clients_{};
    CommandClient unknown_{};
};

}  // namespace tactiled::modbus
