// Chooses one of several methods from the durations of its samples: one step down when the budget is missed, one step up
// after calm. The inputs are durations only.
//
// Missed: more than 1 in 8 of up to 64 timed samples took longer than the budget. One preemption is one sample; a busy
// program, a slower clock or cold caches affect all samples, and nine are enough to act. Calm: in each 64 consecutive timed
// samples at least 7 in 8 leave room for the next method up: its share of the measured costs times the duration of this
// sample is within 80 % of the budget. A step up follows after 10 s of calm. A step up that failed doubles the time before
// the next one onto the same method, up to an hour, until the method has run for an hour. There are at most 8 steps up onto
// a method in any hour, and one per hour in the long run under any load: 17 steps per hour between two neighbours.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace tactiled {

class MethodChoice {
public:
    static constexpr std::size_t kMax = 8;
    static constexpr unsigned kWindow = 64, kMaxOver = kWindow / 8;
    static constexpr double kRoom = 0.8;
    static constexpr std::uint64_t kSecond = 1'000'000'000, kCalmNs = 10 * kSecond, kHourNs = 3600 * kSecond;

    // `us`: expected duration of a sample of each method, most accurate first, decreasing; 1 .. kMax of them. Begins
    // with the first within the budget, else with the last. setup
    MethodChoice(std::span<const double> us, double budget_us);

    // Takes the duration of a sample at `t_ns`, made by the method now(). rt: wait-free
    void took(std::uint64_t ns, std::uint64_t t_ns) noexcept;

    [[nodiscard]] std::size_t now() const noexcept { return now_; }
    [[nodiscard]] std::size_t first() const noexcept { return first_; }
    [[nodiscard]] std::uint32_t steps() const noexcept { return steps_; }  // down and up so far
    // True if there is no faster method left and this one misses the budget.
    [[nodiscard]] bool is_over_budget() const noexcept { return over_budget_; }

private:
    void step_down(std::uint64_t t_ns) noexcept;
    void step_up(std::uint64_t t_ns) noexcept;
    void begin_window() noexcept { timed_ = over_ = tight_ = 0; }

    std::size_t n_, now_, first_;
    double budget_us_;
    std::array<double, kMax> up_ratio_{};        // for method i: us[i - 1] / us[i]
    std::array<std::uint64_t, kMax> wait_ns_;    // time of calm before a step up onto method i
    std::array<bool, kMax> came_up_{};           // method i was entered by a step up and has not been left downwards since
    unsigned timed_ = 0, over_ = 0, tight_ = 0;  // in the present window
    bool begun_ = false, over_budget_ = false;
    std::uint64_t calm_since_ns_ = 0, step_ns_ = 0;
    std::uint32_t steps_ = 0;
};

}  // namespace tactiled
