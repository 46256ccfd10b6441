#include "decoupling/grasp/phase.hpp"

namespace tactiled::grasp {
namespace {

constexpr std::uint64_t kMs = 1'000'000;
// under vibration a press is never steady, and a grasp begins after this time
constexpr std::uint64_t kNeverSteady_ns = 500 * kMs;
constexpr std::uint64_t kLoad_ns = 15 * kMs;      // a change of the load lasts longer than a shock
constexpr std::uint64_t kLifted_ns = 600 * kMs;   // longest lift, if no stable weight ends it
constexpr std::uint64_t kJustNow_ns = 300 * kMs;  // between the loss of the first and of the last jaw's contact

}  // namespace

void Phase::enter(tactiled_grip_state state, std::uint64_t t_ns) noexcept {
    state_ = state;
    entered_ns_ = t_ns;
}

// Handles the end of the last contact. A held object counts as lost, unless the gripper was opened: by its hint, or
// because the press fell as slowly as jaws open.
void Phase::let_go(const Seen& seen, Hint hint) noexcept {
    const bool hung = hung_ns_ > 0 && seen.t_ns - hung_ns_ < kJustNow_ns;
    const bool slid = slid_ns_ > 0 && seen.t_ns - slid_ns_ < kJustNow_ns;
    const bool opens = hint == Hint::open || hint == Hint::opening;
    const bool reported_closed = hint == Hint::closed || hint == Hint::lifting || hint == Hint::moving;
    const bool lost = slid || (hung && (seen.left_at_once || reported_closed));
    enter(lost && !opens ? TACTILED_GRIP_LOST : TACTILED_GRIP_OPEN, seen.t_ns);
    hung_ns_ = slid_ns_ = 0;
    resumed_ = false;
}

void Phase::step(const Seen& seen, Hint hint) noexcept {
    slipping_ = seen.slipping;
    if (seen.unknown) {
        resumed_ |= holds();
        slipping_ = false;
        return enter(TACTILED_GRIP_UNKNOWN, seen.t_ns);
    }
    if (seen.all != all_) all_since_ns_ = seen.t_ns, all_ = seen.all;
    if (seen.loaded != loaded_) load_changed_ns_ = seen.t_ns, loaded_ = seen.loaded;
    const bool load_sure = seen.t_ns - load_changed_ns_ >= kLoad_ns;
    if (hangs()) hung_ns_ = seen.t_ns;
    if (holds() && slipping_) slid_ns_ = seen.t_ns;

    switch (state_) {
        case TACTILED_GRIP_UNKNOWN:
            enter(seen.any ? TACTILED_GRIP_CONTACT : TACTILED_GRIP_OPEN, seen.t_ns);
            if (!seen.any) resumed_ = false, hung_ns_ = 0;
            break;
        case TACTILED_GRIP_OPEN:
        case TACTILED_GRIP_LOST:
            if (seen.any) enter(TACTILED_GRIP_CONTACT, seen.t_ns);
            break;
        case TACTILED_GRIP_CONTACT:
            if (!seen.any) return let_go(seen, hint);
            if (!seen.all) break;
            if (seen.steady || seen.t_ns - all_since_ns_ > kNeverSteady_ns || hint == Hint::closed ||
                hint == Hint::lifting) {
                kept_ = hung_ns_ > 0 && all_since_ns_ - hung_ns_ < kJustNow_ns;
                grasps_ += !resumed_ && !kept_;
                enter(TACTILED_GRIP_GRASPED, seen.t_ns);
            }
            break;
        case TACTILED_GRIP_GRASPED:
        case TACTILED_GRIP_LIFTING:
        case TACTILED_GRIP_HOLDING:
            if (!seen.any) return let_go(seen, hint);
            if (!seen.all)
                enter(TACTILED_GRIP_CONTACT, seen.t_ns);
            else if (!seen.loaded && load_sure && state_ != TACTILED_GRIP_GRASPED) {
                enter(TACTILED_GRIP_GRASPED, seen.t_ns);  // put down
                hung_ns_ = 0;
            } else if (seen.loaded && load_sure && state_ == TACTILED_GRIP_GRASPED)
                enter(TACTILED_GRIP_LIFTING, seen.t_ns);
            else if (state_ == TACTILED_GRIP_LIFTING && (seen.weighed || seen.t_ns - entered_ns_ > kLifted_ns))
                enter(TACTILED_GRIP_HOLDING, seen.t_ns);
            break;
        case TACTILED_GRIP_SLIPPING: break;  // only now() returns it
    }
}

}  // namespace tactiled::grasp
