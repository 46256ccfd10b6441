// One thread that reads several links. If each link has its own thread, that thread wakes up for each frame, and with many
// links these wake-ups cost more than all other work. Above kBeginReads_per_s, one thread polls all links whose driver can
// be polled, at intervals of kPollNs. Below kEndReads_per_s each link is read by its own thread again.
#pragma once
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "node/pipeline.hpp"
#include "node/progress.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

// Reads at most one frame of the link into its ring. If Status::frame is returned and the driver has no more, a burst
// is complete, and serve() must be called. Called by the thread that reads the link. rt: blocks on the link, for at
// most `timeout_ms`
[[nodiscard]] Status read_link(Link& link, SegmentWriter& segment, Pipeline& pipeline, int timeout_ms) noexcept;

class SharedLinks {
public:
    static constexpr double kBeginReads_per_s = 6000, kEndReads_per_s = 4000;
    static constexpr std::uint64_t kPollNs = 250'000;

    SharedLinks(std::vector<std::unique_ptr<Link>>& links, SegmentWriter& segment, Pipeline& pipeline)
        : links_(links), segment_(segment), pipeline_(pipeline) {}

    // Returns true if the shared thread should read the link, which has just delivered a frame. rt: wait-free; the link's
    // own thread
    [[nodiscard]] bool wants(const Link& link) const noexcept {
        return active_.load(std::memory_order_relaxed) && link.driver->can_poll() && link.read_interval_ns < kFastNs;
    }
    // Lends the link to the shared thread, until that thread returns the link or `stop` is set. Returns false if the device
    // has disconnected. Called by the link's own thread, which counts its liveness meanwhile. rt: blocks
    [[nodiscard]] bool share(Link& link, Progress::Liveness& cycles, const std::atomic<bool>& stop,
                             const std::function<void()>& look) noexcept;

    // Runs the shared thread: measures the rate of reads and reads the lent links, until `stop` is set and wake() is called.
    void run(Progress::Liveness& cycles, const std::atomic<bool>& stop) noexcept;
    void wake() noexcept { end_.wake(); }

private:
    static constexpr std::uint64_t kFastNs = 5'000'000;  // a link with longer intervals costs few wake-ups

    void judge(std::uint64_t now_ns) noexcept;
    [[nodiscard]] bool poll(Link& link) noexcept;

    std::vector<std::unique_ptr<Link>>& links_;
    SegmentWriter& segment_;
    Pipeline& pipeline_;
    std::atomic<bool> active_{false};
    WakeWord end_;
    std::uint64_t judged_ns_ = 0, reads_ = 0;  // at the last evaluation
};

}  // namespace tactiled
