// A device, the way to this machine, and what the product makes of the frames: for hours of simulated time in seconds. The
// true time of each frame is known.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>

#include "drivers/wire/ascii_line.hpp"
#include "drivers/wire/cobs_frame.hpp"
#include "drivers/wire/stream_age.hpp"

namespace tactiled::faults {

struct Stream {
    double rate_Hz = 100, declared = 1;  // declared: the share of it that the configuration states; 0: nothing
    bool clock = true, sequence = true;
    double ppm = 0, temperature_ppm = 0;  // rate error of the device's clock; its steps each half hour
    double jitter_ms = 20, grid_ms = 16;  // evenly distributed delay of the path; period of a USB adapter's polls
    Route::Path path = Route::Path::network;
    bool reopening_discards = false;  // and the link is opened again when that is asked for
    double stale_ms = 100;
    // The bytes of the frames pass the product's decoders: binary frames, whose counter has 16 bits, or lines of text.
    enum class Format : std::uint8_t { numbers, lines, cobs } format = Format::numbers;
    unsigned counter_bits = 32, clock_bits = 32;  // lines of text
    double clock_step_us = 1;                     // 1000: a clock that counts milliseconds
    double clock_period_s = 0;                    // the clock begins again from 0 after it; 0: by its bits
    double clock_scale = 1;                       // counts of the device's clock in a microsecond
    std::uint32_t counter_period = 0;             // the counter begins again after it; 0: by its bits
};

// The path when the link is closed and opened again.
enum class Closed : std::uint8_t {
    discards,   // drops the frames that it held
    drops_due,  // drops the frames of this time; the lag remains
    keeps       // everything, and goes on where it was
};

// One frame as a reader sees it right after it came.
struct Seen {
    double true_age_ms = 0, claimed_age_ms = 0;
    bool good = false, bad = false;
};

struct Tally {
    std::uint64_t frames = 0, good = 0, uncertain = 0, bad = 0, reopened = 0;
    // GOOD and older than stale_ms by more than the path's ordinary delay; the same where every frame that comes is GOOD.
    double wrong_s = 0, wrong_before_s = 0;
    double worst_ms = 0;  // true age of the oldest of these
    // Frames that were not GOOD though they were young enough.
    std::uint64_t alarms = 0;
};

class FreshnessRun {
public:
    FreshnessRun(const Stream& stream, std::uint64_t seed)
        : stream_(stream),
          random_(seed),
          age_(std::uint64_t(stream.stale_ms * 1e6)),
          sequence_(std::uint32_t(random_())),
          offset_us_(double(random_() % 4'000'000'000u)),
          lines_({.channels = 1, .sequence = stream.sequence, .time_us = stream.clock, .crc16 = true}, counts_),
          cobs_(counts_) {
        open();
    }

    // The path keeps what is sent from now on until then, and releases it at once.
    void hold_until(double t_s) { hold_until_s_ = t_s; }
    // The last relay gets no time to run until then. The frames wait before it, also while the link is closed. The kernel
    // accepts a new connection meanwhile.
    void starve_until(double t_s) {
        starved_since_s_ = std::max(now_s_, hold_until_s_);
        hold_until_s_ = starved_until_s_ = t_s;
    }
    bool pauses = false;          // the device measures and sends nothing
    bool forwards_old = false;    // its next frame is one of a second ago under a new number
    double drop = 0, swap = 0;    // rates
    double extra_lag_s = 0;       // a bridge that is as fast as the device and has a backlog
    double inner_lag_s = 0;       // another one before it, which does not learn that the link was closed
    double retime = 0;            // > 0: a relay sends one frame after the other, at most this much faster than the device
    unsigned burst = 1;           // the device sends this many frames at once
    std::uint32_t counts_by = 1;  // step of its counter
    double copies_late_s = 0;     // > 0: each frame comes a second time, by a slower way
    double rate_factor = 1;       // the device is this much faster than at first
    double clock_fast = 0;        // the device's clock is this much faster than at first
    double clock_jump_us = 0;     // added to the device's clock once
    std::size_t repeats = 0;      // > 0: instead of new frames the last so many come again and again
    bool retains = false;         // a server sends the last frame to each new connection first
    double buffer_frames = 1e9;   // frames that a path can hold; it drops the newest ones
    Closed when_closed = Closed::discards;
    // Called with each frame that arrives.
    std::function<void(const Seen&, double t_s)> see;

    // The link is closed and opened again. `is_wanted`: to prove the age.
    void reopen(bool is_wanted = false) {
        const double closed_s = std::max(0.05, double(age_.closed_ns()) * 1e-9);
        const bool is_starved = now_s_ < starved_until_s_;
        // no server can be reached while it holds everything
        closed_until_s_ = is_starved ? now_s_ + closed_s : std::max(now_s_ + closed_s, hold_until_s_);
        discarded_ = when_closed == Closed::discards;
        if (discarded_) {
            discarded_until_s_ = is_starved ? starved_since_s_ : closed_until_s_;
            const auto left_the_first = [&](const Sent& sent) {
                return sent.measured_s + inner_lag_s <= discarded_until_s_;
            };
            while (!way_.empty() && left_the_first(way_.front())) way_.pop_front();
            for (Sent& sent : way_) sent.arrives_s = sent.measured_s + inner_lag_s + 0.002;
            extra_lag_s = left_s_ = 0;
        } else if (when_closed == Closed::keeps) {
            for (Sent& sent : way_) sent.arrives_s += closed_s;
            extra_lag_s += closed_s;
        }
        if (retains && !past_.empty()) {
            way_.push_front(past_.back());
            way_.front().arrives_s = closed_until_s_ + 1e-3;
            way_.front().is_retained = true;
        }
        open(is_wanted);
    }

    // This machine and its clock stand still, and the path keeps what is sent: a virtual machine.
    void stand_still(double s) {
        hold_until(now_s_ + s);
        while (now_s_ < hold_until_s_) step();
        stood_still_s_ += s;
    }

    // The device starts again: its clock and its counter begin anew.
    void restart_device() {
        sequence_ = 0;
        device_us_ = 0;
        offset_us_ = 100e3;  // its start
    }

    // The counter goes on from another number: another device.
    void count_on(double frames) { sequence_ += std::uint32_t(std::int64_t(frames)); }

    // The device measures and sends nothing.
    void pause_for(double s) {
        pauses = true;
        run_s(s);
        pauses = false;
    }

    // Until the clock begins again from 0 after its period.
    [[nodiscard]] double clock_left_s() const {
        return stream_.clock_period_s - std::fmod(device_us_ + offset_us_, stream_.clock_period_s * 1e6) * 1e-6;
    }

    // The clock, or the counter, ends so soon.
    void wrap_clock_in(double s) {
        offset_us_ = std::ldexp(stream_.clock_step_us, int(stream_.clock_bits)) - device_us_ - s * 1e6;
    }
    void count_to_end(std::uint32_t frames) {
        sequence_ = std::uint32_t(std::ldexp(1.0, int(stream_.counter_bits)) - frames);
    }

    [[nodiscard]] double now_s() const { return now_s_; }
    [[nodiscard]] double rate_Hz() const { return stream_.rate_Hz; }
    Tally tally;

    void run_s(double s) {
        for (const double end = now_s_ + s; now_s_ < end;) step();
    }

private:
    struct Sent {
        double measured_s, arrives_s;
        std::uint32_t sequence;
        std::uint64_t device_us;
        bool is_retained = false;
    };

    void open(bool is_wanted = false) {
        age_.open({.path = stream_.path, .device_clock = true, .reopening_discards = stream_.reopening_discards},
                  is_wanted ? host_ns(std::max(closed_until_s_, now_s_)) : 0);
        lines_.reset();
        cobs_.reset();
        opening_ = true;
    }

    [[nodiscard]] std::uint64_t host_ns(double t_s) const { return std::uint64_t((t_s - stood_still_s_) * 1e9); }

    double uniform() { return double(random_() >> 11) * 0x1p-53; }

    void step() {
        const double period_s = 1 / (stream_.rate_Hz * rate_factor);
        if (discarded_ && now_s_ < closed_until_s_) extra_lag_s = 0;  // a closed connection has no backlog
        if (now_s_ > next_temperature_s_) {
            temperature_ = stream_.temperature_ppm * (temperature_ > 0 ? 0 : 1);
            next_temperature_s_ = now_s_ + 1800;
        }
        now_s_ += period_s;
        device_us_ += period_s * 1e6 * (1 + (stream_.ppm + temperature_) * 1e-6 + clock_fast) + clock_jump_us;
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
        const std::uint64_t now_ns = host_ns(now_s_);
        if (!age_.may_ask() || !age_.asks_for_reopening(now_ns, false) ||
            now_ns < asked_ns_ + (age_.keeps() ? 60'000'000'000 : pause_ns_))
            return;
        const bool helped = std::exchange(proofs_, age_.proofs()) != age_.proofs();
        pause_ns_ = helped ? 1'000'000'000 : std::min<std::uint64_t>(2 * pause_ns_, 8'000'000'000);
        asked_ns_ = now_ns;
        ++tally.reopened;
        reopen(true);
    }

    void send() {
        double arrives = now_s_ + 0.002 + inner_lag_s + extra_lag_s + uniform() * stream_.jitter_ms * 1e-3;
        if (stream_.grid_ms > 0) arrives = std::ceil(arrives / (stream_.grid_ms * 1e-3)) * stream_.grid_ms * 1e-3;
        if (burst > 1) arrives += (burst - 1 - sequence_ / counts_by % burst) / stream_.rate_Hz;
        arrives = std::max(arrives, way_.empty() ? 0 : way_.back().arrives_s);
        if (retime > 0) arrives = std::max({arrives, left_s_ + 1 / (stream_.rate_Hz * (1 + retime)), hold_until_s_});
        left_s_ = arrives;
        double device_us = (device_us_ + offset_us_) * stream_.clock_scale;
        if (stream_.clock_period_s > 0) device_us = std::fmod(device_us, stream_.clock_period_s * 1e6);
        const auto ticks = std::uint64_t(std::int64_t(std::floor(device_us / stream_.clock_step_us)));
        const std::uint64_t clock = stream_.clock_bits >= 64 ? ticks : ticks & ((1ull << stream_.clock_bits) - 1);
        std::uint32_t number =
            (sequence_ += counts_by) & (stream_.counter_bits >= 32 ? ~0u : (1u << stream_.counter_bits) - 1);
        if (stream_.counter_period > 0) number = sequence_ % stream_.counter_period;
        Sent sent{now_s_, arrives, number, std::uint64_t(double(clock) * stream_.clock_step_us)};
        if (double(way_.size()) >= buffer_frames) return;
        if (repeats == 0) {
            past_.push_back(sent);
            if (past_.size() > kPast) past_.pop_front();
            ring_at_ = past_.size();
        } else {
            if (ring_at_ == past_.size()) ring_at_ -= std::min(repeats, past_.size());
            sent = past_[ring_at_++];
            sent.arrives_s = arrives;
            sent.is_retained = true;
            way_.push_back(sent);
            return;
        }
        if (forwards_old && past_.size() > 100) {  // its number is new, what it carries is not
            const Sent& old = past_[past_.size() - 100];
            sent.measured_s = old.measured_s;
            sent.device_us = old.device_us;
            forwards_old = false;
        }
        way_.push_back(sent);
        if (uniform() < swap && way_.size() >= 2) std::swap(way_[way_.size() - 1], way_[way_.size() - 2]);
        if (copies_late_s > 0 && way_.size() >= 2 && past_.size() > std::size_t(copies_late_s * stream_.rate_Hz) + 1) {
            Sent copy = past_[past_.size() - 1 - std::size_t(copies_late_s * stream_.rate_Hz)];
            copy.arrives_s = way_.back().arrives_s;
            way_.push_back(copy);
        }
    }

    void arrive(const Sent& sent, double at_s) {
        last_s_ = at_s;
        if (at_s < closed_until_s_ || (discarded_ && sent.measured_s < discarded_until_s_ && !sent.is_retained)) return;
        Frame frame;
        if (stream_.format != Stream::Format::numbers) {
            if (decode(sent, at_s, frame)) judge(frame, sent, at_s);
            return;
        }
        const std::uint32_t ahead = sent.sequence - before_ - 1;
        // The decoders drop a frame that was overtaken, too, and accept a restart.
        const bool is_behind = stream_.sequence && !opening_ && ahead > 0x7FFFFFFF;
        if (is_behind && sent.sequence > 1000) return;
        frame.has_sequence = stream_.sequence;
        frame.sequence = sent.sequence;
        frame.lost = stream_.sequence && !opening_ && !is_behind && sent.sequence > 1000 ? ahead : 0;
        // The formats send 32 bits, which the decoders extend while the link stays open.
        const auto elapsed_us = std::int32_t(std::uint32_t(sent.device_us) - std::uint32_t(device_us_seen_));
        device_us_seen_ =
            opening_ || elapsed_us < 0 ? std::uint32_t(sent.device_us) : device_us_seen_ + std::uint32_t(elapsed_us);
        frame.device_time_us = stream_.clock ? device_us_seen_ | 1 : 0;
        before_ = sent.sequence;
        opening_ = false;
        frame.t_ns = frame.taken_ns = host_ns(at_s);
        judge(frame, sent, at_s);
    }

    bool decode(const Sent& sent, double at_s, Frame& frame) {
        frame.sequence = sent.sequence;
        frame.device_time_us = stream_.clock ? sent.device_us : 0;
        frame.n_channels = 1;
        frame.channel[0] = double(sent.sequence % 1000);
        const bool text = stream_.format == Stream::Format::lines;
        StreamDecoder& decoder = text ? static_cast<StreamDecoder&>(lines_) : cobs_;
        std::array<char, kAsciiMaxBytes * 2> line;
        std::array<std::uint8_t, kCobsMaxEncoded> bytes;
        const AsciiFormat format{.channels = 1, .sequence = stream_.sequence, .time_us = stream_.clock, .crc16 = true};
        const std::size_t size = text ? encode_ascii(frame, format, line) : encode_cobs(frame, 24, bytes);
        if (text) std::memcpy(bytes.data(), line.data(), size);
        decoder.push({bytes.data(), size}, host_ns(at_s));
        return decoder.next(frame);
    }

    void judge(Frame& frame, const Sent& sent, double at_s) {
        age_.judge(frame, frame.taken_ns);
        Seen seen;
        seen.true_age_ms = (at_s - sent.measured_s) * 1e3;
        seen.claimed_age_ms = double(frame.taken_ns - frame.t_ns) * 1e-6;
        seen.bad = double(std::max(frame.late_ns, frame.taken_ns - frame.t_ns)) * 1e-6 > stream_.stale_ms;
        const bool two_devices = stream_.format != Stream::Format::numbers && frame.n_channels == 0;
        seen.good = !seen.bad && !two_devices && frame.age != Frame::Age::unproved;
        ++tally.frames;
        ++(seen.bad ? tally.bad : seen.good ? tally.good : tally.uncertain);
        // The smallest delay of the path, its polls and its jitter are no lag, nor are the 10 ms that the bound allows.
        const double normal_ms = std::max(48.0, 2 + stream_.jitter_ms + stream_.grid_ms + 1000 / stream_.rate_Hz);
        const bool is_old = seen.true_age_ms > stream_.stale_ms + normal_ms;
        if (is_old) tally.wrong_before_s += 1 / stream_.rate_Hz;
        tally.alarms += !seen.good && seen.true_age_ms < stream_.stale_ms - normal_ms;
        if (seen.good && is_old) {
            tally.wrong_s += 1 / stream_.rate_Hz;
            tally.worst_ms = std::max(tally.worst_ms, seen.true_age_ms);
        }
        if (see) see(seen, at_s);
    }

    Stream stream_;
    std::mt19937_64 random_;
    StreamAge age_;
    std::uint32_t proofs_ = 0;
    std::uint64_t asked_ns_ = 0, pause_ns_ = 1'000'000'000;
    std::uint32_t sequence_, before_ = 0;
    std::uint64_t device_us_seen_ = 0;
    double offset_us_, now_s_ = 1000, device_us_ = 0, temperature_ = 0, next_temperature_s_ = 0;
    double starved_since_s_ = 0, starved_until_s_ = 0, discarded_until_s_ = 0;
    double hold_until_s_ = 0, last_s_ = 0, left_s_ = 0, closed_until_s_ = 0, stood_still_s_ = 0;
    bool opening_ = true, discarded_ = true;
    LinkCounts counts_;
    AsciiDecoder lines_;
    CobsDecoder cobs_;
    static constexpr std::size_t kPast = 2000;
    std::deque<Sent> way_, past_;
    std::size_t ring_at_ = 0;
};

}  // namespace tactiled::faults
