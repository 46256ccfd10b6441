// A device whose frames come with a given delay, and the judgement of their age.
#pragma once
#include <gtest/gtest.h>

#include "drivers/wire/stream_age.hpp"

namespace tactiled {

constexpr std::uint64_t kMs = 1'000'000, kS = 1000 * kMs;
using Age = Frame::Age;
using Path = Route::Path;

// A device of 100 Hz whose frames come 1 ms after they were measured, unless a test says otherwise.
struct Device {
    explicit Device(Route route, bool clock = true, bool counter = true)
        : age(100 * kMs), has_clock(clock), has_sequence(counter) {
        open(route);
    }
    void open(Route route) {
        path = route;
        age.open(route);
    }
    // The link was closed for a proof, and opened again: the frames of that time are lost, or the gateway keeps them.
    void reopen(unsigned closed_ms = 50, bool keeps = false) {
        age.open(path, measured_ns + closed_ms * kMs);
        if (keeps) return;
        measured_ns += closed_ms * kMs;
        sequence += closed_ms / 10;
    }

    // The next frame, measured `period_ms` after the one before, arrives `delay_ms` later.
    Frame next(double delay_ms = 1, double period_ms = 10, std::uint32_t lost = 0) {
        measured_ns += std::uint64_t(period_ms * 1e6);
        Frame frame;
        frame.t_ns = frame.taken_ns = measured_ns + std::uint64_t(std::int64_t(delay_ms * 1e6));
        frame.has_sequence = has_sequence;
        frame.sequence = counter_period > 0 ? sequence++ % counter_period : sequence++;
        frame.lost = lost;
        frame.sequence_bits = bits;
        if (has_clock) frame.device_time_us = (measured_ns - clock_zero_ns) / 1000 * clock_scale;
        age.judge(frame, frame.taken_ns);
        return frame;
    }
    void run(int frames, double delay_ms = 1) {
        for (int i = 0; i < frames; ++i) (void)next(delay_ms);
    }

    Route path;
    StreamAge age;
    bool has_clock, has_sequence;
    std::uint64_t measured_ns = 1000 * kS, clock_zero_ns = 900 * kS;
    std::uint32_t sequence = 5, counter_period = 0;  // 0: by its bits
    std::uint64_t clock_scale = 1;                   // counts of its clock in a microsecond
    std::uint8_t bits = 32;
};

inline Route network() { return {.path = Path::network, .device_clock = true}; }
inline Route connection() { return {.path = Path::network, .device_clock = true, .reopening_discards = true}; }
inline Route cable() { return {.path = Path::direct, .device_clock = true}; }

}  // namespace tactiled
