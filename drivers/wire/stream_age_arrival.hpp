// Part of stream_age.hpp: the proofs that use no number of the device. A cable has buffers that bound the delay; otherwise
// only the times of arrival are known. Requests are handled in StreamAge::judge().
#pragma once
#include "drivers/wire/stream_age.hpp"

namespace tactiled {

// The bytes of a frame that waited while the process was stopped may all have arrived directly after the stop. A device
// whose program has failed may repeat its last frames.
inline void StreamAge::by_cable(Frame& frame, std::uint64_t host_ns) noexcept {
    proof_ = Proof::direct;
    if (may_come_again(host_ns)) frame.age = Frame::Age::unproved;
    if (frame.since_ns != 0 && frame.since_ns < frame.t_ns) backdate(frame, double(frame.taken_ns - frame.since_ns));
}

inline void StreamAge::by_arrival(Frame& frame, std::uint64_t host_ns) noexcept {
    proof_ = Proof::arrival;
    const double silence_ns = has_frame_ ? double(host_ns - host_ns_) : 0;
    if (has_frame_ && !is_reopened_) {
        if (silence_ns > std::max(3 * period_ns_, kLate_ns)) {
            if (period_ns_ > 0) is_unproved_ = true;
        } else {
            period_ns_ += (silence_ns - period_ns_) / (learn_frames_ < 100 ? ++learn_frames_ : 100);
        }
        if (period_ns_ <= 0) period_ns_ = silence_ns;  // a slow device: its first interval
    }
    if (is_reopened_) is_unproved_ = !route_.reopening_discards || has_waited(host_ns);
    if (frame.since_ns != 0 && frame.since_ns < frame.t_ns) {
        backdate(frame, double(frame.taken_ns - frame.since_ns));
        is_unproved_ = true;
    }
    frame.age = is_unproved_ ? Frame::Age::unproved : Frame::Age::arrival_only;
    put_trouble(is_unproved_, host_ns);
}

}  // namespace tactiled
