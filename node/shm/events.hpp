// Tells programs that live on epoll when the daemon has published: each gets an eventfd that counts node records. A thread
// of its own sleeps on the segment as any reader does and writes the eventfds, so the pipeline pays for one wake at most.
#pragma once
#include <atomic>
#include <mutex>
#include <vector>

#include "node/realtime.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

class EventFanOut {
public:
    static constexpr std::size_t kMost = 32;

    // `wake_page` as SegmentWriter has it. The thread starts with the first subscriber.
    EventFanOut(std::string node_name, int wake_page) : node_name_(std::move(node_name)), wake_page_(wake_page) {}
    ~EventFanOut();
    EventFanOut(const EventFanOut&) = delete;
    EventFanOut& operator=(const EventFanOut&) = delete;

    // The eventfd to hand out, -1 when there are too many or none is to be had. Takes over `connection` if it gives one:
    // the subscription lasts until its other end is closed.
    int subscribe(int connection);

private:
    struct Subscriber {
        int connection, event;
    };
    void run() noexcept;
    bool drop_gone() noexcept;

    std::string node_name_;
    int wake_page_;
    std::mutex mutex_;  // of the list
    std::vector<Subscriber> subscribers_;
    std::atomic<bool> stop_{false};
    bool started_ = false;
    RtThread thread_;
};

}  // namespace tactiled
