#include "node/shm/events.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>

namespace tactiled {
namespace {
constexpr std::uint64_t kLookNs = 100'000'000;  // how long a subscriber that is gone stays on the list
}

EventFanOut::~EventFanOut() {
    stop_.store(true);
    thread_.join();
    for (const auto& s : subscribers_) {
        ::close(s.connection);
        ::close(s.event);
    }
}

int EventFanOut::subscribe(int connection) {
    const std::lock_guard lock(mutex_);
    if (subscribers_.size() >= kMost) return -1;
    const int event = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (event < 0) return -1;
    subscribers_.push_back({connection, event});
    if (!started_) {
        thread_.start("events", 0, -1, [this] { run(); });
        started_ = true;
    }
    return event;
}

void EventFanOut::run() noexcept {
    std::string why;
    const Segment segment = Segment::try_open(node_name_, why);
    if (!segment.is_open()) return;
    void* const wake = ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, wake_page_, 0);
    if (wake == MAP_FAILED) return;
    std::uint64_t looked_ns = 0;
    std::uint32_t told = tactiled_ring_head(segment.base(), &segment.header().node);
    while (!stop_.load()) {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - looked_ns >= kLookNs) {
            looked_ns = now_ns;
            if (!drop_gone()) {
                sleep_until(now_ns + kLookNs);
                continue;
            }
        }
        tactiled_sleep_on_node(segment.c(), static_cast<std::uint32_t*>(wake), told, now_ns, now_ns + kLookNs);
        const std::uint32_t head = tactiled_ring_head(segment.base(), &segment.header().node);
        const std::uint64_t news = head - told;
        told = head;
        if (news == 0) continue;
        const std::lock_guard lock(mutex_);
        for (const auto& s : subscribers_) {
            [[maybe_unused]] const auto written = ::write(s.event, &news, sizeof news);  // full only at 2^64 - 1
        }
    }
    ::munmap(wake, sizeof(tactiled_wake));
}

// False when nobody is left.
bool EventFanOut::drop_gone() noexcept {
    const std::lock_guard lock(mutex_);
    const auto gone = [](const Subscriber& s) {
        pollfd p{s.connection, POLLIN, 0};
        if (::poll(&p, 1, 0) != 1) return false;  // nothing is ever said on it but goodbye
        ::close(s.connection);
        ::close(s.event);
        return true;
    };
    subscribers_.erase(std::remove_if(subscribers_.begin(), subscribers_.end(), gone), subscribers_.end());
    return !subscribers_.empty();
}

}  // namespace tactiled
