// The grasp and the wrench on the gripper in the pipeline: assigns sensors to jaws, passes commands to the estimators,
// and returns their records.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "decoupling/grasp/grasp.hpp"
#include "decoupling/tool/tool.hpp"
#include "node/command.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class Grasping {
public:
    struct Setup {
        grasp::Setup estimator;
        GraspSettable settable;
        std::vector<TaughtObject> objects;
    };
    // Without a setup the state is unknown and every command is refused. setup
    explicit Grasping(const std::optional<Setup>& setup, const std::optional<tool::Setup>& tool = {});

    // Takes a sample of a sensor, also a BAD one; `zero_S` is the zero that its tare subtracts. A sensor that is neither a
    // jaw nor a part of the tool is ignored.
    // rt: wait-free
    void observe(std::uint32_t sensor, const tactiled_placed& placed, const Wrench& zero_S) noexcept;

    // Executes a command for the grasp or the tool. Returns false if it is not possible now. rt: wait-free
    bool carry_out(const Command& command) noexcept;
    // NaN: as configured. rt: wait-free
    void set(const GraspSettable& settable) noexcept;

    // Takes the place of `before`, which had another configuration. Counters, latches, settings, taught objects and the
    // robot's data are kept; the scale from a known weight is not kept. rt: wait-free
    void succeed(const Grasping& before) noexcept;

    [[nodiscard]] bool is_configured() const noexcept { return estimator_.has_value(); }
    // rt: wait-free
    [[nodiscard]] tactiled_grasp state() const noexcept;
    // rt: bounded by the sensors
    [[nodiscard]] tactiled_tool tool() const noexcept;
    // True while data of the robot have expired, and were neither reported again nor withdrawn. rt: wait-free
    [[nodiscard]] bool hints_expired() const noexcept { return hints_expired_; }

private:
    void observe_tool(std::size_t index, const tactiled_placed& placed, const Wrench& zero_S) noexcept;
    bool take_report(const Command& command) noexcept;
    void take(std::span<const TaughtObject> objects) noexcept;
    void hand_over_objects() noexcept;

    std::optional<grasp::Grasp> estimator_;
    std::optional<tool::Tool> tool_;
    std::array<int, TACTILED_MAX_SENSORS> tool_of_sensor_{};  // index in the setup of the tool; -1: none
    GraspSettable configured_, requested_{kNaN, kNaN};
    std::optional<grasp::Vector> reported_gravity_G_m_s2_;  // NaN: the robot reported that it is unknown
    grasp::Hint reported_hint_ = grasp::Hint::none;
    bool hints_expired_ = false;
    tactiled_grasp before_{};                                // counters and latches of the predecessor; the rest is 0
    std::array<int, TACTILED_MAX_SENSORS> jaw_of_sensor_{};  // -1: none
    std::array<std::uint32_t, TACTILED_MAX_SENSORS> tares_seen_{}, methods_seen_{};

    // Objects are recognised only if they were taught in the present scale. The strings have reserved capacity, so that
    // copying a name does not allocate.
    bool scale_shown_ = false;
    std::size_t n_taught_ = 0;
    std::array<TaughtObject, grasp::Grasp::kMaxObjects> taught_;
    std::array<grasp::Object, grasp::Grasp::kMaxObjects> reported_;
};

}  // namespace tactiled
