// The state of the grasp: open, contact, grasped, lifting, holding, slipping or lost.
#pragma once
#include <cstdint>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

// The readings of the jaws at one instant.
struct Seen {
    std::uint64_t t_ns = 0;
    bool unknown = false;           // a jaw has no value
    bool any = false, all = false;  // jaws with a sensor that touch
    bool steady = false;            // the press of each jaw
    bool loaded = false;            // the shear has grown since the jaws closed
    bool weighed = false;           // by a stable weight
    bool slipping = false;
    bool left_at_once = false;
};

class Phase {
public:
    // Changes the state by one step at most per sample. rt: wait-free
    void step(const Seen& seen, Hint hint) noexcept;

    [[nodiscard]] tactiled_grip_state now() const noexcept { return slipping_ && holds() ? TACTILED_GRIP_SLIPPING : state_; }
    [[nodiscard]] bool holds() const noexcept {
        return state_ == TACTILED_GRIP_GRASPED || state_ == TACTILED_GRIP_LIFTING || state_ == TACTILED_GRIP_HOLDING;
    }
    [[nodiscard]] bool hangs() const noexcept { return state_ == TACTILED_GRIP_LIFTING || state_ == TACTILED_GRIP_HOLDING; }
    // True if the grasp continues after a discontinuity, so that its begin was not observed.
    [[nodiscard]] bool resumed() const noexcept { return resumed_; }
    // True if the object was held a moment ago, when a jaw lost contact: it is the same grasp with the same load.
    [[nodiscard]] bool kept() const noexcept { return kept_; }
    [[nodiscard]] std::uint32_t grasps() const noexcept { return grasps_; }

private:
    void enter(tactiled_grip_state state, std::uint64_t t_ns) noexcept;
    void let_go(const Seen& seen, Hint hint) noexcept;

    tactiled_grip_state state_ = TACTILED_GRIP_UNKNOWN;
    bool slipping_ = false, resumed_ = false, kept_ = false;
    std::uint64_t entered_ns_ = 0, all_since_ns_ = 0, load_changed_ns_ = 0, hung_ns_ = 0, slid_ns_ = 0;
    bool all_ = false, loaded_ = false;
    std::uint32_t grasps_ = 0;
};

}  // namespace tactiled::grasp
