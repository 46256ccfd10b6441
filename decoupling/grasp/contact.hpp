// One jaw: its zero from the free phase, its noise, and its contact.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

// The measurement of a jaw minus its zero, frame S.
struct Observation {
    std::uint64_t t_ns = 0;
    Eigen::Vector3d force_S_N = Eigen::Vector3d::Zero(), sd_N = Eigen::Vector3d::Zero();
    double press_N = 0, shear_N = 0;  // -fz, |fx, fy|
    bool known = false;               // a value that is not BAD exists
    // the state of a weight of which this would be a part; TACTILED_WEIGHT_NONE: nothing prevents a weight
    tactiled_weight_state refusal = TACTILED_WEIGHT_NONE;
};

class Contact {
public:
    explicit Contact(const JawSetup& setup) : setup_(setup) {}

    // Returns false if the sample has no value or is older than the last one, which `observation()` then reports.
    // rt: wait-free
    bool take(const JawSample& sample) noexcept;

    // Records that the robot or a user reports an empty gripper.
    void opened() noexcept { held_blind_ = false; }

    [[nodiscard]] const Observation& observation() const noexcept { return observation_; }
    [[nodiscard]] bool touching() const noexcept { return touching_; }
    // True if the press fell from half of its value to zero faster than jaws open.
    [[nodiscard]] bool left_at_once() const noexcept { return left_at_once_; }
    // Returns one sd of a sample, from the free phase; 0 = not known yet.
    [[nodiscard]] double noise_N(int axis) const noexcept { return noise_N_[axis]; }
    // Returns one sd of the zero's random walk since the free phase; infinite after a discontinuity until the next free
    // phase.
    [[nodiscard]] Eigen::Vector3d zero_sd_N() const noexcept;
    // Time since the zero was last learned; 0 = never.
    [[nodiscard]] double zero_age_s() const noexcept;

private:
    void judge_touch() noexcept;
    void learn_zero(const Eigen::Vector3d& raw_N) noexcept;
    void close_bucket() noexcept;

    JawSetup setup_;
    Observation observation_;
    bool touching_ = false, left_at_once_ = false;
    int against_ = 0;  // samples in a row that contradict touching_
    double held_press_N_ = 0;
    std::uint64_t half_ns_ = 0;  // time of the last press above half of held_press_N_

    Eigen::Vector3d zero_N_ = Eigen::Vector3d::Zero(), noise_N_ = Eigen::Vector3d::Zero();
    int differences_ = 0;
    // Means of 20 ms of the free phase. The two newest are not used yet, as a contact that begins softly must not
    // become the zero.
    struct Bucket {
        Eigen::Vector3d sum_N = Eigen::Vector3d::Zero();
        int n = 0;
    };
    Bucket filling_;
    std::array<Bucket, 2> waiting_;
    std::uint64_t bucket_ns_ = 0, free_since_ns_ = 0, zero_ns_ = 0;
    Eigen::Vector3d walk_N2_s_ = Eigen::Vector3d::Zero();  // variance per second
    int buckets_ = 0;
    bool zero_known_ = true;  // true with the node's tare, until a discontinuity
    // True after a discontinuity during a contact: a reading of zero may then be a held object that was tared. It is
    // used as the zero only after the press has fallen by the threshold of a contact.
    bool held_blind_ = false;
    double max_blind_N_ = 0;
};

}  // namespace tactiled::grasp
