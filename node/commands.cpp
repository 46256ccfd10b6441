#include "node/commands.hpp"

namespace tactiled {
namespace {

using Kind = Command::Kind;

bool needs_sensors(Kind kind) noexcept {
    return kind == Kind::tare || kind == Kind::untare || kind == Kind::reset_peaks || kind == Kind::self_test ||
           kind == Kind::clear_slips;
}

}  // namespace

void Commands::carry_out(Grasping& grasping, NodeRecord& record, std::uint64_t now_ns) noexcept {
    for (std::size_t commander = 0; commander < rings_.size(); ++commander)
        for (; const Command* command = rings_[commander].front(); rings_[commander].pop()) {
            if (command->kind >= Kind::set) {
                set(*command, grasping);
                continue;
            }
            const Answer answer = answer_to(*command, grasping, record, now_ns);
            if (answer.state == TACTILED_COMMAND_RUNNING) {
                tare_commander_ = commander;
                tare_number_ = command->number;
            }
            record.acknowledge(commander, {command->number, answer.state, answer.result});
        }
}

// The registers show the settings in force, so these commands need no acknowledgement.
void Commands::set(const Command& command, Grasping& grasping) noexcept {
    if (command.kind == Kind::set) {
        for (auto& sensor : sensors_) sensor.set(command.settable);
        grasping.set(command.grasp);
    } else {
        grasping.carry_out(command);
    }
}

Commands::Answer Commands::answer_to(const Command& command, Grasping& grasping, NodeRecord& record,
                                     std::uint64_t now_ns) noexcept {
    constexpr Answer done{TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK};
    constexpr Answer running{TACTILED_COMMAND_RUNNING, TACTILED_COMMAND_OK};
    constexpr Answer not_now{TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_NOT_NOW};
    constexpr Answer not_stored{TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_NOT_STORED};
    if (now_ns > command.until_ns) return {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_TIMED_OUT};
    if (!is_valid(command)) return {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_BAD_MASK};
    switch (command.kind) {
        case Kind::tare:
            follow_tares(record, now_ns);
            if (!tares_.can_keep()) return not_stored;
            return !tares_.is_running() && tares_.begin(command.mask, now_ns) ? running : not_now;
        case Kind::untare:
            follow_tares(record, now_ns);
            if (!tares_.can_keep()) return not_stored;
            if (tares_.is_running()) return not_now;
            tares_.begin_removal(command.mask, now_ns);
            return running;
        case Kind::clear_latches:
            record.clear_faults();
            grasping.carry_out(command);
            return done;
        case Kind::clear_slips: grasping.carry_out(command); return done;
        case Kind::reset_peaks:
            for (std::size_t i = 0; i < sensors_.size(); ++i)
                if ((command.mask >> i & 1u) != 0) sensors_[i].reset_peak();
            return done;
        case Kind::self_test:
            return all_have_values(command.mask) ? done : Answer{TACTILED_COMMAND_DONE, TACTILED_COMMAND_FAILED};
        case Kind::start_weighing:
        case Kind::stop_weighing:
        case Kind::zero_weight:
        case Kind::known_weight:
        case Kind::objects: return grasping.carry_out(command) ? done : not_now;
        case Kind::set:
        case Kind::hint:
        case Kind::gravity:
        case Kind::acceleration: break;
    }
    return {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_UNKNOWN};
}

bool Commands::is_valid(const Command& command) const noexcept {
    const auto all = std::uint32_t((1u << sensors_.size()) - 1);
    return (command.mask & ~all) == 0 && (command.mask != 0 || !needs_sensors(command.kind));
}

bool Commands::all_have_values(std::uint32_t mask) const noexcept {
    for (std::size_t i = 0; i < sensors_.size(); ++i)
        if ((mask >> i & 1u) != 0 && (!sensors_[i].is_delivering() || sensors_[i].last().quality == TACTILED_BAD))
            return false;
    return true;
}

void Commands::follow_tares(NodeRecord& record, std::uint64_t now_ns) noexcept {
    if (!tares_.poll(now_ns)) return;
    if (record.acknowledged(tare_commander_) != tare_number_) return;  // a later command has replaced it in the record
    record.acknowledge(
        tare_commander_,
        {tare_number_, tares_.was_refused() ? TACTILED_COMMAND_REJECTED : TACTILED_COMMAND_DONE, tares_.result()});
}

}  // namespace tactiled
