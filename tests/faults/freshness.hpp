// A device, the way to this machine, and what the product makes of the frames: for hours of simulated time in seconds. The
// true time of each frame is known.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>

#include "drivers/wire/stream_age.hpp"

namespace tactiled::faults {

struct Stream {
    double rate_Hz = 100;
    bool clock = true, sequence = true;
    double ppm = 0, temperature_ppm = 0;  // rate error of the device's clock; its steps each half hour
    double jitter_ms = 20, grid_ms = 16;  // evenly distributed delay of the path; period of a USB adapter's polls
    Route::Path path = Route::Path::network;
    bool reopening_discards = false;  // and the link is opened again when that is asked for
    double stale_ms = 100;
};

// One frame as a reader sees it right after it came.
struct Seen {
    double true_age_ms = 0, claimed_age_ms = 0;
    bool good = false, bad = false;
};

struct Tally {
    std::uint64_t frames = 0, good = 0, uncertain = 0, bad = 0, reopened = 0;
    // GOOD and older than stale_ms by more than the path's ordinary delay; the same where every frame that comes is GOOD.
    std::uint64_t wrong = 0, wrong_before = 0;
    double worst_ms = 0;  // true age of the oldest of these
    // Frames that were not GOOD though they were young enough.
    std::uint64_t alarms = 0;
};

class FreshnessRun {
public:
    FreshnessRun(const Stream& stream, std::uint64_t seed)
        : stream_(stream),
          random_(seed),
          age_(stream.rate_Hz, 0.2, std::uint64_t(stream.stale_ms * 1e6)),
          sequence_(std::uint32_t(random_())),
          offset_us_(double(random_() % 4'000'000'000u)) {
        open();
    }

    // The path keeps what is sent from now on until then, and releases it at once.
    void hold_until(double t_s) { hold_until_s_ = t_s; }
    bool pauses = false;        // the device measures and sends nothing
    bool forwards_old = false;  // its next frame is one of a second ago under a new number
    double drop = 0, swap = 0;  // rates
    double extra_lag_s = 0;     // a bridge that is as fast as the device and has a backlog
    double clock_jump_us = 0;   // added to the device's clock once
    // Called with each frame that arrives.
    std::function<void(const Seen&, double t_s)> see;

    // The link is opened again; what is on the way stays there, as its lag does.
    void reopen(double lag_s) {
        extra_lag_s = lag_s;
        closed_until_s_ = now_s_ + 0.05;
        open();
    }

    [[nodiscard]] double now_s() const { return now_s_; }
    Tally tally;

    void run_s(double s) {
        for (const double end = now_s_ + s; now_s_ < end;) step();
    }

private:
    struct Sent {
        double measured_s, arrives_s;
        std::uint32_t sequence;
        std::uint64_t device_us;
    };

    void open() {
        age_.open({stream_.path, true, stream_.reopening_discards, 200});
        opening_ = true;
    }

    double uniform() { return double(random_() >> 11) * 0x1p-53; }

    void step() {
        const double period_s = 1 / stream_.rate_Hz;
        if (now_s_ > next_temperature_s_) {
            temperature_ = stream_.temperature_ppm * (temperature_ > 0 ? 0 : 1);
            next_temperature_s_ = now_s_ + 1800;
        }
        now_s_ += period_s;
        device_us_ += period_s * 1e6 * (1 + (stream_.ppm + temperature_) * 1e-6) + clock_jump_us;
        clock_jump_us = 0;
        if (!pauses && uniform() >= drop)
            send();
        else if (!pauses)
            ++sequence_;
        while (!way_.empty() && way_.front().arrives_s <= now_s_) {
            if (now_s_ < hold_until_s_) break;
            const Sent first = way_.front();
            way_.pop_front();
            const double at_s = std::max({first.arrives_s, last_s_ + 1e-6, hold_until_s_});
            arrive(first, at_s);
        }
        // The link's thread looks each period, too.
        if (stream_.reopening_discards && age_.asks_for_reopening(std::uint64_t(now_s_ * 1e9)) && now_s_ > not_before_s_) {
            ++tally.reopened;
            not_before_s_ = now_s_ + 1;
            closed_until_s_ = now_s_ + 0.05;
            way_.clear();
            extra_lag_s = 0;
            open();
        }
    }

    void send() {
        double arrives = now_s_ + 0.002 + extra_lag_s + uniform() * stream_.jitter_ms * 1e-3;
        if (stream_.grid_ms > 0) arrives = std::ceil(arrives / (stream_.grid_ms * 1e-3)) * stream_.grid_ms * 1e-3;
        arrives = std::max(arrives, way_.empty() ? 0 : way_.back().arrives_s);
        Sent sent{now_s_, arrives, sequence_++, std::uint64_t(device_us_ + offset_us_)};
        past_.push_back(sent);
        if (past_.size() > 200) past_.pop_front();
        if (forwards_old && past_.size() > 100) {  // its number is new, what it carries is not
            const Sent& old = past_[past_.size() - 100];
            sent.measured_s = old.measured_s;
            sent.device_us = old.device_us;
            forwards_old = false;
        }
        way_.push_back(sent);
        if (uniform() < swap && way_.size() >= 2) std::swap(way_[way_.size() - 1], way_[way_.size() - 2]);
    }

    void arrive(const Sent& sent, double at_s) {
        last_s_ = at_s;
        if (at_s < closed_until_s_) return;
        Frame frame;
        const std::uint32_t ahead = sent.sequence - before_ - 1;
        if (stream_.sequence && !opening_ && ahead > 0x7FFFFFFF) return;  // overtaken: the format drops it
        frame.has_sequence = stream_.sequence;
        frame.sequence = sent.sequence;
        frame.lost = stream_.sequence && !opening_ ? ahead : 0;
        // The formats send 32 bits, which the decoders extend while the link stays open.
        const auto elapsed_us = std::int32_t(std::uint32_t(sent.device_us) - std::uint32_t(device_us_seen_));
        device_us_seen_ =
            opening_ || elapsed_us < 0 ? std::uint32_t(sent.device_us) : device_us_seen_ + std::uint32_t(elapsed_us);
        frame.device_time_us = stream_.clock ? device_us_seen_ | 1 : 0;
        before_ = sent.sequence;
        opening_ = false;
        frame.t_ns = frame.taken_ns = std::uint64_t(at_s * 1e9);
        age_.judge(frame, frame.taken_ns);
        Seen seen;
        seen.true_age_ms = (at_s - sent.measured_s) * 1e3;
        seen.claimed_age_ms = double(frame.taken_ns - frame.t_ns) * 1e-6;
        seen.bad = double(std::max(frame.late_ns, frame.taken_ns - frame.t_ns)) * 1e-6 > stream_.stale_ms;
        seen.good = !seen.bad && frame.age != Frame::Age::unproved;
        ++tally.frames;
        ++(seen.bad ? tally.bad : seen.good ? tally.good : tally.uncertain);
        // The least delay of the path, its polls and its jitter are no lag.
        const double normal_ms = 2 + stream_.jitter_ms + stream_.grid_ms + 1000 / stream_.rate_Hz;
        const bool is_old = seen.true_age_ms > stream_.stale_ms + normal_ms;
        tally.wrong_before += is_old;
        tally.alarms += !seen.good && seen.true_age_ms < stream_.stale_ms - normal_ms;
        if (seen.good && is_old) {
            ++tally.wrong;
            tally.worst_ms = std::max(tally.worst_ms, seen.true_age_ms);
        }
        if (see) see(seen, at_s);
    }

    Stream stream_;
    std::mt19937_64 random_;
    StreamAge age_;
    std::uint32_t sequence_, before_ = 0;
    std::uint64_t device_us_seen_ = 0;
    double offset_us_, now_s_ = 1000, device_us_ = 0, temperature_ = 0, next_temperature_s_ = 0;
    double hold_until_s_ = 0, last_s_ = 0, not_before_s_ = 0, closed_until_s_ = 0;
    bool opening_ = true;
    std::deque<Sent> way_, past_;
};

}  // namespace tactiled::faults
