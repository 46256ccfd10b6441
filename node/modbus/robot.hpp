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

    // Forgets the data because the PLC is silent, so that they may be outdated. The registers keep the written
    // values.
    void forget() noexcept;
    // Sends new data to the pipeline, as far as there is room.
    void send(CommandRing& commands) noexcept;

private:
    // The newest data of one kind, which replace data that were not sent.
    struct Latest {
        Command command{};
        bool unsent = false;
    };
    Command& renew(Latest& latest, Command::Kind kind) noexcept;

    Latest hint_, down_, motion_;
    bool reported_ = false;  // data were written since the last forget()
};

}  // namespace tactiled::modbus
