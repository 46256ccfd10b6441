#include "decoupling/piezo/charge.hpp"

#include <algorithm>

namespace tactiled {

void ChargeFusion::start(double V, double slow) noexcept {
    started_ = true;
    time_s_ = 0;
    last_V_ = V;
    film_ = slow;
    drift_ = correction_ = 0;
    newest_ = held_ = 0;
    keep(0, film_);
}

// Points that are closer than the ring can hold are skipped; a mean over 128 points loses nothing within the
// bandwidth of a window.
void ChargeFusion::keep(double t_s, double film) noexcept {
    if (held_ > 0 && t_s - ring_[newest_].t_s < window_s_ / (kMax / 2.0)) return;
    if (held_ > 0) newest_ = (newest_ + 1) % kMax;
    held_ = std::min(held_ + 1, kMax);
    ring_[newest_] = {t_s, film};
}

// Returns the mean of the film's drive over the last window (or since the start), by trapezia, from now backwards.
double ChargeFusion::mean_of_window() const noexcept {
    double area = 0, later_t = time_s_, later = film_;
    const double begin = std::max(0.0, time_s_ - window_s_);
    for (std::size_t i = 0; i < held_ && later_t > begin; ++i) {
        const Point& point = ring_[(newest_ + kMax - i) % kMax];
        if (point.t_s >= later_t) continue;
        if (point.t_s < begin) {
            const double at_begin = std::lerp(later, point.film, (later_t - begin) / (later_t - point.t_s));
            area += 0.5 * (later + at_begin) * (later_t - begin);
            later_t = begin;
            break;
        }
        area += 0.5 * (later + point.film) * (later_t - point.t_s);
        later_t = point.t_s;
        later = point.film;
    }
    const double width = time_s_ - later_t;
    return width > 0 ? area / width : film_;
}

double ChargeFusion::update(double T_s, double V, double slow, bool is_new) noexcept {
    if (!started_) {
        start(V, slow);
        return film_;
    }
    film_ += LeakStep(T_s, leak_s_).change_of_drive(last_V_, V);
    last_V_ = V;
    time_s_ += T_s;
    keep(time_s_, film_);
    if (is_new && is_settled()) drift_ = slow - mean_of_window();
    if (T_s > 0) correction_ -= std::expm1(-T_s / fusion_s_) * (drift_ - correction_);
    return film_ + correction_;
}

}  // namespace tactiled
