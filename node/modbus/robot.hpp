// A PLC's data about the robot, the hints: the gripper's state, gravity and acceleration at the hand. Registers 5022, 5023
// and 5040 .. 5046. These writes have no acknowledgement.
//
// A hint belongs to the client that stated it last, and is in force until that client has been silent for its PLC_WATCHDOG.
// An acceleration is of a moment, and is not known 100 ms after its report: a robot that moves reports another one.
// Words that are not known end a hint, unless it belongs to another client. Gravity 0, 0, 0 says nothing: it only
// withdraws the one of the same client.
#pragma once
#include <array>
#include <optional>

#include "node/command.hpp"
#include "node/modbus/encode.hpp"

namespace tactiled::modbus {

class Robot {
public:
    // On Earth, as in the configuration: a gravity beyond has a wrong scale, and would give a wrong weight.
    static constexpr double kMinG_m_s2 = 9.7, kMaxG_m_s2 = 9.9;
    // The age up to which grasp::Weight and Tool use a reported acceleration.
    static constexpr std::uint64_t kAccelerationLasts_ms = 100, kAccelerationLasts_ns = kAccelerationLasts_ms * 1'000'000;

    // Takes a register of a hint from a client. The gripper's state takes effect at once, gravity with its Z after X and Y,
    // acceleration with another ACCEL_COUNT than the one before: a client that writes one register at a time never causes a
    // mixture of an old and a new direction.
    void write(unsigned at, std::uint16_t word, CommandClient& client, std::uint64_t now_ns) noexcept;
    // Keeps the hints of a client in force until then.
    void hold(const HostAddress& writer, std::uint64_t until_ns) noexcept;
    // Ends the hints whose time has passed.
    void expire(std::uint64_t now_ns) noexcept;
    // Sends what has changed to the pipeline, as far as there is room.
    void send(CommandRing& commands) noexcept;

    // Returns the word in force, "not available" of a hint that was not stated, was withdrawn, or has expired; of the force
    // and of ACCEL_COUNT the one of the client that asks.
    [[nodiscard]] std::uint16_t word(unsigned at, const HintDrafts& drafts) const noexcept;
    // True while a hint is in force that may expire.
    [[nodiscard]] bool may_expire() const noexcept;

    // Returns true if the words are the gravity on Earth, not available, or 0, 0, 0, which states nothing.
    static bool is_gravity(const HintWords& words) noexcept;
    // Returns true for the registers of these data.
    static constexpr bool is_hint(unsigned at) noexcept {
        return at == kGripperState || at == kGripperForce || (at >= kGravityX && at <= kAccelCount);
    }

private:
    enum class State : std::uint8_t { configured, unknown, stated, expired };  // configured: no client has said anything
    struct Hint {
        std::uint16_t at;  // its first register
        Command::Kind kind;
        std::uint16_t none;  // the word that is not known
        HintWords words{none, none, none};
        State state = State::configured;
        std::optional<HostAddress> writer{};  // nullopt: neither stated nor expired
        std::uint64_t until_ns = 0, stated_ns = 0;
        bool unsent = false;

        [[nodiscard]] bool is_of_a_moment() const noexcept { return kind == Command::Kind::acceleration; }
    };
    // Returns the index of the hint that a register belongs to.
    static constexpr std::size_t index_of(unsigned at) noexcept { return at < kGravityX ? 0 : at < kAccelX ? 1 : 2; }
    static void state(Hint& hint, const HintWords& words, const HostAddress& writer, std::uint64_t now_ns) noexcept;
    static void end(Hint& hint, State why) noexcept;
    [[nodiscard]] Command command_of(const Hint& hint) const noexcept;

    std::array<Hint, 3> hints_{{{kGripperState, Command::Kind::hint, kNoU16},
                                {kGravityX, Command::Kind::gravity, kNoI16},
                                {kAccelX, Command::Kind::acceleration, kNoI16}}};
};

}  // namespace tactiled::modbus
