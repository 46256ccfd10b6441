#include "node/shared_links.hpp"

#include "node/realtime.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {
constexpr std::uint64_t kJudgeNs = 500'000'000;  // interval between two measurements of the rate
constexpr std::uint64_t kLookForStopNs = 50'000'000;
}  // namespace

Status read_link(Link& link, SegmentWriter& segment, Pipeline& pipeline, int timeout_ms) noexcept {
    if (link.ring.claim() == nullptr) pipeline.serve();  // the ring is full: the burst is longer than the ring
    const Status status = acquire(link, segment, timeout_ms);
    if (status != Status::frame || link.driver->has_more()) return status;
    const std::uint64_t now_ns = monotonic_ns();
    link.read_interval_ns = now_ns - link.read_ns;
    link.read_ns = now_ns;
    link.reads.store(link.reads.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    return status;
}

bool SharedLinks::share(Link& link, Progress::Liveness& cycles, const std::atomic<bool>& stop,
                        const std::function<void()>& look) noexcept {
    link.lending.lend();
    for (;;) {
        const std::uint32_t seen = link.lending.returned().value();
        if (link.lending.is_returned()) return link.is_present;
        // The last poll of the shared thread may have been before the link was lent.
        const bool ends = stop.load(std::memory_order_acquire) || !active_.load(std::memory_order_relaxed);
        if (ends && link.lending.take_back()) return true;
        cycles.count();
        look();
        (void)link.lending.returned().sleep(seen, monotonic_ns() + kLookForStopNs);
    }
}

// Returns true if the link has new frames.
bool SharedLinks::poll(Link& link) noexcept {
    if (!link.lending.begin()) return false;
    Status status;
    do status = read_link(link, segment_, pipeline_, 0);
    while (status == Status::frame && link.driver->has_more());
    link.is_present = status != Status::disconnected;
    link.lending.end(link.is_present && active_.load(std::memory_order_relaxed));
    return status == Status::frame;
}

void SharedLinks::judge(std::uint64_t now_ns) noexcept {
    if (now_ns - judged_ns_ < kJudgeNs) return;
    std::uint64_t reads = 0;
    for (const auto& link : links_)
        if (link->driver->can_poll()) reads += link->reads.load(std::memory_order_relaxed);
    const double reads_per_s = double(reads - reads_) * 1e9 / double(now_ns - judged_ns_);
    reads_ = reads;
    judged_ns_ = now_ns;
    if (reads_per_s > kBeginReads_per_s) active_.store(true, std::memory_order_relaxed);
    if (reads_per_s < kEndReads_per_s) active_.store(false, std::memory_order_relaxed);
}

void SharedLinks::run(Progress::Liveness& cycles, const std::atomic<bool>& stop) noexcept {
    std::uint64_t next_ns = monotonic_ns();
    bool polls = false;
    for (;;) {
        const std::uint32_t seen = end_.value();
        if (stop.load(std::memory_order_acquire)) return;
        if (polls) {
            const Armed armed;
            bool any = false;
            for (auto& link : links_) any |= poll(*link);
            if (any) pipeline_.serve();  // one cycle for all links
        }
        cycles.count();
        const std::uint64_t now_ns = monotonic_ns();
        const bool was_active = active_.load(std::memory_order_relaxed);
        judge(now_ns);
        // polls once more after sharing has ended, so that the links are returned
        polls = was_active || active_.load(std::memory_order_relaxed);
        next_ns += kPollNs;
        if (next_ns <= now_ns) next_ns = now_ns + kPollNs;  // skips missed polls
        if (polls)
            sleep_until(next_ns);
        else
            (void)end_.sleep(seen, judged_ns_ + kJudgeNs);
    }
}

}  // namespace tactiled
