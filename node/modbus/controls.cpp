#include "node/modbus/controls.hpp"

#include <algorithm>
#include <utility>

namespace tactiled::modbus {
namespace {

bool is_command_cell(unsigned at) { return at >= kTareCell && at <= kKnownWeightCell; }

// Refuses a tare at once if it is known to be impossible now.
bool have_values(const View& view, std::uint32_t mask) {
    for (unsigned i = 0; i < kSensorBlocks; ++i)
        if ((mask >> i & 1) != 0 && view.snapshot.sensor[i].quality == TACTILED_BAD) return false;
    return true;
}

Outcome outcome_of(const tactiled_command& answer) {
    const bool good = answer.state == TACTILED_COMMAND_DONE && answer.result == TACTILED_COMMAND_OK;
    return {good ? TACTILED_COMMAND_DONE : TACTILED_COMMAND_REJECTED, tactiled_command_result(answer.result)};
}
}  // namespace

Controls::Controls(const ModbusSettings& settings, CommandRing& commands)
    : enabled_(settings.commands),
      weighs_(!settings.objects.empty()),
      path_(settings.settings),
      commands_(commands),
      teaching_(settings.objects) {
    settings_.fill(kAsConfigured);
    if (enabled_) load();
}

void Controls::tick(std::uint64_t now_ns) noexcept {
    if (settings_unsent_) send_settings();
    if (plc_is_silent(now_ns)) robot_.forget();
    robot_.send(commands_);
    hand_over_objects(now_ns);
}

void Controls::follow(const View& view, std::uint64_t now_ns) noexcept {
    tick(now_ns);
    const tactiled_command& answer = view.snapshot.node.command[TACTILED_FROM_MODBUS];
    acknowledged_by_pipeline_ = answer.acknowledged;
    follow_teaching(answer);
    follow_direct(answer, now_ns);
    if (running_ == nullptr || teaching_for_block_) return;
    if (answer.acknowledged == running_->number && answer.state != TACTILED_COMMAND_RUNNING) {
        const Outcome outcome = outcome_of(answer);
        settle_block(outcome.state, outcome.result);
    } else if (now_ns > sent_ns_ + kAnswerNs) {
        settle_block(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_TIMED_OUT);
    }
}

void Controls::settle_block(tactiled_command_state state, tactiled_command_result result) noexcept {
    CommandClient& client = *std::exchange(running_, nullptr);
    if (client.outcome.is_running()) client.settle({state, result});  // else its number was repeated for another command
}

// Follows commands of one register or coil. The pipeline's record holds only the last acknowledgement: if a later
// command has replaced it, the outcome is unknown.
void Controls::follow_direct(const tactiled_command& answer, std::uint64_t now_ns) noexcept {
    for (CommandClient& client : clients_) {
        if (!client.direct.is_running() || &client == teacher_) continue;
        const auto ahead = std::int32_t(answer.acknowledged - client.direct_number);
        if (ahead == 0 && answer.state != TACTILED_COMMAND_RUNNING)
            client.direct = outcome_of(answer);
        else if (ahead > 0 || now_ns > client.direct_ns + kAnswerNs)
            client.direct = {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_TIMED_OUT};
    }
}

// Passes the objects that TEACH has stored to the pipeline; the list is kept until the pipeline has copied it.
void Controls::hand_over_objects(std::uint64_t now_ns) noexcept {
    if (teaching_.state() != Teaching::stored || objects_number_ != 0) return;
    Command command;
    command.kind = Command::Kind::objects;
    command.objects = teaching_.objects();
    objects_number_ = send(command, now_ns);
    if (objects_number_ == 0 || !std::exchange(teaching_for_block_, false)) return;
    running_->number = objects_number_;
    sent_ns_ = now_ns;
}

void Controls::follow_teaching(const tactiled_command& answer) noexcept {
    if (teaching_.state() == Teaching::failed) {
        if (std::exchange(teaching_for_block_, false))
            settle_block(TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_FAILED);
        else
            teach_failed_ = true;
        if (teacher_ != nullptr) teacher_->direct = {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_FAILED};
        teacher_ = nullptr;
        teaching_.settle();
    } else if (objects_number_ != 0 && std::int32_t(acknowledged_by_pipeline_ - objects_number_) >= 0) {
        teach_failed_ = answer.acknowledged == objects_number_ && answer.state == TACTILED_COMMAND_REJECTED;
        objects_number_ = 0;
        if (teacher_ != nullptr && teach_failed_)
            teacher_->direct = {TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_NOT_NOW};
        else if (teacher_ != nullptr)
            teacher_->direct = {TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK};
        teacher_ = nullptr;
        teaching_.settle();
    }
}

// True also before the pipeline has taken the command: two tares in one TCP segment are two.
bool Controls::is_busy(const View& view) const noexcept {
    return (view.snapshot.node.status & TACTILED_ANY_TARING) != 0 || running_ != nullptr ||
           std::int32_t(acknowledged_by_pipeline_ - tare_number_) < 0 || teaching_.state() != Teaching::idle;
}

// ---- checks of a write
// -----------------------------------------------------------------------------------------------

// Returns the value that the request would write to register number i of its run.
std::uint16_t Controls::requested(const Request& request, unsigned i, const Session& session) const noexcept {
    const auto word = [&](std::size_t at) { return std::uint16_t(request.written[at] << 8 | request.written[at + 1]); };
    if (request.function != kMaskWrite) return word(2 * std::size_t(i));
    std::uint16_t now = 0;
    read(request.write, session, 0, &now);
    return std::uint16_t((now & word(0)) | (word(2) & ~word(0)));  // 1.1b3, 6.16
}

Exception Controls::check(const Request& request, const View& view, const Session& session,
                          std::uint64_t now_ns) const noexcept {
    if (!enabled_ || !session.may_write) return kIllegalAddress;  // read-only for this client
    const bool coils = request.function == kWriteCoil || request.function == kWriteCoils;
    Exception first = kNone;  // in the order of the run; a wrong address comes before a wrong value
    for (unsigned i = 0; i < request.write.count; ++i) {
        const auto at = std::uint16_t(request.write.at + i);
        const Exception found = !coils ? check_register(at, requested(request, i, session), view, session, now_ns)
                                       : check_coil(request, i, view);
        if (found == kIllegalAddress) return found;
        if (first == kNone) first = found;
    }
    if (first == kNone && (takes_more_than_one_command(request, session) || contact_is_upside_down(request, session) ||
                           gravity_is_none(request, session)))
        return kIllegalValue;
    return first;
}

// A write is carried out completely or not at all; of two commands, the pipeline might refuse the second.
bool Controls::takes_more_than_one_command(const Request& request, const Session& session) const noexcept {
    int commands = 0;
    const CommandClient& client = clients_.at(session.host);
    if (request.function == kWriteCoil || request.function == kWriteCoils) {
        bool tares = false, slips = false;
        for (unsigned i = 0; i < request.write.count; ++i) {
            const unsigned at = request.write.at + i;
            if (!is_set(request, i)) continue;
            tares |= at < kSlipCoils;
            slips |= at >= kSlipCoils && at < kClearAllCoil;
            commands += at >= kClearAllCoil ? 1 : 0;
        }
        return commands + (tares ? 1 : 0) + (slips ? 1 : 0) > 1;
    }
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        const std::uint16_t value = requested(request, i, session);
        commands += (is_command_cell(at) && value != 0) || (at == kCmdSeq && client.runs(value)) ? 1 : 0;
    }
    return commands > 1;
}

// Checks the hysteresis if both limits are written here: contact must not end above its begin.
bool Controls::contact_is_upside_down(const Request& request, const Session& session) const noexcept {
    if (request.function == kWriteCoil || request.function == kWriteCoils) return false;
    std::uint16_t on = settings_[kContactOn - kFilterHz], off = settings_[kContactOff - kFilterHz];
    bool touched = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        if (at == kContactOn) on = requested(request, i, session);
        if (at == kContactOff) off = requested(request, i, session);
        touched |= at == kContactOn || at == kContactOff;
    }
    return touched && on != kAsConfigured && off != kAsConfigured && off > on;
}

// Returns true if the gravity after the write of Z would be zero.
bool Controls::gravity_is_none(const Request& request, const Session& session) const noexcept {
    if (request.function == kWriteCoil || request.function == kWriteCoils) return false;
    std::array<std::uint16_t, 3> raw{};
    for (unsigned axis = 0; axis < 3; ++axis) raw[axis] = robot_.read(kGravityX + axis);
    bool counts = false;
    for (unsigned i = 0; i < request.write.count; ++i) {
        const unsigned at = request.write.at + i;
        if (at >= kGravityX && at < kAccelX) raw[at - kGravityX] = requested(request, i, session);
        counts |= at == kGravityX + 2;
    }
    return counts && !Robot::is_gravity(raw);
}

Exception Controls::check_register(std::uint16_t at, std::uint16_t value, const View& view, const Session& session,
                                   std::uint64_t now_ns) const noexcept {
    if (at >= kScratchAt) return kNone;
    const Limits& limits = writable_at(at)->limits;
    if (limits.locked && now_ns > session.unlocked_until_ns) return kIllegalAddress;
    const bool as_configured = limits.locked && value == kAsConfigured;
    if ((value < limits.min || value > limits.max) && !as_configured) return kIllegalValue;
    if (at == kPlcWatchdog && value != 0 && value < 10) return kIllegalValue;
    if (at == kUnlock && value != kUnlockWord && value != 0) return kIllegalValue;
    if (is_command_cell(at) && value != 0) return check_command_cell(at, value, view);
    const bool command = at == kCmdSeq && clients_.at(session.host).runs(value);
    if (command && is_busy(view)) return kBusy;  // one at a time, so that CMD_STATE refers to the right command
    if (command && !view.alive) return kDeviceFailure;
    if (at == kSave && saving_.load() == storing) return kBusy;
    return kNone;
}

// Checks a command of one register, other than 0. A value that is known to be impossible is refused at once.
Exception Controls::check_command_cell(std::uint16_t at, std::uint16_t value, const View& view) const noexcept {
    if (at <= kResetPeakCell && (value & ~sensor_mask_of(view)) != 0) return kIllegalValue;
    const bool weighs = at == kWeighCell || at > kResetPeakCell;
    if (weighs && !weighs_) return kDeviceFailure;
    if (is_busy(view)) return kBusy;
    if (!view.alive || (at == kTareCell && !have_values(view, value))) return kDeviceFailure;
    if ((at == kKnownWeightCell || at == kTeachCell) && !is_stable(view.snapshot.node.grasp)) return kDeviceFailure;
    if (at == kTeachCell && !is_teachable(weighing_of(view.snapshot.node.grasp))) return kDeviceFailure;
    return kNone;
}

// A 0 is no command, except that it stops weighing if it is written to that coil alone.
Exception Controls::check_coil(const Request& request, unsigned i, const View& view) const noexcept {
    const unsigned at = request.write.at + i;
    if (!is_set(request, i) && (at != kWeighCoil || request.write.count != 1)) return kNone;
    if (!view.alive || (at == kWeighCoil && !weighs_)) return kDeviceFailure;
    if (at == kClearAllCoil || at == kWeighCoil) return is_busy(view) ? kBusy : kNone;
    if ((sensor_mask_of(view) >> at % kSensorBlocks & 1) == 0) return kIllegalAddress;  // no such sensor
    if (at >= kSlipCoils) return is_busy(view) ? kBusy : kNone;
    return is_busy(view) ? kBusy : have_values(view, 1u << at) ? kNone : kDeviceFailure;
}

}  // namespace tactiled::modbus
