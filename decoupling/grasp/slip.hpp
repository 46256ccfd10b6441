// Detects slip at one jaw: near the limit of friction, or beyond it.
#pragma once
#include <array>
#include <cstdint>

#include "decoupling/grasp/contact.hpp"
#include "decoupling/grasp/friction.hpp"

namespace tactiled::grasp {

class Slip {
public:
    explicit Slip(double friction) : friction_(friction) {}

    // Processes one more sample of the jaw. `settled`: the object is held, so that changes come from transport.
    // rt: bounded by the samples of 7 ms, at most kMax
    void take(const Observation& observation, bool touching, bool settled, double noise_N) noexcept;
    void begin_grasp() noexcept { friction_.begin(); }
    void forget() noexcept;  // after a discontinuity

    [[nodiscard]] tactiled_slip_state state() const noexcept { return state_; }
    [[nodiscard]] std::uint32_t slips() const noexcept { return slips_; }  // number of onsets; never decreases
    [[nodiscard]] double use() const noexcept { return use_; }
    [[nodiscard]] const Friction& friction() const noexcept { return friction_; }
    void sensitivity(double zero_to_one) noexcept;

private:
    // The fall of shear over press from its peak of the last 7 ms, as a part of the peak; and that peak.
    struct Fall {
        double part = 0, peak = 0;
        std::size_t back = 0;  // points since the peak
    };
    [[nodiscard]] Fall fall(double noise_N) const noexcept;
    [[nodiscard]] bool swings(const Fall& fall) const noexcept;

    static constexpr std::size_t kMax = 64;
    struct Point {
        std::uint64_t t_ns = 0;
        double shear_N = 0, press_N = 0;
    };
    std::array<Point, kMax> past_{};
    std::size_t newest_ = 0, n_ = 0;

    Friction friction_;
    double near_ = 0.8, min_fall_ = 0.04;  // at sensitivity 0.5
    double usual_ = 0, falling_ = 0;       // falls during transport; the present one
    double use_ = 0, mean_N_ = 0;          // used part of the limit; mean shear
    std::uint64_t touched_ns_ = 0, slid_ns_ = 0;
    std::uint32_t slips_ = 0;
    tactiled_slip_state state_ = TACTILED_SLIP_UNKNOWN;
};

}  // namespace tactiled::grasp
