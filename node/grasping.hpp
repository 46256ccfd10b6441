// The grasp and the wrench of the gripper in the pipeline: which sensor is which jaw, what is asked of the estimators, and
// what they say.
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
    // Without a setup nothing is known and no command is taken. setup
    explicit Grasping(const std::optional<Setup>& setup, const std::optional<tool::Setup>& tool = {});

    // A sample of a sensor, BAD ones included; `zero_S` is what its tare subtracts. A sensor that is neither a jaw nor
    // a part of the tool has no effect.
    // rt: wait-free
    void observe(std::uint32_t sensor, const tactiled_sample& sample, const Wrench& zero_S) noexcept;

    // Carries out what is the grasp's; false: not now. rt: wait-free
    bool carry_out(const Command& command) noexcept;
    // NaN: as configured. rt: wait-free
    void set(const GraspSettable& settable) noexcept;

    // Goes on in the place of `before`, which was configured otherwise: what was counted, latched, wished, taught and told
    // by the robot stays, the shown scale does not. rt: wait-free
    void succeed(const Grasping& before) noexcept;

    // rt: wait-free
    [[nodiscard]] tactiled_grasp state() const noexcept;
    // rt: bounded by the sensors
    [[nodiscard]] tactiled_tool tool() const noexcept;

private:
    void observe_tool(std::size_t index, const tactiled_sample& sample, const Wrench& zero_S) noexcept;
    void take(std::span<const TaughtObject> objects) noexcept;
    void hand_over_objects() noexcept;

    std::optional<grasp::Grasp> estimator_;
    std::optional<tool::Tool> tool_;
    std::array<int, TACTILED_MAX_SENSORS> tool_of_sensor_{};  // index in the setup of the tool; -1: none
    GraspSettable configured_, requested_{kNaN, kNaN};
    std::optional<grasp::Vector> reported_gravity_G_m_s2_;  // NaN: told that it is not known any more
    grasp::Hint reported_hint_ = grasp::Hint::none;
    tactiled_grasp before_{};                                // what was counted and latched before this one; the rest is 0
    std::array<int, TACTILED_MAX_SENSORS> jaw_of_sensor_{};  // -1: none
    std::array<std::uint32_t, TACTILED_MAX_SENSORS> tares_seen_{}, methods_seen_{};

    // Weights of another scale than the one in force are of no use: of the objects those are told that were taught as it is
    // now. Their names have room: to copy one allocates nothing.
    bool scale_shown_ = false;
    std::size_t n_taught_ = 0;
    std::array<TaughtObject, grasp::Grasp::kMaxObjects> taught_;
    std::array<grasp::Object, grasp::Grasp::kMaxObjects> reported_;
};

}  // namespace tactiled
