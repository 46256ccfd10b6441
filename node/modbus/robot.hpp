// A PLC's data about the robot: the gripper's state, gravity and acceleration at the hand. Registers 5022, 5023 and
// 5040 .. 5046. These writes have no acknowledgement; the registers read back the last values.
#pragma once
#include <array>
#include <cstdint>

#include "node/command_ring.hpp"
#include "node/modbus/table.hpp"

namespace tactiled::modbus {

class Robot {
public:
    static bool has(unsigned at) noexcept {
        return at == kGripperState || at == kGripperForce || (at >= kGravityX && at <= kAccelCount);
    }
    [[nodiscard]] std::uint16_t read(unsigned at) const noexcept;
    // Gravity takes effect with its Z, acceleration with a new ACCEL_COUNT: a client that writes one register at a
    // time never causes a mixture of an old and a new direction.
    void write(unsigned at, std::uint16_t value, std::uint64_t now_ns) noexcept;

    // Returns true if three registers are the gravity on Earth, or not available: a wrong scale would give no weight.
    static bool is_gravity(const std::array<std::uint16_t, 3>& raw) noexcept;

    // Forgets the data because the PLC is silent, so that they may be outdated. The registers keep the written
    // values.
    void forget() noexcept;
    // Sends new data to the pipeline, as far as there is room.
    void send(CommandRing& commands) noexcept;

private:
    std::uint16_t gripper_ = 0, force_ = 0, count_ = 0;
    std::array<std::uint16_t, 3> gravity_{kNoI16, kNoI16, kNoI16}, acceleration_{kNoI16, kNoI16, kNoI16};
    Command hint_{}, down_{}, motion_{};
    bool hint_unsent_ = false, down_unsent_ = false, motion_unsent_ = false;
    bool reported_ = false;  // data were written since the last forget()
};

}  // namespace tactiled::modbus
