// The threads of a node's data path: one for each link, which opens, reads and reopens its device and delivers its frames;
// one for the pipeline's time limits and commands; with several links one that can read them together (shared_links.hpp);
// one that wakes sleeping readers.
#pragma once
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "node/pipeline.hpp"
#include "node/progress.hpp"
#include "node/realtime.hpp"
#include "node/setup.hpp"
#include "node/shared_links.hpp"
#include "node/shm/waker.hpp"

namespace tactiled {

class Threads {
public:
    Threads(Node& node, SegmentWriter& segment, Pipeline& pipeline);
    ~Threads() {
        stop();
        pipeline_.announce_to(nullptr, nullptr);
    }

    // Starts all threads. Returns the refused rights, one line each; RT_DEGRADED is then set before the loop begins.
    // setup: throws SetupError where a thread cannot be made, or a right is refused and [realtime] required is set
    std::vector<std::string> start();
    // Liveness counters of the real-time threads.
    Progress& progress() noexcept { return progress_; }
    // Returns when all threads have ended, at most about 0.1 s later.
    void stop() noexcept;

private:
    void end_stream(Link& link) noexcept;
    void run_link(Link& link, Progress::Liveness& cycles) noexcept;
    void run_pipeline(std::uint64_t period_ns, Progress::Liveness& wakes) noexcept;
    void pause(int ms, Progress::Liveness& cycles) const noexcept;

    Node& node_;
    SegmentWriter& segment_;
    Pipeline& pipeline_;
    Progress progress_;
    Progress::Liveness cycles_;
    Waker waker_{segment_};
    SharedLinks shared_;
    std::vector<std::unique_ptr<RtThread>> threads_;
    std::atomic<bool> go_{false}, stop_{false};
};

}  // namespace tactiled
