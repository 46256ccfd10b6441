#include "node/threads.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>

#include "node/log.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

constexpr int kReadTimeoutMs = 50;  // longest time for which a silent device keeps its thread from noticing stop()
constexpr int kMinPauseMs = 50, kMaxPauseMs = 1000;
constexpr std::uint64_t kPipelineNs = 50'000'000;    // a pipeline that finishes no cycle for this time hangs
constexpr std::uint64_t kRepeatNs = 10'000'000'000;  // the same complaint about the same link at most this often
// An opening that gave a frame and lasted so long was a device: looked for at once when it is gone. Less is one that only
// seems to be there, such as a server that accepts and hangs up.
constexpr std::uint64_t kPresentNs = 100'000'000;
constexpr std::uint64_t kWorkedNs = 1'000'000'000;  // and so long: its next trouble is a new one, worth its own lines

// "" when it is open, else why not. A driver throws for want of memory only.
std::string try_open(Driver& driver) noexcept try { return driver.open(); } catch (const std::exception&) {
    driver.close();
    return "no memory";  // short enough to need none
}

// Says a thing once, then at most each 10 s while it stays the same.
class Complaint {
public:
    void about(const std::string& link, std::string_view text) noexcept {
        const std::uint64_t now = monotonic_ns();
        const std::size_t hash = std::hash<std::string_view>{}(text);
        ++times_;
        if (said_ == hash && now - said_ns_ < kRepeatNs) return;
        if (times_ > 1)
            log_line(LogLevel::warning, "link \"{}\": {} ({} times)", link, text, times_);
        else
            log_line(LogLevel::warning, "link \"{}\": {}", link, text);
        said_ = hash;
        said_ns_ = now;
        times_ = 0;
    }
    void settled() noexcept { said_ = 0; }

private:
    std::size_t said_ = 0;  // hash of the text; 0: nothing
    std::uint64_t said_ns_ = 0;
    unsigned times_ = 0;
};

// A device that always has more would never let its thread wait: other links starve, and LimitRTTIME= takes the daemon for
// one that is out of control. Such a thread waits here.
class Breather {
public:
    // rt: wait-free, but one system call each kCyclesPerYield turns, and where the thread has not waited since the last one, 1 ms
    void cycle() noexcept {
        if (++cycles_ % kCyclesPerYield != 0) return;
        rusage used{};
        ::getrusage(RUSAGE_THREAD, &used);
        if (used.ru_nvcsw == waits_) sleep_until(monotonic_ns() + 1'000'000u);
        waits_ = used.ru_nvcsw;
    }

private:
    static constexpr unsigned kCyclesPerYield = 256;  // at 10 us a frame 3 ms; LimitRTTIME= is 200 ms
    unsigned cycles_ = 0;
    long waits_ = -1;
};

}  // namespace

std::vector<std::string> Threads::start() {
    const RealtimeSettings& wanted = node_.config.realtime;
    std::vector<std::string> refused;
    const auto note = [&](std::string what) {
        if (!what.empty() && std::find(refused.begin(), refused.end(), what) == refused.end())
            refused.push_back(std::move(what));
    };
    const auto add = [&](const char* name, int priority, std::function<void()> body) {
        auto& thread = *threads_.emplace_back(std::make_unique<RtThread>());  // first: stop() must find one that runs
        note(thread.start(name, priority, wanted.cpu, std::move(body)));
    };
    if (wanted.lock_memory) note(lock_memory());
    const auto watched = [this](std::string name, std::uint64_t limit_ns) {
        return std::make_shared<Progress::Liveness>(progress_, std::move(name), limit_ns);
    };
    const std::uint64_t period_ns = std::uint64_t(wanted.period_us) * 1000u;
    const std::uint64_t link_ns =
        node_.config.node.stuck_link_ms == 0 ? UINT64_MAX : std::uint64_t(node_.config.node.stuck_link_ms) * 1'000'000u;
    try {
        for (auto& link : node_.links)  // below the pipeline: a flood on one link does not hold back what is there
            add("link", std::max(1, wanted.priority - 2),
                [this, &link = *link, cycles = watched(fmt::format("link \"{}\"", link->name), link_ns)] {
                    run_link(link, *cycles);
                });
        add("pipeline", wanted.priority, [this, cycles = watched("the pipeline", kPipelineNs + 2 * period_ns), period_ns] {
            run_pipeline(period_ns, *cycles);
        });
        if (!refused.empty() && wanted.required)
            throw SetupError(fmt::format("[realtime] required = true, but {}", refused.front()));
    } catch (...) {
        stop();
        throw;
    }
    if (!refused.empty()) pipeline_.add_status(TACTILED_RT_DEGRADED);
    go_.store(true, std::memory_order_release);
    return refused;
}

void Threads::stop() noexcept {
    stop_.store(true, std::memory_order_release);
    threads_.clear();  // joins
}

void Threads::pause(int ms, Progress::Liveness& cycles) const noexcept {
    const std::uint64_t until = monotonic_ns() + std::uint64_t(ms) * 1'000'000u;
    while (!stop_.load(std::memory_order_acquire) && monotonic_ns() < until) {
        cycles.count();
        sleep_until(std::min(until, monotonic_ns() + std::uint64_t(kReadTimeoutMs) * 1'000'000u));
    }
}

void Threads::run_link(Link& link, Progress::Liveness& cycles) noexcept {
    Breather breather;
    Complaint refused, disconnected;  // two: a device may be refused and gone by turns
    int pause_ms = kMinPauseMs;
    bool announce = true;  // false after an opening that came to nothing: then "open" is said of one that works
    LinkCounts& counts = link.driver->counts;
    while (!stop_.load(std::memory_order_acquire)) {
        const std::string wrong = try_open(*link.driver);
        if (!wrong.empty()) {
            segment_.set_link_count(link.index, TACTILED_LINK_OPEN_FAILED, ++counts[TACTILED_LINK_OPEN_FAILED]);
            segment_.set_link_count(link.index, TACTILED_LINK_RESTARTED, counts[TACTILED_LINK_RESTARTED]);  // by open()
            refused.about(link.name, wrong);
            pause(pause_ms, cycles);
            pause_ms = std::min(2 * pause_ms, kMaxPauseMs);
            continue;
        }
        ++counts[TACTILED_LINK_OPENED];
        if (announce) log_line(LogLevel::info, "link \"{}\": open", link.name);
        segment_.set_link_state(link.index, TACTILED_LINK_OPEN);
        link.connected.store(true, std::memory_order_release);
        const std::uint64_t opened_ns = monotonic_ns();
        const std::uint32_t frames = counts[TACTILED_LINK_FRAMES];
        bool present = true, worked = false;
        while (present && !stop_.load(std::memory_order_acquire)) {
            {
                const Armed armed;
                present = acquire(link, segment_, kReadTimeoutMs);
            }
            cycles.count();
            breather.cycle();
            if (worked || counts[TACTILED_LINK_FRAMES] == frames || monotonic_ns() - opened_ns < kWorkedNs) continue;
            worked = true;
            if (!announce) log_line(LogLevel::info, "link \"{}\": open", link.name);
            refused.settled();
            disconnected.settled();
        }
        // After the last commit: see Pipeline::deliver(). Not when the daemon ends, which is no discontinuity of the link.
        if (!present) link.connected.store(false, std::memory_order_release);
        segment_.set_link_state(link.index, TACTILED_LINK_CLOSED);
        link.driver->close();
        if (present) break;
        segment_.set_link_count(link.index, TACTILED_LINK_GONE, ++counts[TACTILED_LINK_GONE]);
        announce = worked;
        if (counts[TACTILED_LINK_FRAMES] != frames && monotonic_ns() - opened_ns >= kPresentNs) pause_ms = kMinPauseMs;
        disconnected.about(link.name, "the device is disconnected; waiting for it to return");
        pause(pause_ms, cycles);
        pause_ms = std::min(2 * pause_ms, kMaxPauseMs);
    }
}

void Threads::run_pipeline(std::uint64_t period_ns, Progress::Liveness& cycles) noexcept {
    while (!go_.load(std::memory_order_acquire) && !stop_.load(std::memory_order_acquire))
        sleep_until(monotonic_ns() + 1'000'000u);  // rights are settled first
    std::uint64_t next_ns = monotonic_ns() + period_ns;
    while (!stop_.load(std::memory_order_acquire)) {
        sleep_until(next_ns);
        cycles.count();
        {
            const Armed armed;
            const std::uint64_t now_ns = monotonic_ns();
            const std::uint64_t late_ns = now_ns > next_ns ? now_ns - next_ns : 0, missed = late_ns / period_ns;
            segment_.count_lateness(late_ns);
            const bool published = pipeline_.cycle(now_ns);
            pipeline_.account(monotonic_ns() - now_ns, missed);
            next_ns += (missed + 1) * period_ns;  // back on the grid, never a burst to catch up
            if (!published) continue;
        }
        segment_.wake_readers();  // one wake for each cycle, not for each sensor; the only system call but the sleep
    }
}

}  // namespace tactiled
