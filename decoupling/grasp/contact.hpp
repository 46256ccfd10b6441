// One jaw: its zero from the free phase, its noise, and whether it touches.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

// The measurement of a jaw, less its zero, frame S.
struct Observation {
    std::uint64_t t_ns = 0;
    Eigen::Vector3d force_S_N = Eigen::Vector3d::Zero(), sd_N = Eigen::Vector3d::Zero();
    double press_N = 0, shear_N = 0;  // -fz, |fx, fy|
    bool known = false;               // a value that is not BAD
    bool overload = false;            // saturated, or beyond full scale or calibration
};

class Contact {
public:
    explicit Contact(const JawSetup& setup) : setup_(setup) {}

    // False: no value, or older than the last one; `observation()` then says so. rt: wait-free
    bool take(const JawSample& sample) noexcept;

    // The robot or a user reports that the gripper is empty.
    void opened() noexcept { held_blind_ = false; }

    [[nodiscard]] const Observation& observation() const noexcept { return observation_; }
    [[nodiscard]] bool touching() const noexcept { return touching_; }
    // The press fell from half of what it was to nothing faster than jaws open.
    [[nodiscard]] bool left_at_once() const noexcept { return left_at_once_; }
    // One sd of a sample, from the free phase; 0 = not seen yet.
    [[nodiscard]] double noise_N(int axis) const noexcept { return noise_N_[axis]; }
    // One sd of the zero's random walk since the free phase; infinite if there was none since a discontinuity.
    [[nodiscard]] Eigen::Vector3d zero_sd_N() const noexcept;
    // Time since the zero was last learnt; 0 = not learnt yet.
    [[nodiscard]] double zero_age_s() const noexcept;

private:
    void judge_touch() noexcept;
    void learn_zero(const Eigen::Vector3d& raw_N) noexcept;
    void close_bucket() noexcept;

    JawSetup setup_;
    Observation observation_;
    bool touching_ = false, left_at_once_ = false;
    int against_ = 0;  // samples in a row that speak against touching_
    double held_press_N_ = 0;
    std::uint64_t half_ns_ = 0;  // when the press was last above half of held_press_N_

    Eigen::Vector3d zero_N_ = Eigen::Vector3d::Zero(), noise_N_ = Eigen::Vector3d::Zero();
    int differences_ = 0;
    // Means of 20 ms of the free phase. The two newest wait: a contact that begins softly must not become the zero.
    struct Bucket {
        Eigen::Vector3d sum_N = Eigen::Vector3d::Zero();
        int n = 0;
    };
    Bucket filling_;
    std::array<Bucket, 2> waiting_;
    std::uint64_t bucket_ns_ = 0, free_since_ns_ = 0, zero_ns_ = 0;
    Eigen::Vector3d walk_N2_s_ = Eigen::Vector3d::Zero();  // variance a second
    int buckets_ = 0;
    bool zero_known_ = true;  // the node's tare, until a discontinuity
    // A discontinuity during a contact: a reading of zero may since be a held object that was tared. It is no zero until the
    // press has fallen by the threshold of a contact.
    bool held_blind_ = false;
    double max_blind_N_ = 0;
};

}  // namespace tactiled::grasp
