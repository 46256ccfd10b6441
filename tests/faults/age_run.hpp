// A device, a gateway with its own timer and queue, and the bound of the age that the product computes: hours of simulated
// time in seconds. The true time of each frame is known.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>

#include "drivers/wire/stream_age.hpp"

namespace tactiled::faults {

// A gateway discards or keeps its queue when the connection is opened.
enum class AtOpening : std::uint8_t { discards, keeps };

struct AgeScene {
    double period_s = 0.01, stale_s = 0.1;
    bool clock = true, number = true;
    bool tcp = true, echo = false;
    bool is_cable = false;
    double ppm = 0;             // the device's clock, and its rate, against this machine
    double declared_ppm = 200;  // clock_ppm
    double jitter_s = 0.002;    // evenly distributed delay of the path
    double gateway_s = 0;       // the gateway forwards one frame in this time of its own timer; 0: at once
    double cap = 1e12;          // frames that its queue holds; it drops the oldest ones
    int at_once = 0;            // frames that it forwards without its timer after an opening
    AtOpening at_opening = AtOpening::discards;
    // The device's next measurement after that at `t_s`, in s; default: its period.
    std::function<double(double t_s)> interval = nullptr;
    // The path holds what comes at `t_s` until the result.
    std::function<double(double t_s)> hold = nullptr;
};

struct AgeTally {
    double seconds = 0, young_s = 0;  // duration; the part with a frame younger than stale_ms
    double old_s = 0, oldest_s = 0;   // GOOD and older than stale_ms + 50 ms
    double doubt_s = 0;               // not GOOD though younger than stale_ms
    std::uint64_t doubts = 0, openings = 0, frames = 0, lost = 0;
};

class AgeRun {
public:
    AgeRun(const AgeScene& scene, std::uint64_t seed)
        : scene_(scene), random_(seed), age_(std::uint64_t(scene.stale_s * 1e9)) {
        clock_s_ = 0.2 + uniform() * 4000;
        open(0);
    }

    AgeTally run(double seconds) {
        const double end_s = now_s_ + seconds;
        while (now_s_ < end_s) {
            const double tick_s = queue_.empty() ? 1e300 : std::max(tick_s_, queue_.front().at_s);
            const double echo_s = scene_.echo ? echo_s_ : 1e300;
            const double next_s = std::min({measure_s_, tick_s, echo_s});
            now_s_ = next_s;
            if (next_s == echo_s)
                ask_for_echo();
            else if (next_s == measure_s_)
                measure();
            else
                forward();
            ask();
        }
        tally.seconds += seconds;
        return tally;
    }
    [[nodiscard]] double now_s() const { return now_s_; }
    // Returns true if the newest frame is GOOD.
    [[nodiscard]] bool is_good() const { return was_good_; }
    AgeTally tally;

private:
    struct Item {
        double measured_s, at_s;  // when it was measured, and when it reached the gateway
        std::uint32_t number;
        std::uint32_t device_us;
        double asked_s = 0;  // > 0: an answer to a request
    };

    double uniform() { return double(random_() >> 11) * 0x1p-53; }
    [[nodiscard]] std::uint64_t ns(double t_s) const { return std::uint64_t(t_s * 1e9); }

    void open(std::uint64_t wanted_ns) {
        const Route::Path path = scene_.is_cable ? Route::Path::direct : Route::Path::network;
        age_.open({.path = path,
                   .device_clock = true,
                   .reopening_discards = scene_.tcp,
                   .has_echo = scene_.echo,
                   .clock_ppm = scene_.declared_ppm,
                   .is_assumed = scene_.is_cable},
                  wanted_ns);
        is_first_ = true;
    }

    [[nodiscard]] std::uint32_t device_us(double t_s) const {
        return std::uint32_t(std::uint64_t((t_s * (1 + scene_.ppm * 1e-6) + clock_s_) * 1e6)) | 1u;
    }

    void measure() {
        const double at_s = now_s_ + 0.0005 + uniform() * scene_.jitter_s;
        enqueue({now_s_, at_s, ++number_, device_us(now_s_)});
        const double interval_s = scene_.interval ? scene_.interval(now_s_) : scene_.period_s / (1 + scene_.ppm * 1e-6);
        measure_s_ = now_s_ + interval_s;
    }

    // As drivers/uart.cpp: one request at a time, repeated after 2 s; more often while no frame comes.
    void ask_for_echo() {
        echo_s_ = now_s_ + 0.01;
        const bool is_answered = echo_answered_s_ >= echo_asked_s_, is_silent = now_s_ - last_s_ > 0.025;
        if (now_s_ - echo_asked_s_ < (!is_answered ? 2 : is_silent ? 0.025 : 0.2)) return;
        echo_asked_s_ = now_s_;
        const double answers_s = now_s_ + 0.001;
        enqueue({answers_s, answers_s + 0.0005 + uniform() * scene_.jitter_s, 0, device_us(answers_s), now_s_});
    }

    void enqueue(Item item) {
        if (scene_.hold) item.at_s = std::max(item.at_s, scene_.hold(now_s_));
        item.at_s = std::max(item.at_s, last_at_s_);
        last_at_s_ = item.at_s;
        queue_.push_back(item);
        if (double(queue_.size()) > scene_.cap) queue_.pop_front();
    }

    void forward() {
        tick_s_ = now_s_ + scene_.gateway_s;
        if (now_s_ < closed_until_s_) {
            if (scene_.at_opening == AtOpening::discards) {
                tally.lost += queue_.size();
                queue_.clear();
            }
            return;
        }
        if (at_once_ > 0) --at_once_, tick_s_ = now_s_;
        const Item item = queue_.front();
        queue_.pop_front();
        arrive(item, now_s_);
    }

    void arrive(const Item& item, double at_s) {
        if (at_s < closed_until_s_) {
            ++tally.lost;
            return;
        }
        if (item.asked_s > 0) {
            if (item.asked_s != echo_asked_s_) return;
            asked_s_ = item.asked_s;
            echo_answered_s_ = at_s;
            answered_us_ = item.device_us;
            return;
        }
        Frame frame;
        frame.has_sequence = scene_.number;
        frame.sequence = item.number;
        frame.lost = scene_.number && !is_first_ ? item.number - before_ - 1 : 0;
        frame.device_time_us = scene_.clock ? item.device_us : 0;
        frame.t_ns = frame.taken_ns = ns(at_s);
        frame.asked_ns = ns(std::exchange(asked_s_, 0));
        frame.answered_us = answered_us_;
        is_first_ = false;
        before_ = item.number;
        age_.judge(frame, frame.taken_ns, frame.asked_ns);
        const bool is_late = double(std::max(frame.late_ns, frame.taken_ns - frame.t_ns)) * 1e-9 > scene_.stale_s;
        const bool is_good = !is_late && frame.age != Frame::Age::unproved;
        // A reader sees the frame before this one until now, or until it is stale.
        const double lasts_s = std::min(at_s - last_s_, scene_.stale_s);
        if (was_young_) tally.young_s += lasts_s;
        if (was_young_ && !was_good_) tally.doubt_s += lasts_s;
        if (was_old_) tally.old_s += std::max(lasts_s, 1e-4);
        const double true_s = at_s - item.measured_s;
        const bool is_young = true_s < scene_.stale_s;
        if (is_young && !is_good && was_good_) ++tally.doubts;
        was_old_ = is_good && true_s > scene_.stale_s + 0.05;
        if (was_old_) tally.oldest_s = std::max(tally.oldest_s, true_s);
        was_young_ = is_young;
        was_good_ = is_good;
        last_s_ = at_s;
        ++tally.frames;
    }

    // The link's thread.
    void ask() {
        const std::uint64_t now_ns = ns(now_s_);
        if (now_s_ < closed_until_s_ || !age_.may_ask() || now_s_ < opening_s_ + (age_.keeps() ? 60 : pause_s_)) return;
        if (!age_.asks_for_reopening(now_ns, false)) return;
        pause_s_ = std::exchange(proofs_, age_.proofs()) != age_.proofs() ? 1 : std::min(2 * pause_s_, 8.0);
        opening_s_ = now_s_;
        ++tally.openings;
        closed_until_s_ = now_s_ + double(age_.closed_ns()) * 1e-9 + 0.002;
        open(ns(closed_until_s_));
        at_once_ = scene_.at_once;
    }

    AgeScene scene_;
    std::mt19937_64 random_;
    StreamAge age_;
    std::deque<Item> queue_;
    double now_s_ = 1000, measure_s_ = 1000, tick_s_ = 0, last_at_s_ = 0, last_s_ = 1000, clock_s_, echo_s_ = 1000,
           asked_s_ = 0;
    double echo_asked_s_ = 0, echo_answered_s_ = 0;
    int at_once_ = 0;  // frames left of this opening
    double closed_until_s_ = 0, opening_s_ = -1e9, pause_s_ = 1;
    std::uint32_t proofs_ = 0, number_ = 0, before_ = 0, answered_us_ = 0;
    bool is_first_ = true, was_good_ = true, was_young_ = true, was_old_ = false;
};

}  // namespace tactiled::faults
