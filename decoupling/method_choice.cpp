#include "decoupling/method_choice.hpp"

#include <algorithm>
#include <cassert>

namespace tactiled {
namespace {

// Returns 0 if the clock went back.
std::uint64_t elapsed_ns(std::uint64_t since_ns, std::uint64_t t_ns) noexcept {
    return t_ns > since_ns ? t_ns - since_ns : 0;
}

}  // namespace

MethodChoice::MethodChoice(std::span<const double> us, double budget_us) : n_(us.size()), budget_us_(budget_us) {
    assert(n_ >= 1 && n_ <= kMax);
    now_ = std::size_t(std::find_if(us.begin(), us.end() - 1, [&](double each) { return each <= budget_us; }) - us.begin());
    first_ = now_;
    over_budget_ = us[now_] > budget_us;
    for (std::size_t i = 1; i < n_; ++i) up_ratio_[i] = us[i - 1] / us[i];
    wait_ns_.fill(kCalmNs);
}

void MethodChoice::took(std::uint64_t ns, std::uint64_t t_ns) noexcept {
    if (!begun_) calm_since_ns_ = step_ns_ = t_ns;
    begun_ = true;
    const double us = 1e-3 * double(ns);
    ++timed_;
    if (us > budget_us_) ++over_;
    if (us * up_ratio_[now_] > kRoom * budget_us_) ++tight_;
    if (over_ > kMaxOver) return step_down(t_ns);
    if (timed_ < kWindow) return;
    over_budget_ = false;
    const bool calm = tight_ <= kMaxOver;
    begin_window();
    if (elapsed_ns(step_ns_, t_ns) >= kHourNs) wait_ns_[now_] = kCalmNs;
    if (!calm)
        calm_since_ns_ = t_ns;
    else if (now_ > 0 && elapsed_ns(calm_since_ns_, t_ns) >= wait_ns_[now_ - 1])
        step_up(t_ns);
}

void MethodChoice::step_down(std::uint64_t t_ns) noexcept {
    begin_window();
    calm_since_ns_ = t_ns;
    if (now_ + 1 == n_) {
        over_budget_ = true;
        return;
    }
    if (came_up_[now_]) wait_ns_[now_] = std::min(2 * wait_ns_[now_], kHourNs);
    came_up_[now_] = false;
    ++now_;
    ++steps_;
    step_ns_ = t_ns;
}

void MethodChoice::step_up(std::uint64_t t_ns) noexcept {
    --now_;
    came_up_[now_] = true;
    ++steps_;
    step_ns_ = calm_since_ns_ = t_ns;
}

}  // namespace tactiled
