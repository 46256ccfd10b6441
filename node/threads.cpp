#include "node/threads.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>

#include "node/log.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

constexpr int kReadTimeoutMs = 250;       // longest delay of stop() by a thread with a silent device
constexpr std::uint64_t kWaitsMs = 1000;  // twice the longest ordinary wait of a link's thread, and of SharedLinks
constexpr int kMinPauseMs = 50, kMaxPauseMs = 1000;
constexpr int kRefusals = 20;  // a server may need a second to end the connection that was closed for a proof
// a pipeline without a cycle for this time plus two periods hangs
constexpr std::uint64_t kPipelineNs = NodeRecord::kIdleNs + 150'000'000;
constexpr std::uint64_t kRunnerNs = 100'000;         // time in which another thread should finish a cycle
constexpr std::uint64_t kRepeatNs = 10'000'000'000;  // minimum interval of equal log lines about one link
// A device that delivered a frame and was open for this long is reopened after the minimum pause when it disconnects. A
// shorter opening may be a server that accepts connections and closes them.
constexpr std::uint64_t kPresentNs = 100'000'000;
constexpr std::uint64_t kWorkedNs = 1'000'000'000;  // a fault after this time without faults is logged again

// Returns "" on success, else the fault. A driver throws only if there is no memory.
std::string try_open(Driver& driver) noexcept try { return driver.open(); } catch (const std::exception&) {
    driver.close();
    return "no memory";  // the text is short enough for std::string without an allocation
}

// Logs a text once, then at most each 10 s while the text is the same.
class Complaint {
public:
    void about(const std::string& link, std::string_view text) noexcept {
        const std::uint64_t now = monotonic_ns();
        const std::size_t hash = std::hash<std::string_view>{}(text);
        ++times_;
        if (logged_ == hash && now - logged_ns_ < kRepeatNs) return;
        if (times_ > 1)
            log_line(LogLevel::warning, "link \"{}\": {} ({} times)", link, text, times_);
        else
            log_line(LogLevel::warning, "link \"{}\": {}", link, text);
        logged_ = hash;
        logged_ns_ = now;
        times_ = 0;
    }
    void settled() noexcept { logged_ = 0; }

private:
    std::size_t logged_ = 0;  // hash of the text; 0: none
    std::uint64_t logged_ns_ = 0;
    unsigned times_ = 0;
};

// Logs a doubt about the age of a link's frames that has lasted for kDoubtNs, with its cause and what ends it.
class Doubt {
public:
    void look(const Link& link) noexcept {
        const LinkAge::Trouble trouble = link.age.trouble();
        if (trouble.lasts_ns == 0 && said_)
            log_line(LogLevel::info, "link \"{}\": the age of its frames is proved", link.name);
        said_ = said_ && trouble.lasts_ns != 0;
        if (said_ || trouble.lasts_ns < kDoubtNs) return;
        said_ = true;
        const double share = std::abs(trouble.rate_error);
        const std::string rate =
            share * 1e6 > trouble.clock_ppm && share < 0.02
                ? fmt::format("; if the device's clock is {:.2f} % {}, write clock_ppm = {:.0f}", 100 * share,
                              trouble.rate_error > 0 ? "slow" : "fast", std::min(std::ceil(share * 1200) * 1000, 20'000.0))
                : "";
        log_line(LogLevel::warning, "link \"{}\": no frame has proved its age for {} s{}; {}", link.name,
                 kDoubtNs / 1'000'000'000, rate, link.driver->proof_advice());
    }

private:
    static constexpr std::uint64_t kDoubtNs = 5'000'000'000;
    bool said_ = false;
};

// Pauses the thread of a device that always has more data. Without a pause other links would starve, and systemd's
// LimitRTTIME= would end the daemon.
class Breather {
public:
    // rt: one system call each 3 ms, and 1 ms of sleep if the thread has not waited since the previous one
    void cycle() noexcept {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - looked_ns_ < kLookNs) return;
        looked_ns_ = now_ns;
        rusage used{};
        ::getrusage(RUSAGE_THREAD, &used);
        if (used.ru_nvcsw == waits_) sleep_until(now_ns + 1'000'000u);
        waits_ = used.ru_nvcsw;
    }

private:
    static constexpr std::uint64_t kLookNs = 3'000'000;  // LimitRTTIME= is 200 ms
    std::uint64_t looked_ns_ = 0;
    long waits_ = -1;
};

std::uint64_t period_ns(const Node& node) { return std::uint64_t(node.config.realtime.period_us) * 1000u; }

}  // namespace

Threads::Threads(Node& node, SegmentWriter& segment, Pipeline& pipeline)
    : node_(node),
      segment_(segment),
      pipeline_(pipeline),
      cycles_(progress_, "the pipeline", kPipelineNs + 2 * period_ns(node)),
      shared_(node.links, segment, pipeline) {
    pipeline_.announce_to(&waker_, &cycles_);
}

std::vector<std::string> Threads::start() {
    const RealtimeSettings& wanted = node_.config.realtime;
    std::vector<std::string> refused;
    const auto note = [&](std::string what) {
        if (!what.empty() && std::find(refused.begin(), refused.end(), what) == refused.end())
            refused.push_back(std::move(what));
    };
    const auto add = [&](const char* name, int priority, std::function<void()> body) {
        auto& thread = *threads_.emplace_back(std::make_unique<RtThread>());  // before start(): stop() must find the thread
        note(thread.start(name, priority, wanted.cpu, std::move(body)));
    };
    if (wanted.lock_memory) note(lock_memory());
    const auto watched = [this](std::string name, std::uint64_t limit_ns) {
        return std::make_shared<Progress::Liveness>(progress_, std::move(name), limit_ns);
    };
    const std::uint64_t stuck_ms = std::uint64_t(node_.config.node.stuck_link_ms);
    const std::uint64_t link_ns = stuck_ms == 0 ? UINT64_MAX : (stuck_ms + kWaitsMs) * 1'000'000u;
    try {
        for (auto& link : node_.links)  // below the pipeline's priority, so that no link delays time limits
            add("link", std::max(1, wanted.priority - 2),
                [this, &link = *link, cycles = watched(fmt::format("link \"{}\"", link->name), link_ns)] {
                    run_link(link, *cycles);
                });
        add("pipeline", wanted.priority, [this, wakes = watched("the pipeline", kPipelineNs + 2 * period_ns(node_))] {
            run_pipeline(period_ns(node_), *wakes);
        });
        if (node_.links.size() > 1)
            add("links", std::max(1, wanted.priority - 2),
                [this, cycles = watched("the thread of several links", link_ns)] { shared_.run(*cycles, stop_); });
        add("waker", 0, [this] { waker_.run(); });
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
    waker_.stop();
    shared_.wake();
    pipeline_.wake();
    threads_.clear();  // joins
}

void Threads::pause(int ms, Progress::Liveness& cycles) const noexcept {
    const std::uint64_t until = monotonic_ns() + std::uint64_t(ms) * 1'000'000u;
    while (!stop_.load(std::memory_order_acquire) && monotonic_ns() < until) {
        cycles.count();
        sleep_until(std::min(until, monotonic_ns() + std::uint64_t(kReadTimeoutMs) * 1'000'000u));
    }
}

// Publishes that the link is disconnected: after its last commit, see Pipeline::deliver().
void Threads::end_stream(Link& link) noexcept {
    link.is_proving = false;
    segment_.set_link_state(link.index, TACTILED_LINK_CLOSED);
    if (!link.connected.exchange(false, std::memory_order_release)) return;
    pipeline_.serve();
    segment_.set_link_count(link.index, TACTILED_LINK_GONE, ++link.driver->counts[TACTILED_LINK_GONE]);
}

void Threads::run_link(Link& link, Progress::Liveness& cycles) noexcept {
    Breather breather;
    Doubt doubt;
    Complaint refused, disconnected;  // separate, because a device may be refused and disconnected alternately
    int pause_ms = kMinPauseMs;
    bool was_proving = false;  // the link was closed to prove the age, after it had worked
    int refusals = 0;          // openings for a proof that failed in a row
    bool announce = true;      // log "open" immediately; false after a failure: log it once the opening has delivered
    LinkCounts& counts = link.driver->counts;
    while (!stop_.load(std::memory_order_acquire)) {
        const std::string wrong = try_open(*link.driver);
        if (!wrong.empty() && link.is_proving && ++refusals <= kRefusals) {  // a gateway may not have seen the end yet
            pause(kMinPauseMs, cycles);
            continue;
        }
        if (!wrong.empty()) {
            end_stream(link);
            was_proving = false;
            segment_.set_link_count(link.index, TACTILED_LINK_OPEN_FAILED, ++counts[TACTILED_LINK_OPEN_FAILED]);
            segment_.set_link_count(link.index, TACTILED_LINK_RESTARTED, counts[TACTILED_LINK_RESTARTED]);  // by open()
            refused.about(link.name, wrong);
            pause(pause_ms, cycles);
            pause_ms = std::min(2 * pause_ms, kMaxPauseMs);
            continue;
        }
        announce = announce && !link.is_proving;
        refusals = 0;
        link.opened(monotonic_ns(), was_proving);
        if (announce) log_line(LogLevel::info, "link \"{}\": open", link.name);
        segment_.set_link_state(link.index, TACTILED_LINK_OPEN);
        link.connected.store(true, std::memory_order_release);
        pipeline_.serve();
        const std::uint64_t opened_ns = monotonic_ns();
        const std::uint32_t frames = counts[TACTILED_LINK_FRAMES];
        bool present = true, worked = std::exchange(was_proving, false);
        while (present && !stop_.load(std::memory_order_acquire)) {
            {
                const Armed armed;
                const Status status = read_link(link, segment_, pipeline_, kReadTimeoutMs);
                if (status == Status::frame && !link.driver->has_more()) pipeline_.serve();
                present = status != Status::disconnected;
            }
            if (present && shared_.wants(link)) present = shared_.share(link, cycles, stop_, [&] { doubt.look(link); });
            cycles.count();
            doubt.look(link);
            breather.cycle();
            if (worked || counts[TACTILED_LINK_FRAMES] == frames || monotonic_ns() - opened_ns < kWorkedNs) continue;
            worked = true;
            if (!announce) log_line(LogLevel::info, "link \"{}\": open", link.name);
            refused.settled();
            disconnected.settled();
        }
        // The end of the daemon is not a discontinuity of the link.
        if (!present && !link.is_proving) end_stream(link);
        if (present) break;
        if (link.is_proving) {
            was_proving = true;
            link.driver->interrupt();
            pause(int(link.age.closed_ns() / 1'000'000), cycles);
            continue;
        }
        link.driver->close();
        announce = worked;
        if (counts[TACTILED_LINK_FRAMES] != frames && monotonic_ns() - opened_ns >= kPresentNs) pause_ms = kMinPauseMs;
        disconnected.about(link.name, "the device is disconnected; waiting for it to return");
        pause(pause_ms, cycles);
        pause_ms = std::min(2 * pause_ms, kMaxPauseMs);
    }
    link.driver->close();
    segment_.set_link_state(link.index, TACTILED_LINK_CLOSED);
}

void Threads::run_pipeline(std::uint64_t period_ns, Progress::Liveness& wakes) noexcept {
    while (!go_.load(std::memory_order_acquire) && !stop_.load(std::memory_order_acquire))
        sleep_until(monotonic_ns() + 1'000'000u);  // waits until start() has obtained the rights
    if (stop_.load(std::memory_order_acquire)) return;
    pipeline_.open();
    Breather breather;
    WakeWord& word = pipeline_.wake_word();
    std::uint64_t grid_ns = monotonic_ns() + period_ns;  // the thread wakes at these times and at the pipeline's deadlines
    for (;;) {
        const std::uint32_t seen = word.value();  // before `stop_`, so that the wake of stop() is not lost
        if (stop_.load(std::memory_order_acquire)) return;
        bool served;
        {
            const Armed armed;
            served = pipeline_.serve();
        }
        wakes.count();
        breather.cycle();
        grid_ns =
            pipeline_.is_idle() ? std::max(grid_ns, pipeline_.deadline_ns()) : std::min(grid_ns, monotonic_ns() + period_ns);
        std::uint64_t until_ns = std::min(grid_ns, pipeline_.deadline_ns());
        // The runner may be a thread of lower priority on this CPU, which would never finish without a sleep of this thread.
        if (!served) until_ns = std::max(until_ns, monotonic_ns() + kRunnerNs);
        if (!word.sleep(seen, until_ns)) continue;
        const std::uint64_t now_ns = monotonic_ns();
        segment_.count_lateness(now_ns - std::min(now_ns, until_ns));
        if (now_ns < grid_ns) continue;
        const std::uint64_t missed = (now_ns - grid_ns) / period_ns;
        pipeline_.add_missed(missed);
        grid_ns += (missed + 1) * period_ns;  // returns to the grid, without a burst
    }
}

}  // namespace tactiled
