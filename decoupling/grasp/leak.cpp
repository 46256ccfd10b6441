#include "decoupling/grasp/leak.hpp"

#include <algorithm>
#include <cmath>

namespace tactiled::grasp {
namespace {

constexpr std::uint64_t kPoint_ns = 5'000'000;
// The load is seen 15 ms after it came to 3 % of the press (grasp.cpp); a lift of 0.3 s begins 60 ms before that.
constexpr std::uint64_t kGuard_ns = 100'000'000, kWindow_ns = 100'000'000;
constexpr std::size_t kLeastPoints = 4;
constexpr double kMoved = 0.02;     // of the press: a new point of the way
constexpr double kFlat = 0.001;     // of the press, by which the clamped shear may drift from half to half: more is a load
constexpr double kMostLeak = 0.03;  // of the press; more is no leak but a force: a table that presses, a hand that holds
constexpr double kMonth_s = 30 * 86400.0;  // assumed, not measured: after so long a leak is as unsure as it is large

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

double sd_at(const Leak& leak, double press_N, double age_s) noexcept {
    if (!(leak.press_N > 0)) return 0;
    const double clamped_N = knot(leak, Leak::kKnots).norm(), u = std::max(0.0, press_N / leak.press_N);
    // A jaw that closed too fast to be followed: between nothing and the clamped press a leak may go any way.
    const double shape_N = leak.followed ? 0 : clamped_N * 4 * u * std::max(0.0, 1 - u);
    const double beyond_N = clamped_N * std::max(0.0, u - 1);
    const double old_N = shear_at(leak, press_N).norm() * std::sqrt(std::max(0.0, age_s) / kMonth_s);
    return std::hypot(std::hypot(leak.sd_N, shape_N), beyond_N, old_N);
}

void Closing::forget() noexcept {
    n_way_ = n_recent_ = 0;
    filling_ = {};
    last_N_ = most_N_ = 0;
    lifted_ = false;
    leak_ = {};
}

void Closing::take(const Feel& feel, bool touching) noexcept {
    if (!touching) {
        if (n_recent_ > 0 || filling_.n > 0) forget();
        return;
    }
    if (lifted_) return;
    if (filling_.n == 0) filling_ = {feel.t_ns, 0, Eigen::Vector2d::Zero(), 0};
    filling_.press_N += feel.press_N;
    for (int k = 0; k < 2; ++k)
        if (std::isfinite(feel.force_S_N[k])) filling_.shear_N[k] += feel.force_S_N[k];  // what is not seen has no leak
    ++filling_.n;
    if (feel.t_ns - filling_.t_ns >= kPoint_ns) close_point();
}

void Closing::close_point() noexcept {
    Point p = filling_;
    filling_ = {};
    p.press_N /= p.n;
    p.shear_N /= p.n;
    newest_ = (newest_ + 1) % kMost;
    recent_[newest_] = p;
    n_recent_ = std::min(n_recent_ + 1, kMost);
    most_N_ = std::max(most_N_, p.press_N);
    if (std::abs(p.press_N - last_N_) < kMoved * most_N_) return;
    if (n_way_ == kMost) {  // a long way: half as fine
        for (std::size_t i = 0; i < kMost / 2; ++i) {
            const Point &a = way_[2 * i], &b = way_[2 * i + 1];
            way_[i] = {a.t_ns, (a.press_N + b.press_N) / 2, (a.shear_N + b.shear_N) / 2, a.n + b.n};
        }
        n_way_ = kMost / 2;
    }
    way_[n_way_++] = p;
    last_N_ = p.press_N;
}

void Closing::lifted(std::uint64_t t_ns) noexcept {
    if (lifted_) return;
    lifted_ = true;
    std::array<Point, kMost> clamped;  // newest first
    std::size_t n = 0;
    for (std::size_t back = 0; back < n_recent_; ++back) {
        const Point& p = recent_[(newest_ + kMost - back) % kMost];
        if (p.t_ns + kGuard_ns < t_ns && p.t_ns + kGuard_ns + kWindow_ns >= t_ns) clamped[n++] = p;
    }
    if (n < kLeastPoints) return;
    const auto mean = [&](std::size_t from, std::size_t to) {
        Point m;
        for (std::size_t i = from; i < to; ++i) {
            m.press_N += clamped[i].press_N / double(to - from);
            m.shear_N += clamped[i].shear_N / double(to - from);
        }
        return m;
    };
    const Point all = mean(0, n);
    double squares_N2 = 0;
    for (std::size_t i = 0; i < n; ++i) squares_N2 += (clamped[i].shear_N - all.shear_N).squaredNorm() / double(n - 1);
    const double drift_N = (mean(0, n / 2).shear_N - mean(n / 2, n).shear_N).norm();
    const double noise_N = std::sqrt(squares_N2 / double(n));
    if (drift_N > std::max(kFlat * all.press_N, 4 * noise_N) || all.shear_N.norm() > kMostLeak * all.press_N) return;
    leak_.press_N = all.press_N;
    leak_.shear_N.back() = {all.shear_N.x(), all.shear_N.y()};
    leak_.sd_N = std::hypot(noise_N, drift_N);
    shape();
}

// Between nothing and the clamped press, by the way there.
void Closing::shape() noexcept {
    constexpr std::size_t kLast = Leak::kKnots - 1;
    std::array<bool, Leak::kKnots> seen{};
    seen[kLast] = true;
    for (std::size_t k = 0; k < kLast; ++k) {
        const double from = (double(k) + 0.5) / double(Leak::kKnots), to = (double(k) + 1.5) / double(Leak::kKnots);
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        int n = 0;
        for (std::size_t i = 0; i < n_way_; ++i) {
            const double part = way_[i].press_N / leak_.press_N;
            if (part < from || part >= to) continue;
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
    // What is off the way at rest is what a skin gives back, and comes and goes from grasp to grasp.
    const Eigen::Vector2d bend = knot(leak_, Leak::kKnots) - 2 * knot(leak_, kLast) + knot(leak_, kLast - 1);
    if (leak_.followed) leak_.sd_N = std::hypot(leak_.sd_N, bend.norm() / 2);
}

}  // namespace tactiled::grasp
