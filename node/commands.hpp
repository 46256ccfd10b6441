// Executes the commands of the PLC and of local users. The node record acknowledges each command.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "node/command.hpp"
#include "node/grasping.hpp"
#include "node/node_record.hpp"
#include "node/sensor.hpp"
#include "node/tares.hpp"

namespace tactiled {

class Commands {
public:
    // `wake`: wakes the thread that executes the commands.
    Commands(std::vector<Sensor>& sensors, WakeWord& wake)
        : sensors_(sensors), rings_{CommandRing{16, &wake}, CommandRing{16, &wake}}, tares_(sensors) {}

    // The ring of one commander (enum tactiled_commander). A ring has one producer: each commander is one thread.
    [[nodiscard]] CommandRing& operator[](std::size_t commander) noexcept { return rings_[commander]; }

    // Executes the waiting commands, in the order of the commanders. rt: bounded by the capacity of the rings
    void carry_out(Grasping& grasping, NodeRecord& record, std::uint64_t now_ns) noexcept;
    // Acknowledges the running tare when its last sensor has finished. rt: bounded by the number of sensors
    void follow_tares(NodeRecord& record, std::uint64_t now_ns) noexcept;
    [[nodiscard]] const Tares& tares() const noexcept { return tares_; }
    // Stores the zeros of tares in `store`, which must live as long as the loop. Call it before the loop. setup
    void keep_zeros_in(ZeroStore& store) noexcept { tares_.keep_in(store); }

private:
    struct Answer {
        tactiled_command_state state;
        tactiled_command_result result;
    };
    void set(const Command& command, Grasping& grasping) noexcept;
    [[nodiscard]] Answer answer_to(const Command& command, Grasping& grasping, NodeRecord& record,
                                   std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool is_valid(const Command& command) const noexcept;
    [[nodiscard]] bool all_have_values(std::uint32_t mask) const noexcept;

    std::vector<Sensor>& sensors_;
    std::array<CommandRing, TACTILED_COMMANDERS> rings_;
    Tares tares_;
    std::size_t tare_commander_ = 0;  // commander of the last tare
    std::uint32_t tare_number_ = 0;   // number of that command
};

}  // namespace tactiled
