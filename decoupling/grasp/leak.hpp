// What a jaw's press leaks into its shear: seen while it closes about an object that stands freely and is clamped, before
// the lift. Frame S.
#pragma once
#include <array>
#include <cstdint>

#include "decoupling/grasp/contact.hpp"

namespace tactiled::grasp {

// Shear of the leak at this press, piecewise linear; beyond the press that it was learnt at it stays. 0: none was learnt.
[[nodiscard]] Eigen::Vector2d shear_at(const Leak& leak, double press_N) noexcept;
// How far the curve between nothing and leak.press_N, and beyond it, may be off that shape, one sd; what leak.sd_N says of
// the whole is not in it.
[[nodiscard]] double shape_sd_N(const Leak& leak, double press_N) noexcept;

// One jaw's grasp from touch to lift.
class Closing {
public:
    // Every sample with a value, before and after the lift. rt: bounded by kMost
    void take(const Feel& feel, const Contact& contact) noexcept;
    void forget() noexcept;  // a break
    // The load was seen: what was before it shows the leak, if the jaw was clamped and at rest. rt: bounded by kMost
    void lifted(std::uint64_t t_ns) noexcept;
    // Of this grasp; press_N = 0: not seen.
    [[nodiscard]] const Leak& leak() const noexcept { return leak_; }

private:
    struct Point {
        std::uint64_t t_ns = 0;  // of its first sample
        double press_N = 0;
        Eigen::Vector2d shear_N = Eigen::Vector2d::Zero();
        int n = 0;
    };
    void close_point(const Contact& contact) noexcept;
    void shape(std::uint64_t until_ns) noexcept;

    static constexpr std::size_t kMost = 80;
    std::array<Point, kMost> way_{};   // of the closing, a point each time that the press has moved
    std::array<Point, kMost> rest_{};  // the beginning of the rest after it
    std::size_t n_way_ = 0, n_rest_ = 0;
    Point filling_;
    double last_N_ = 0, most_N_ = 0;  // press of the newest of way_; largest so far
    double noise_N_ = 0;              // of a sample's shear in the free phase
    std::uint64_t touched_ns_ = 0;
    bool lifted_ = false;
    Leak leak_;
};

}  // namespace tactiled::grasp
