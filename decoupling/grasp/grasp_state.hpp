// The state of the estimator. Only grasp.cpp and record.cpp include it.
#pragma once
#include <cmath>
#include <vector>

#include "decoupling/grasp/contact.hpp"
#include "decoupling/grasp/grasp.hpp"
#include "decoupling/grasp/objects.hpp"
#include "decoupling/grasp/phase.hpp"
#include "decoupling/grasp/slip.hpp"
#include "decoupling/grasp/weight.hpp"

namespace tactiled::grasp {

// An exponentially weighted mean.
struct Low {
    double value = 0;
    void take(double x, double elapsed_s, double time_s) noexcept {
        value += -std::expm1(-elapsed_s / time_s) * (x - value);
    }
};

struct Grasp::State {
    struct Jaw {
        Slip slip;
        std::uint32_t sensor;
        Low quick_N{}, slow_N{};                  // mean press
        Low quick_x_N{}, quick_y_N{};             // mean shear over 10 ms
        double clamped_x_N = 0, clamped_y_N = 0;  // shear at the time of the grasp
        Rest rest{};                              // at rest_ns
        double peak_shear_N = 0;
        std::uint32_t seen_slips = 0;
        std::uint64_t t_ns = 0, ahead_ns = 0;  // ahead: the last rejected time; 0 = none
    };

    explicit State(const Setup& s) : setup(s), weight(s) {
        for (const JawSetup& jaw : s.jaws) {
            contacts.emplace_back(jaw);
            jaws.push_back({Slip(s.friction), jaw.sensor});
        }
    }

    void take(std::size_t j, const JawSample& sample) noexcept;
    [[nodiscard]] bool from_the_future(Jaw& jaw, std::uint64_t sample_ns) const noexcept;
    void follow(std::size_t j) noexcept;
    [[nodiscard]] Seen look() const noexcept;
    [[nodiscard]] bool loaded(std::size_t j) const noexcept;
    [[nodiscard]] Rest rest(std::size_t j) const noexcept;
    void begin_grasp() noexcept;
    void follow_rest() noexcept;
    void act_on() noexcept;

    Setup setup;
    std::vector<Jaw> jaws;
    std::vector<Contact> contacts;  // per jaw, as `jaws`
    Weight weight;
    Phase phase;
    Objects objects;
    Hint hint = Hint::none;
    bool forced = false, stopped = false;  // weighing was begun or ended by a command
    bool loaded_before = false;
    bool begun = false;         // in this grasp
    std::uint64_t rest_ns = 0;  // 0: not at rest
    std::uint64_t t_ns = 0, lift_off_ns = 0;
    std::uint32_t slips = 0, latch = 0;
};

}  // namespace tactiled::grasp
