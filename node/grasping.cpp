#include "node/grasping.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/names.hpp"
#include "tactiled/reader.h"

namespace tactiled {
namespace {

constexpr double kMaxWindow_ms = 1000;  // memory of the estimator; the register accepts up to 10 s

// A force with an unknown zero must not be used for grasping, weighing or a sum.
tactiled_quality quality_of(const tactiled_sample& s) noexcept {
    const bool has_value = s.quality != TACTILED_BAD && (s.reasons & TACTILED_ZERO_UNKNOWN) == 0;
    return tactiled_quality(tactiled_verdict(s.reasons, has_value));
}

}  // namespace

Grasping::Grasping(const std::optional<Setup>& setup, const std::optional<tool::Setup>& tool) {
    jaw_of_sensor_.fill(-1);
    tool_of_sensor_.fill(-1);
    if (tool) {
        tool_.emplace(*tool);
        for (std::size_t i = 0; i < tool->sensors.size(); ++i) tool_of_sensor_[tool->sensors[i].sensor] = int(i);
    }
    if (!setup) return;
    for (std::size_t jaw = 0; jaw < setup->estimator.jaws.size(); ++jaw)
        jaw_of_sensor_[setup->estimator.jaws[jaw].sensor] = int(jaw);
    configured_ = setup->settable;
    estimator_.emplace(setup->estimator);
    estimator_->slip_sensitivity(configured_.slip_sensitivity);
    for (auto& object : taught_) object.name.reserve(kLongestNameBytes);
    for (auto& object : reported_) object.name.reserve(kLongestNameBytes);
    take(setup->objects);
}

void Grasping::observe(std::uint32_t sensor, const tactiled_placed& placed, const Wrench& zero_S) noexcept {
    const tactiled_sample& s = placed.sample;
    if ((s.reasons & TACTILED_STEPPED) != 0) return;  // not confirmed: no event of the grasp
    if (const int index = tool_of_sensor_[sensor]; index >= 0) observe_tool(std::size_t(index), placed, zero_S);
    const int jaw = jaw_of_sensor_[sensor];
    if (jaw < 0) return;
    grasp::JawSample observed;
    observed.t_ns = s.t_ns;
    observed.quality = quality_of(s);
    observed.reasons = s.reasons;
    const std::uint32_t method = TACTILED_METHOD(s.state), before = methods_seen_[sensor];  // 0: BAD, or not "auto"
    if (method != 0) methods_seen_[sensor] = method;
    const bool another_method = method != 0 && before != 0 && method != before;
    if (s.tare_count != std::exchange(tares_seen_[sensor], s.tare_count) || another_method) {
        // Forces before and after a new zero, or of two methods, are not comparable. The additional BAD sample separates
        // them, so that their difference is not interpreted as an event of the grasp.
        grasp::JawSample moved = observed;
        moved.reasons |= TACTILED_TARING;
        moved.quality = tactiled_quality(tactiled_verdict(moved.reasons, false));
        estimator_->sample(std::size_t(jaw), moved);
    }
    // The error of such a value is unknown. With sd = NaN the weight computed from this value is not stable.
    const bool doubted = (s.reasons & ~std::uint32_t(TACTILED_REASONS_FOR_WEIGHT)) != 0;
    for (std::size_t i = 0; i < 3; ++i) {
        observed.force_S_N[i] = s.raw_force_S_N[i] - zero_S[i];  // without the low pass, because a slip lasts only some ms
        observed.sd_N[i] = doubted ? kNaN : s.sd_force_N[i];
    }
    estimator_->sample(std::size_t(jaw), observed);
}

void Grasping::observe_tool(std::size_t index, const tactiled_placed& placed, const Wrench& zero_S) noexcept {
    const tactiled_sample& s = placed.sample;
    tool::Sample observed;
    observed.t_ns = s.t_ns;
    observed.quality = quality_of(s);
    observed.tare_count = s.tare_count;
    observed.taring = (s.reasons & TACTILED_TARING) != 0;
    observed.tare_S = zero_S;
    observed.raw_S = wrench_of(s.raw_force_S_N, s.raw_torque_S_Nm);  // not low-passed
    observed.sd = wrench_of(s.sd_force_N, s.sd_torque_Nm);
    observed.budget = placed.budget;
    tool_->sample(index, observed);
}

void Grasping::take(std::span<const TaughtObject> objects) noexcept {
    n_taught_ = std::min(objects.size(), taught_.size());
    std::copy_n(objects.begin(), n_taught_, taught_.begin());
    hand_over_objects();
}

void Grasping::hand_over_objects() noexcept {
    std::size_t n = 0;
    for (std::size_t i = 0; i < n_taught_; ++i)
        if (taught_[i].scaled == scale_shown_) reported_[n++] = taught_[i];
    estimator_->objects({reported_.data(), n});
}

bool Grasping::carry_out(const Command& command) noexcept {
    using Kind = Command::Kind;
    if (command.kind >= Kind::hint) return take_report(command);
    if (!estimator_) return false;
    switch (command.kind) {
        case Kind::start_weighing: return estimator_->start_weighing();
        case Kind::stop_weighing: return estimator_->stop_weighing();
        case Kind::zero_weight: return estimator_->zero_weight();
        case Kind::known_weight:
            if (!estimator_->known_weight(command.mass_kg)) return false;
            scale_shown_ = command.mass_kg > 0;
            hand_over_objects();
            return true;
        case Kind::clear_slips:
        case Kind::clear_latches: {
            const std::uint32_t mask = command.mask != 0 ? command.mask : ~0u;  // 0: all
            estimator_->clear_slips(mask);
            before_.slip_latch &= ~mask;
            return true;
        }
        case Kind::objects: take(command.objects); return true;
        default: return false;
    }
}

bool Grasping::take_report(const Command& command) noexcept {
    using Kind = Command::Kind;
    hints_expired_ = command.hints_expired;
    if (command.kind == Kind::hint) {
        reported_hint_ = command.gripper;
        if (estimator_) estimator_->hint(reported_hint_);
        return estimator_.has_value();
    }
    const grasp::Vector& vector = command.robot_G_m_s2;
    if (command.kind == Kind::gravity) {
        reported_gravity_G_m_s2_ = vector;
        if (tool_) tool_->gravity(vector);
        if (estimator_) estimator_->gravity(vector);
    } else {
        if (tool_) tool_->acceleration(vector, command.reported_ns);
        if (estimator_) estimator_->acceleration(vector, command.reported_ns);
    }
    return tool_ || estimator_;
}

void Grasping::set(const GraspSettable& settable) noexcept {
    requested_ = settable;
    if (!estimator_) return;
    estimator_->slip_sensitivity(or_configured(settable.slip_sensitivity, configured_.slip_sensitivity));
    estimator_->weigh_window(std::min(or_configured(settable.weigh_window_ms, configured_.weigh_window_ms), kMaxWindow_ms));
}

void Grasping::succeed(const Grasping& before) noexcept {
    const tactiled_grasp was = before.state();
    before_ = {};
    before_.t_lift_off_ns = was.t_lift_off_ns;
    before_.grasps = was.grasps;
    before_.slips = was.slips;
    before_.slip_latch = was.slip_latch;
    std::copy(std::begin(was.slip_count), std::end(was.slip_count), before_.slip_count);
    set(before.requested_);
    reported_gravity_G_m_s2_ = before.reported_gravity_G_m_s2_;
    reported_hint_ = before.reported_hint_;
    hints_expired_ = before.hints_expired_;
    if (estimator_ && reported_gravity_G_m_s2_) estimator_->gravity(*reported_gravity_G_m_s2_);
    if (estimator_) estimator_->hint(reported_hint_);
    if (estimator_) take({before.taught_.data(), before.n_taught_});
    if (tool_ && reported_gravity_G_m_s2_) tool_->gravity(*reported_gravity_G_m_s2_);  // also where there was no tool
    if (tool_ && before.tool_) tool_->succeed(*before.tool_);
}

tactiled_tool Grasping::tool() const noexcept { return tool_ ? tool_->state() : tactiled_tool{}; }

tactiled_grasp Grasping::state() const noexcept {
    if (estimator_) {
        tactiled_grasp now = estimator_->state();
        now.t_lift_off_ns = std::max(now.t_lift_off_ns, before_.t_lift_off_ns);
        now.grasps += before_.grasps;
        now.slips += before_.slips;
        now.slip_latch |= before_.slip_latch;
        for (std::size_t i = 0; i < std::size(now.slip_count); ++i)
            now.slip_count[i] = std::uint16_t(now.slip_count[i] + before_.slip_count[i]);
        now.scale_shown = scale_shown_ ? 1 : 0;
        return now;
    }
    tactiled_grasp nothing{};
    tactiled_forget_grasp(&nothing);
    return nothing;
}

}  // namespace tactiled
