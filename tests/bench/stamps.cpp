// Error of the timestamps of CAN messages: the software's, the adapter's with an offset taken once, and the fitted clock
// (drivers/wire/clock_fit.hpp), each against the true time on the bus. Virtual time and fixed seeds: the same table
// everywhere. Not shown: what a real adapter's way is like. The delays are made up after what was measured on USB adapters.
//
//   stamps --age                   time of StreamAge::judge() for a frame, by kind of proof; 10 s
//   stamps --age KIND FRAMES       only that kind, for instruction counts by valgrind: the difference of two lengths
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string_view>
#include <vector>

#include "drivers/clock.hpp"
#include "drivers/wire/clock_fit.hpp"
#include "drivers/wire/stream_age.hpp"

namespace {

using namespace tactiled;

constexpr double kMinutes = 10, kSettle_s = 1;

struct Adapter {
    const char* name;
    double rate_Hz;
    double drift_ppm, wander_ppm;  // constant, and a sine of 5 minutes
    double min_us, mean_us;        // delay from the bus to the kernel: a minimum plus an exponentially distributed part
    double poll_us;                // the host polls at this interval: messages wait for it, and arrive in one batch
    double stall_share, stall_ms;  // share and duration of delayed batches
};

// Rates that are not multiples of the polling: messages and polls drift past each other, as with two crystals.
constexpr Adapter kAdapters[] = {
    {"USB, high speed", 997, 25, 2, 60, 15, 125, 0.001, 3},    {"USB, full speed", 997, -40, 2, 150, 40, 1000, 0.01, 10},
    {"USB, full speed", 101, -40, 2, 150, 40, 1000, 0.01, 10}, {"PCI or on chip", 997, 15, 1, 5, 4, 0, 0.0005, 1},
    {"clock 150 ppm off", 997, 150, 2, 60, 15, 125, 0.001, 3},
};

struct Errors {
    std::vector<double> us;
    void print(const char* what) {
        std::sort(us.begin(), us.end());
        const auto at = [&](double share) { return us[std::size_t(share * double(us.size() - 1))]; };
        fmt::print("  {:<24} {:>10.1f} {:>10.1f} {:>10.1f} {:>10.1f} {:>12.1f}\n", what, at(0), at(0.5), at(0.99), at(1),
                   at(0.995) - at(0.005));
    }
};

void measure(const Adapter& adapter) {
    std::mt19937_64 random(1);
    std::exponential_distribution<double> extra(1 / adapter.mean_us);
    std::uniform_real_distribution<double> chance;
    Errors software, once, fitted;
    ClockFit fit;
    const auto n = std::size_t(kMinutes * 60 * adapter.rate_Hz);
    const double t0_us = 3600e6;  // of CLOCK_MONOTONIC
    double clock_us = 0, last_us = 0, stalled_until_us = 0, first_offset_us = 0, arrived_us = 0;
    double min_first_us = 1e300;
    for (std::size_t k = 0; k < n; ++k) {
        const double sent_us = double(k) * 1e6 / adapter.rate_Hz + 20 * chance(random);
        const double ppm = adapter.drift_ppm + adapter.wander_ppm * std::sin(sent_us / 300e6 * 6.283185307179586);
        clock_us += (sent_us - last_us) * (1 + ppm * 1e-6);
        last_us = sent_us;
        double arrival_us = sent_us + adapter.min_us + extra(random);
        if (adapter.poll_us > 0) arrival_us = std::ceil(arrival_us / adapter.poll_us) * adapter.poll_us;
        if (chance(random) < adapter.stall_share) stalled_until_us = arrival_us + 1e3 * adapter.stall_ms * chance(random);
        arrival_us = std::max({arrival_us, stalled_until_us, arrived_us});
        arrived_us = arrival_us;
        const auto timestamp_ns = std::uint64_t(clock_us) * 1000;  // whole us
        const auto arrival_ns = std::uint64_t((t0_us + arrival_us) * 1e3);
        const auto t_ns = fit.monotonic_ns(timestamp_ns, arrival_ns);
        if (sent_us < kSettle_s * 1e6) {
            min_first_us = std::min(min_first_us, arrival_us - double(timestamp_ns) / 1e3);
            first_offset_us = min_first_us;
            continue;
        }
        software.us.push_back(arrival_us - sent_us);
        once.us.push_back(double(timestamp_ns) / 1e3 + first_offset_us - sent_us);
        fitted.us.push_back(double(t_ns) / 1e3 - t0_us - sent_us);
    }
    fmt::print("{}, {} messages/s, clock {:+} +- {} ppm, stalls of up to {} ms in {} % of them\n", adapter.name,
               adapter.rate_Hz, adapter.drift_ppm, adapter.wander_ppm, adapter.stall_ms, 100 * adapter.stall_share);
    software.print("software");
    once.print("adapter, offset once");
    fitted.print("adapter, fitted");
}

// ---- cost of the proof of age ------------------------------------------------------------------------------------------

struct Judged {
    std::string_view name;
    bool judges;
    Route route;
    bool has_clock, has_sequence;
};

constexpr Judged kJudged[] = {
    {"none", false, {}, true, true},
    {"clock", true, {.path = Route::Path::network, .device_clock = true}, true, true},
    {"sequence", true, {.path = Route::Path::network, .device_clock = true}, false, true},
    {"arrival", true, {.path = Route::Path::network, .device_clock = true}, false, false},
    {"cable, clock", true, {.path = Route::Path::direct, .device_clock = true}, true, true},
    {"cable", true, {.path = Route::Path::direct}, false, true},
    {"request", true, {.path = Route::Path::polled}, false, false},
};

// Not inlined, so that nothing is known of the frame.
[[gnu::noinline]] void judge(StreamAge& age, Frame& frame, std::uint64_t host_ns) { age.judge(frame, host_ns); }

// A stream of 1 kHz with a jitter of 1 ms and a clock that is 50 ppm fast.
class JudgedStream {
public:
    explicit JudgedStream(const Judged& kind) : kind_(kind), age_(100'000'000) { age_.open(kind.route); }

    std::uint64_t run(std::uint64_t frames) {
        std::uint64_t sum = 0;
        for (std::uint64_t k = 0; k < frames; ++k) {
            ++n_;
            noise_ = noise_ * 6364136223846793005u + 1442695040888963407u;
            const std::uint64_t arrival_ns = 1'000'000'000'000u + n_ * 1'000'000u + (noise_ >> 44);
            last_ns_ = std::max(last_ns_, arrival_ns);
            frame_.t_ns = frame_.taken_ns = last_ns_;
            frame_.age = Frame::Age::proved;
            frame_.late_ns = 0;
            frame_.device_time_us = kind_.has_clock ? n_ * 1000 + n_ / 20 : 0;
            frame_.has_sequence = kind_.has_sequence;
            frame_.sequence = std::uint32_t(n_);
            if (kind_.judges) judge(age_, frame_, last_ns_);
            sum += frame_.t_ns + frame_.late_ns + std::uint64_t(frame_.age);
        }
        return sum;
    }

private:
    const Judged& kind_;
    StreamAge age_;
    Frame frame_;
    std::uint64_t n_ = 0, noise_ = 1, last_ns_ = 0;
};

// Time of one call in ns: the median of 41 batches.
template <typename Batch>
double median_ns(std::uint64_t calls, Batch&& batch) {
    std::vector<double> ns;
    for (int i = 0; i < 41; ++i) {
        const auto begin = std::chrono::steady_clock::now();
        batch();
        ns.push_back(std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begin).count() /
                     double(calls));
    }
    std::nth_element(ns.begin(), ns.begin() + 20, ns.end());
    return ns[20];
}

int judge_ages(int argc, char** argv) {
    constexpr std::uint64_t kBatch = 200'000;
    volatile std::uint64_t sink = 0;
    if (argc == 4) {
        for (const Judged& kind : kJudged)
            if (kind.name == argv[2]) {
                sink = JudgedStream(kind).run(std::strtoull(argv[3], nullptr, 10));
                return 0;
            }
        return 2;
    }
    double none_ns = 0;
    for (const Judged& kind : kJudged) {
        JudgedStream stream(kind);
        const double ns = median_ns(kBatch, [&] { sink = sink + stream.run(kBatch); });
        if (!kind.judges) none_ns = ns;
        fmt::print("{:<16} {:6.1f} ns a frame\n", kind.name, ns - none_ns);
    }
    const double clocks_ns = median_ns(kBatch, [&] {
        for (std::uint64_t i = 0; i < kBatch; ++i) sink = sink + host_ns(i);
    });
    fmt::print("{:<16} {:6.1f} ns, for proofs by clock, and on a network\n", "host_ns()", clocks_ns);
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 1 && std::string_view(argv[1]) == "--age") return judge_ages(argc, argv);
    fmt::print(
        "stamp - true time on the bus in us, {} min each; jitter = p99.5 - p0.5\n  {:<24} {:>10} {:>10} {:>10} {:>10} "
        "{:>12}\n",
        kMinutes, "", "least", "p50", "p99", "most", "jitter");
    for (const auto& adapter : kAdapters) measure(adapter);
}
