// Chooses one of several methods from the times of its samples: down a step where the budget is missed, up a step after
// calm. Knows times alone, no method and no clock.
//
// Missed: more than 1 in 8 of up to 64 timed samples took longer than the budget. One preemption is one sample; a hog, a
// slower clock or cold caches are all of them, and nine are enough to act. Calm: of each 64 timed samples in a row at least
// 7 in 8 leave room for the next method up: its share of the measured costs times what this one took is within 80 % of the
// budget. Up after 10 s of that; a step up that failed makes the next one onto the same method wait twice as long, up to an
// hour, until it has run for an hour. Onto a method there are at most 8 steps up in any hour, and one an hour in the long
// run, whatever the load does: 17 steps an hour between two neighbours.
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

    // `us`: what a sample of each method is expected to take, most accurate first, falling; 1 .. kMax of them. Begins with
    // the first within the budget, else with the last. setup
    MethodChoice(std::span<const double> us, double budget_us);

    // A sample at `t_ns`, made by the method now(), took so long. rt: wait-free
    void took(std::uint64_t ns, std::uint64_t t_ns) noexcept;

    [[nodiscard]] std::size_t now() const noexcept { return now_; }
    [[nodiscard]] std::size_t first() const noexcept { return first_; }
    [[nodiscard]] std::uint32_t steps() const noexcept { return steps_; }  // down and up so far
    // No method is left that is faster, and this one misses the budget.
    [[nodiscard]] bool is_over_budget() const noexcept { return over_budget_; }

private:
    void step_down(std::uint64_t t_ns) noexcept;
    void step_up(std::uint64_t t_ns) noexcept;
    void begin_window() noexcept { timed_ = over_ = tight_ = 0; }

    std::size_t n_, now_, first_;
    double budget_us_;
    std::array<double, kMax> up_ratio_{};        // of method i: us[i - 1] / us[i]
    std::array<std::uint64_t, kMax> wait_ns_;    // calm before a step up onto method i
    std::array<bool, kMax> came_up_{};           // method i was entered by a step up, and not left downwards since
    unsigned timed_ = 0, over_ = 0, tight_ = 0;  // of the window
    bool begun_ = false, over_budget_ = false;
    std::uint64_t calm_since_ns_ = 0, step_ns_ = 0;
    std::uint32_t steps_ = 0;
};

}  // namespace tactiled
