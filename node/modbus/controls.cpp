// The progress of commands.
#include "node/modbus/controls.hpp"

#include <utility>

namespace tactiled::modbus {
namespace {

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
      clients_(std::uint16_t(settings.hints_expire_ms)),
      teaching_(settings.objects) {
    if (enabled_) load();
}

void Controls::tick(std::uint64_t now_ns) noexcept {
    if (settings_unsent_) send_settings();
    robot_.expire(now_ns);
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

}  // namespace tactiled::modbus
