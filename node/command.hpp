// A command of the PLC or of a local user, and the ring through which one commander sends its commands to the pipeline. The
// pipeline executes the command (commands.hpp); the node record acknowledges it.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "decoupling/grasp/grasp.hpp"
#include "node/objects.hpp"
#include "node/ring.hpp"
#include "node/sensor.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

// Settings of the grasp that may change while the daemon runs. NaN stands for the configured value.
struct GraspSettable {
    double slip_sensitivity = 0.5;  // 0 .. 1
    double weigh_window_ms = 100;

    bool operator==(const GraspSettable&) const = default;
};

struct Command {
    enum class Kind : std::uint32_t {
        tare = 1,
        untare = 2,
        clear_latches = 3,
        start_weighing = 4,
        stop_weighing = 5,
        reset_peaks = 6,
        zero_weight = 7,
        self_test = 8,
        known_weight = 9,
        clear_slips = 10,
        objects = 11,
        // settings and robot data, which are not acknowledged:
        set = 100,
        hint = 101,
        gravity = 102,
        acceleration = 103
    };
    Kind kind = Kind::tare;
    std::uint32_t mask = 0;               // bit n: sensor n
    std::uint32_t number = 0;             // reported as tactiled_command.acknowledged
    SensorSettable settable{};            // argument of `set`
    std::uint64_t until_ns = UINT64_MAX;  // the command is rejected after this time
    GraspSettable grasp{};                // argument of `set`
    double mass_kg = 0;                   // argument of `known_weight`
    grasp::Hint gripper{};                // argument of `hint`; none = unknown
    grasp::Vector robot_G_m_s2{};         // argument of `gravity` and `acceleration`; NaN = unknown
    std::uint64_t reported_ns = 0;        // argument of `acceleration`
    bool hints_expired = false;           // argument of these three: one has expired, and was neither renewed nor withdrawn
    // Argument of `objects`. The sender owns the memory and keeps it until the command is acknowledged, however long that
    // takes.
    std::span<const TaughtObject> objects{};
};

class CommandRing : public Ring<Command> {
public:
    // `wake`: wakes the pipeline's thread; nullptr: the consumer polls the ring. setup
    explicit CommandRing(std::size_t capacity, WakeWord* wake = nullptr) : Ring(capacity), wake_(wake) {}

    // Publishes all pushed commands to the pipeline and wakes its thread. rt: one system call
    void commit() noexcept {
        Ring::commit();
        if (wake_ != nullptr) wake_->wake();
    }
    // Publishes one command. Returns false if there is no room: the pipeline hangs. rt: one system call
    [[nodiscard]] bool send(const Command& command) noexcept {
        Command* const slot = claim();
        if (slot == nullptr) return false;
        *slot = command;
        push();
        commit();
        return true;
    }

private:
    WakeWord* wake_;
};

}  // namespace tactiled
