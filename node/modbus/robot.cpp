#include "node/modbus/robot.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tactiled::modbus {
namespace {

// The values of three registers.
grasp::Vector vector_of(unsigned at, const HintWords& words) noexcept {
    return {decode(*writable_at(at), words[0]), decode(*writable_at(at + 1), words[1]),
            decode(*writable_at(at + 2), words[2])};
}

double squares_of(const grasp::Vector& v) noexcept {
    double sum = 0;
    for (const double axis : v) sum += axis * axis;
    return sum;
}

}  // namespace

void Robot::write(unsigned at, std::uint16_t word, CommandClient& client, std::uint64_t now_ns) noexcept {
    Hint& hint = hints_[index_of(at)];
    HintDrafts& drafts = client.hints;
    if (at == kGripperForce) {
        drafts.gripper_force = word;
    } else if (at == kGripperState) {
        state(hint, {word}, client.host, now_ns);
    } else if (at < kAccelX) {
        drafts.gravity.put(at - kGravityX, word);
        if (drafts.gravity.is_whole()) state(hint, drafts.gravity.words, client.host, now_ns);
    } else if (at < kAccelCount) {
        drafts.acceleration.put(at - kAccelX, word);
    } else if (const auto before = std::exchange(drafts.accel_count, word);
               before && *before != word && drafts.acceleration.is_whole()) {
        state(hint, drafts.acceleration.words, client.host, now_ns);
    }
}

void Robot::state(Hint& hint, const HintWords& words, const HostAddress& writer, std::uint64_t now_ns) noexcept {
    const bool says_nothing = hint.kind == Command::Kind::gravity && words == HintWords{};
    if (says_nothing || std::find(words.begin(), words.end(), hint.none) != words.end()) {
        if (hint.writer == writer || (!hint.writer && !says_nothing)) end(hint, State::unknown);
        return;
    }
    hint.words = words;
    hint.state = State::stated;
    hint.writer = writer;
    hint.stated_ns = now_ns;
    hint.unsent = true;
}

void Robot::end(Hint& hint, State why) noexcept {
    hint.words = {hint.none, hint.none, hint.none};
    hint.unsent |= hint.state != why;
    hint.state = why;
    if (why == State::unknown) hint.writer.reset();
}

void Robot::hold(const HostAddress& writer, std::uint64_t until_ns) noexcept {
    for (Hint& hint : hints_)
        if (hint.writer == writer)
            hint.until_ns = hint.is_of_a_moment() ? std::min(until_ns, hint.stated_ns + kAccelerationLasts_ns) : until_ns;
}

void Robot::expire(std::uint64_t now_ns) noexcept {
    for (Hint& hint : hints_)
        if (hint.state == State::stated && now_ns > hint.until_ns)
            end(hint, hint.is_of_a_moment() ? State::unknown : State::expired);
}

bool Robot::may_expire() const noexcept {
    return std::any_of(hints_.begin(), hints_.end(), [](const Hint& hint) {
        return hint.state == State::stated && hint.until_ns != CommandClient::kNever;
    });
}

// A hint that has ended is sent as one that is not known.
Command Robot::command_of(const Hint& hint) const noexcept {
    Command command;
    command.kind = hint.kind;
    if (hint.kind == Command::Kind::hint)
        command.gripper = grasp::Hint(hint.words[0]);
    else
        command.robot_G_m_s2 = vector_of(hint.at, hint.words);
    command.reported_ns = hint.stated_ns;
    command.hints_expired =
        std::any_of(hints_.begin(), hints_.end(), [](const Hint& one) { return one.state == State::expired; });
    return command;
}

void Robot::send(CommandRing& commands) noexcept {
    for (Hint& hint : hints_) {
        if (hint.unsent && !commands.send(command_of(hint))) return;
        hint.unsent = false;
    }
}

std::uint16_t Robot::word(unsigned at, const HintDrafts& drafts) const noexcept {
    if (at == kGripperForce) return drafts.gripper_force;
    if (at == kAccelCount) return drafts.accel_count.value_or(0);
    const Hint& hint = hints_[index_of(at)];
    return hint.words[at - hint.at];
}

bool Robot::is_gravity(const HintWords& words) noexcept {
    const double squares = squares_of(vector_of(kGravityX, words));
    return std::isnan(squares) || squares == 0 || (squares >= kMinG_m_s2 * kMinG_m_s2 && squares <= kMaxG_m_s2 * kMaxG_m_s2);
}

}  // namespace tactiled::modbus
