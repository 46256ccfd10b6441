// A PLC's data about the robot: the gripper's state, gravity and acceleration at the hand. Registers 5022 and
// 5040 .. 5046. These writes have no acknowledgement.
#pragma once
#include "node/command.hpp"
#include "node/modbus/encode.hpp"

namespace tactiled::modbus {

class Robot {
public:
    // Notes that register `at` was written, with another word than before if `changed`. Gravity takes effect with its Z,
    // acceleration with a new ACCEL_COUNT: a client that writes one register at a time never causes a mixture of an old and
    // a new direction.
    void note(unsigned at, bool changed, const Words& words, std::uint64_t now_ns) noexcept;

    // Returns true if the words are the gravity on Earth, or not available: a wrong scale would give no weight.
    static bool is_gravity(const Words& words) noexcept;

    // Returns true for the registers of these data.
    static constexpr bool is_hint(unsigned at) noexcept {
        return at == kGripperState || at == kGripperForce || (at >= kGravityX && at <= kAccelCount);
    }
    // Forgets the data because the PLC is silent, so that they may be outdated. Returns false if there were none.
    bool forget() noexcept;
    // True if data were written since the last forget().
    [[nodiscard]] bool has_reported() const noexcept { return reported_; }
    // Sends new data to the pipeline, as far as there is room.
    void send(CommandRing& commands) noexcept;

private:
    // The newest data of one kind, which replace data that were not sent.
    struct Latest {
        Command command{};
        bool unsent = false;
    };
    Command& renew(Latest& latest, Command::Kind kind) noexcept;

    Latest silence_, hint_, down_, motion_;  // in this order: newer data end the silence
    bool reported_ = false;
};

}  // namespace tactiled::modbus
