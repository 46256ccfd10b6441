#include "decoupling/grasp/leak.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled::grasp {
namespace {

constexpr std::uint64_t kPoint_ns = 5'000'000;
// The load is seen 15 ms after it came to 3 % of the press (grasp.cpp); a lift of 0.3 s begins 60 ms before that.
constexpr std::uint64_t kGuard_ns = 100'000'000;
// The beginning of the rest, not its end: a slow lift has added least there.
constexpr std::uint64_t kRest_ns = 400'000'000;
constexpr std::size_t kLeastPoints = 6;  // of a straight line with a scatter of four degrees of freedom
constexpr double kMoved = 0.02;          // of the press: a new point of the way
constexpr double kAtRest = 0.01;         // of the press: more is no rest
constexpr double kNoises = 3;
constexpr double kMostLeak = 0.03;  // of the press; more is no leak but a force: a table that presses, a hand that holds

Eigen::Vector2d knot(const Leak& leak, std::size_t k) noexcept {
    return k == 0 ? Eigen::Vector2d::Zero() : Eigen::Vector2d(leak.shear_N[k - 1][0], leak.shear_N[k - 1][1]);
}

}  // namespace

Eigen::Vector2d shear_at(const Leak& leak, double press_N) noexcept {
    if (!(leak.press_N > 0) || !(press_N > 0)) return Eigen::Vector2d::Zero();
    const double at = std::min(press_N / leak.press_N, 1.0) * double(Leak::kKnots);
    const std::size_t k = std::min(std::size_t(at), Leak::kKnots - 1);
    return knot(leak, k) + (at - double(k)) * (knot(leak, k + 1) - knot(leak, k));
}

double shape_sd_N(const Leak& leak, double press_N) noexcept {
    if (!(leak.press_N > 0)) return 0;
    const double clamped_N = knot(leak, Leak::kKnots).norm(), u = std::max(0.0, press_N / leak.press_N);
    // What is off the way at rest is what a skin gives back: half of it may be missing at any press but the clamped one.
    const Eigen::Vector2d bend = knot(leak, Leak::kKnots) - 2 * knot(leak, Leak::kKnots - 1) + knot(leak, Leak::kKnots - 2);
    const double bent_N = bend.norm() / 2 * std::min({1.0, 4 * u, std::max(0.0, 4 * (1 - u))});
    // A jaw that closed too fast to be followed: between nothing and the clamped press a leak may go any way.
    const double between_N = leak.followed ? bent_N : clamped_N * 4 * u * std::max(0.0, 1 - u);
    return std::hypot(between_N, clamped_N * std::max(0.0, u - 1));
}

void Closing::forget() noexcept {
    n_way_ = n_rest_ = 0;
    filling_ = {};
    last_N_ = most_N_ = 0;
    touched_ns_ = 0;
    lifted_ = false;
    leak_ = {};
}

void Closing::take(const Feel& feel, const Contact& contact) noexcept {
    if (!contact.touching()) {
        if (touched_ns_ > 0) forget();
        return;
    }
    if (lifted_) return;
    if (touched_ns_ == 0) touched_ns_ = feel.t_ns;
    if (filling_.n == 0) filling_ = {feel.t_ns, 0, Eigen::Vector2d::Zero(), 0};
    filling_.press_N += feel.press_N;
    for (int k = 0; k < 2; ++k)
        if (std::isfinite(feel.force_S_N[k])) filling_.shear_N[k] += feel.force_S_N[k];  // what is not seen has no leak
    ++filling_.n;
    if (feel.t_ns - filling_.t_ns >= kPoint_ns) close_point(contact);
}

void Closing::close_point(const Contact& contact) noexcept {
    Point p = filling_;
    filling_ = {};
    p.press_N /= p.n;
    p.shear_N /= p.n;
    noise_N_ = std::max(contact.noise_N(0), contact.noise_N(1));
    const double off_N = kNoises * contact.noise_N(2) + kAtRest * p.press_N;
    if (n_rest_ == 0 || std::abs(p.press_N - rest_[0].press_N) > off_N) {
        rest_[0] = p;
        n_rest_ = 1;
    } else if (n_rest_ < kMost && p.t_ns - rest_[0].t_ns <= kRest_ns) {
        rest_[n_rest_++] = p;
    }
    most_N_ = std::max(most_N_, p.press_N);
    if (std::abs(p.press_N - last_N_) < kMoved * most_N_) return;
    if (n_way_ == kMost) {  // a long way: half as fine
        for (std::size_t i = 0; i < kMost / 2; ++i) {
            const Point &a = way_[2 * i], &b = way_[2 * i + 1];
            way_[i] = {b.t_ns, (a.press_N + b.press_N) / 2, (a.shear_N + b.shear_N) / 2, a.n + b.n};
        }
        n_way_ = kMost / 2;
    }
    way_[n_way_++] = p;
    last_N_ = p.press_N;
}

// A straight line through the beginning of the rest: its end is the leak, for a skin gives back. A lift that is too slow to
// be seen as a load would be taken for one, too, so that its slope since the touch, or what noise leaves of one to be seen,
// is in the sd.
void Closing::lifted(std::uint64_t t_ns) noexcept {
    if (lifted_) return;
    lifted_ = true;
    const std::uint64_t until_ns = t_ns - std::min(t_ns, kGuard_ns);
    while (n_rest_ > 0 && rest_[n_rest_ - 1].t_ns + kPoint_ns > until_ns) --n_rest_;
    if (n_rest_ < kLeastPoints) return;
    const auto n = double(n_rest_);
    double t_s = 0, press_N = 0, times_s2 = 0, squares_N2 = 0, samples = 0;
    Eigen::Vector2d shear_N = Eigen::Vector2d::Zero(), slope_N_s = Eigen::Vector2d::Zero();
    const auto seconds = [&](const Point& p) { return double(p.t_ns - touched_ns_) * 1e-9; };
    for (std::size_t i = 0; i < n_rest_; ++i) {
        t_s += seconds(rest_[i]) / n;
        press_N += rest_[i].press_N / n;
        shear_N += rest_[i].shear_N / n;
        samples += rest_[i].n / n;
    }
    for (std::size_t i = 0; i < n_rest_; ++i) {
        const double off_s = seconds(rest_[i]) - t_s;
        times_s2 += off_s * off_s;
        slope_N_s += off_s * (rest_[i].shear_N - shear_N);
    }
    if (!(times_s2 > 0)) return;
    slope_N_s /= times_s2;
    for (std::size_t i = 0; i < n_rest_; ++i)
        squares_N2 += (rest_[i].shear_N - shear_N - (seconds(rest_[i]) - t_s) * slope_N_s).squaredNorm() / 2;
    // Of one component of a point. n - 4 for n - 2: few points scatter too little as often as too much. And no less than in
    // the free phase.
    const double scatter_N = std::max(std::sqrt(squares_N2 / (n - 4)), noise_N_ / std::sqrt(samples));
    const double rate_N_s = std::max(slope_N_s.norm(), scatter_N / std::sqrt(times_s2));
    const double last_s = seconds(rest_[n_rest_ - 1]), after_s = last_s - t_s;
    shear_N += after_s * slope_N_s;
    if (!(press_N > 0) || shear_N.norm() > kMostLeak * press_N) return;
    leak_.press_N = press_N;
    leak_.shear_N.back() = {shear_N.x(), shear_N.y()};
    leak_.sd_N = std::hypot(scatter_N * std::sqrt(1 / n + after_s * after_s / times_s2), rate_N_s * last_s);
    shape(until_ns);
}

// Between nothing and the clamped press, by the way there.
void Closing::shape(std::uint64_t until_ns) noexcept {
    constexpr std::size_t kLast = Leak::kKnots - 1;
    std::array<bool, Leak::kKnots> seen{};
    seen[kLast] = true;
    for (std::size_t k = 0; k < kLast; ++k) {
        const double from = (double(k) + 0.5) / double(Leak::kKnots), to = (double(k) + 1.5) / double(Leak::kKnots);
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        int n = 0;
        for (std::size_t i = 0; i < n_way_; ++i) {
            const double part = way_[i].press_N / leak_.press_N;
            if (part < from || part >= to || way_[i].t_ns + kPoint_ns > until_ns) continue;
            sum += way_[i].shear_N;
            ++n;
        }
        seen[k] = n > 0;
        if (n > 0) leak_.shear_N[k] = {sum.x() / n, sum.y() / n};
    }
    leak_.followed = std::count(seen.begin(), seen.end(), true) >= std::ptrdiff_t(Leak::kKnots) - 2;
    for (std::size_t k = 0; k < kLast; ++k) {
        if (seen[k]) continue;
        std::size_t next = k;
        while (!seen[next]) ++next;
        const Eigen::Vector2d a = knot(leak_, k), b = knot(leak_, next + 1);  // `a` was seen, or filled just now
        const Eigen::Vector2d v = a + (b - a) / double(next + 1 - k);
        leak_.shear_N[k] = {v.x(), v.y()};
    }
}

}  // namespace tactiled::grasp
