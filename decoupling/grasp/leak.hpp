// What a jaw's press leaks into its shear: seen while it closes about an object that stands freely and is clamped, before
// the lift. Frame S.
#pragma once
#include <array>
#include <cstdint>

#include "decoupling/grasp/contact.hpp"

namespace tactiled::grasp {

// Shear of the leak at this press, piecewise linear; beyond the press that it was learnt at it stays. 0: none was learnt.
[[nodiscard]] Eigen::Vector2d shear_at(const Leak& leak, double press_N) noexcept;
// How far off that may be, one sd, when it was learnt so long ago.
[[nodiscard]] double sd_at(const Leak& leak, double press_N, double age_s) noexcept;

// One jaw's grasp from touch to lift.
class Closing {
public:
    // Every sample with a value, before and after the lift. rt: bounded by kMost
    void take(const Feel& feel, bool touching) noexcept;
    void forget() noexcept;  // a break
    // The load came: what was before it shows the leak, if the jaw was clamped and at rest. rt: bounded by kMost
    void lifted(std::uint64_t t_ns) noexcept;
    // Of this grasp; press_N = 0: not seen.
    [[nodiscard]] const Leak& leak() const noexcept { return leak_; }

private:
    struct Point {
        std::uint64_t t_ns = 0;
        double press_N = 0;
        Eigen::Vector2d shear_N = Eigen::Vector2d::Zero();
        int n = 0;
    };
    void close_point() noexcept;
    void shape() noexcept;

    static constexpr std::size_t kMost = 64;
    std::array<Point, kMost> way_{};     // of the closing, a point each time that the press has moved
    std::array<Point, kMost> recent_{};  // ring of the newest 5 ms
    std::size_t n_way_ = 0, newest_ = 0, n_recent_ = 0;
    Point filling_;
    double last_N_ = 0, most_N_ = 0;  // press of the newest of way_; largest so far
    bool lifted_ = false;
    Leak leak_;
};

}  // namespace tactiled::grasp
