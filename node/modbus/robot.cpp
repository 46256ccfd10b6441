#include "node/modbus/robot.hpp"

#include <cmath>

namespace tactiled::modbus {
namespace {

constexpr double kMinG_m_s2 = 9.7, kMaxG_m_s2 = 9.9;  // same limits as in the configuration

// The values of three registers.
grasp::Vector vector_at(unsigned at, const Words& words) noexcept {
    return {words.value(at), words.value(at + 1), words.value(at + 2)};
}

}  // namespace

Command& Robot::renew(Latest& latest, Command::Kind kind) noexcept {
    latest.command.kind = kind;
    latest.unsent = reported_ = true;
    return latest.command;
}

void Robot::note(unsigned at, bool changed, const Words& words, std::uint64_t now_ns) noexcept {
    if (at == kGripperState) renew(hint_, Command::Kind::hint).gripper = grasp::Hint(words[at]);
    if (at == kGravityX + 2) renew(down_, Command::Kind::gravity).robot_G_m_s2 = vector_at(kGravityX, words);
    if (at != kAccelCount || !changed) return;
    Command& motion = renew(motion_, Command::Kind::acceleration);
    motion.robot_G_m_s2 = vector_at(kAccelX, words);
    motion.reported_ns = now_ns;
}

bool Robot::is_gravity(const Words& words) noexcept {
    double squares = 0;
    for (const double axis : vector_at(kGravityX, words)) squares += axis * axis;
    return std::isnan(squares) || (squares >= kMinG_m_s2 * kMinG_m_s2 && squares <= kMaxG_m_s2 * kMaxG_m_s2);
}

bool Robot::forget() noexcept {
    if (!reported_) return false;
    for (Latest* const latest : {&hint_, &down_, &motion_}) latest->unsent = false;
    renew(silence_, Command::Kind::robot_is_silent);
    reported_ = false;
    return true;
}

void Robot::send(CommandRing& commands) noexcept {
    for (Latest* const latest : {&silence_, &hint_, &down_, &motion_}) {
        if (latest->unsent && !commands.send(latest->command)) return;
        latest->unsent = false;
    }
}

}  // namespace tactiled::modbus
