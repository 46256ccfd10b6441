#include "node/modbus/robot.hpp"

#include <cmath>

namespace tactiled::modbus {
namespace {

constexpr double kScale_m_s2 = 0.001;
constexpr double kMinG_m_s2 = 9.7, kMaxG_m_s2 = 9.9;  // same limits as in the configuration

grasp::Vector vector_of(const std::array<std::uint16_t, 3>& raw) noexcept {
    grasp::Vector v{};
    for (std::size_t i = 0; i < 3; ++i) v[i] = raw[i] == kNoI16 ? kNaN : std::int16_t(raw[i]) * kScale_m_s2;
    return v;
}

bool put(CommandRing& commands, const Command& command) noexcept {
    Command* const slot = commands.claim();
    if (slot == nullptr) return false;
    *slot = command;
    commands.push();
    commands.commit();
    return true;
}

}  // namespace

std::uint16_t Robot::read(unsigned at) const noexcept {
    if (at == kGripperState) return gripper_;
    if (at == kGripperForce) return force_;
    if (at == kAccelCount) return count_;
    return at < kAccelX ? gravity_[at - kGravityX] : acceleration_[at - kAccelX];
}

void Robot::write(unsigned at, std::uint16_t value, std::uint64_t now_ns) noexcept {
    if (at == kGripperForce) {
        force_ = value;
    } else if (at == kGripperState) {
        gripper_ = value;
        hint_.kind = Command::Kind::hint;
        hint_.gripper = grasp::Hint(value);
        hint_unsent_ = reported_ = true;
    } else if (at < kAccelX) {
        gravity_[at - kGravityX] = value;
        if (at != kGravityX + 2) return;
        down_.kind = Command::Kind::gravity;
        down_.robot_G_m_s2 = vector_of(gravity_);
        down_unsent_ = reported_ = true;
    } else if (at < kAccelCount) {
        acceleration_[at - kAccelX] = value;
    } else if (value != count_) {
        count_ = value;
        motion_.kind = Command::Kind::acceleration;
        motion_.robot_G_m_s2 = vector_of(acceleration_);
        motion_.reported_ns = now_ns;
        motion_unsent_ = reported_ = true;
    }
}

bool Robot::is_gravity(const std::array<std::uint16_t, 3>& raw) noexcept {
    double squares = 0;
    for (const double axis : vector_of(raw)) squares += axis * axis;
    return std::isnan(squares) || (squares >= kMinG_m_s2 * kMinG_m_s2 && squares <= kMaxG_m_s2 * kMaxG_m_s2);
}

void Robot::forget() noexcept {
    if (!reported_) return;
    if (hint_.kind == Command::Kind::hint) {
        hint_.gripper = grasp::Hint::none;
        hint_unsent_ = true;
    }
    if (down_.kind == Command::Kind::gravity) {
        down_.robot_G_m_s2 = {kNaN, kNaN, kNaN};
        down_unsent_ = true;
    }
    motion_unsent_ = reported_ = false;
}

void Robot::send(CommandRing& commands) noexcept {
    if (hint_unsent_) hint_unsent_ = !put(commands, hint_);
    if (down_unsent_) down_unsent_ = !put(commands, down_);
    if (motion_unsent_) motion_unsent_ = !put(commands, motion_);
}

}  // namespace tactiled::modbus
