// Time per sample of each method: each sample separately between two readings of the clock, and if the kernel counts
// instructions, a run of them. Caches are warm.
#include <fmt/format.h>
#include <linux/perf_event.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "node/lab/tradeoff.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::ctl {
namespace {

constexpr std::size_t kTurn = 256;  // samples of one candidate before the next candidate runs

class Instructions {
public:
    Instructions() {
        perf_event_attr wanted{};
        wanted.size = sizeof wanted;
        wanted.type = PERF_TYPE_HARDWARE;
        wanted.config = PERF_COUNT_HW_INSTRUCTIONS;
        wanted.exclude_kernel = 1;
        wanted.exclude_hv = 1;
        fd_ = int(::syscall(SYS_perf_event_open, &wanted, 0, -1, -1, PERF_FLAG_FD_CLOEXEC));
        error_ = fd_ < 0 ? errno : 0;
    }
    ~Instructions() {
        if (fd_ >= 0) ::close(fd_);
    }
    Instructions(const Instructions&) = delete;
    Instructions& operator=(const Instructions&) = delete;
    [[nodiscard]] double count() const {  // number so far; NaN if the kernel does not count
        std::uint64_t value = 0;
        return fd_ >= 0 && ::read(fd_, &value, sizeof value) == sizeof value ? double(value) : kNaN;
    }
    [[nodiscard]] int error() const { return error_; }

private:
    int fd_, error_;
};

double sink = 0;  // prevents the optimiser from removing the loop

// Repeats one candidate over the rows under load, because some methods have nothing to do at rest. Time continues at
// the end of the rows, so that it never goes back for a method with memory.
class Course {
public:
    Course(const Candidate& candidate, const Labelled& rows) : decoupler_(candidate.make()) {
        readings_ = readings_of(candidate, rows, storage_);
        if (const std::size_t begin = first_load(rows); begin < readings_.size())
            readings_.erase(readings_.begin(), readings_.begin() + std::ptrdiff_t(begin));
        if (readings_.empty()) throw SetupError(rows.name + ": has no rows to time");
        period_ns_ = readings_.back().t_ns - readings_.front().t_ns + 1'000'000;
    }
    [[nodiscard]] Reading next() {
        Reading reading = readings_[at_];
        reading.t_ns += lap_ns_;
        if (++at_ == readings_.size()) at_ = 0, lap_ns_ += period_ns_;
        return reading;
    }
    void time(std::size_t samples, double clock, std::vector<float>& ns) {
        for (std::size_t i = 0; i < samples; ++i) {
            const Reading reading = next();
            const std::uint64_t began = monotonic_ns();
            const Estimate e = decoupler_->decouple(reading);
            const std::uint64_t ended = monotonic_ns();
            sink += e.residual;
            ns.push_back(float(std::max(0.0, double(ended - began) - clock)));
        }
    }
    double instructions(const Instructions& counter, std::size_t samples) {
        const double before = counter.count();
        for (std::size_t i = 0; i < samples; ++i) sink += decoupler_->decouple(next()).residual;
        return (counter.count() - before) / double(samples);
    }

private:
    std::unique_ptr<Decoupler> decoupler_;
    std::vector<double> storage_;
    std::vector<Reading> readings_;
    std::size_t at_ = 0;
    std::uint64_t lap_ns_ = 0, period_ns_ = 0;
};

}  // namespace

double quantile(std::vector<float>& values, double share) {
    if (values.empty()) return kNaN;
    const auto at = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return double(*at);
}

double clock_ns() {
    static const double median = [] {
        std::vector<float> ns;
        for (int i = 0; i < 10'001; ++i) {
            const std::uint64_t began = monotonic_ns();
            ns.push_back(float(monotonic_ns() - began));
        }
        return quantile(ns, 0.5);
    }();
    return median;
}

std::string why_no_instructions() {
    const Instructions counter;
    if (std::isfinite(counter.count())) return "";
    return fmt::format(
        "instructions: not counted, the kernel refuses perf_event_open ({}); tests/bench/decouple_instructions.py counts "
        "them "
        "with valgrind",
        std::strerror(counter.error()));
}

std::vector<Timing> time_all(const std::vector<Candidate>& candidates, const Labelled& rows, std::size_t samples) {
    const Instructions counter;
    const double clock = clock_ns();
    std::vector<Course> courses;
    for (const Candidate& candidate : candidates) courses.emplace_back(candidate, rows);
    std::vector<Timing> timings(candidates.size());
    for (std::size_t done = 0; done < samples; done += kTurn)
        for (std::size_t i = 0; i < courses.size(); ++i)
            courses[i].time(std::min(kTurn, samples - done), clock, timings[i].ns);
    for (std::size_t i = 0; i < courses.size(); ++i)
        timings[i].instructions = courses[i].instructions(counter, std::min(samples, rows.rows.size()));
    return timings;
}

}  // namespace tactiled::ctl
