// Notifies programs that use epoll when the daemon has published. A separate thread waits on the segment like any reader and
// sends the notifications, so the cost for the pipeline is at most one wake-up.
//
// Each subscriber gets one end of a socket pair and reads from it, as from an eventfd, the number of node records in 8
// bytes. An eventfd is not used, because the subscriber would share its file description with the daemon and could block the
// daemon's next write() (clear O_NONBLOCK, fill the counter). The ends of a pair have separate file descriptions, and send()
// with MSG_DONTWAIT does not depend on the flags of either end.
#pragma once
#include <atomic>
#include <mutex>
#include <vector>

#include "drivers/descriptor.hpp"
#include "node/realtime.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

class EventFanOut {
public:
    static constexpr std::size_t kMax = 32;

    // `wake_page` is that of SegmentWriter. The thread starts with the first subscriber.
    EventFanOut(std::string node_name, int wake_page) : node_name_(std::move(node_name)), wake_page_(wake_page) {}
    ~EventFanOut();
    EventFanOut(const EventFanOut&) = delete;
    EventFanOut& operator=(const EventFanOut&) = delete;

    // Returns the end for the subscriber, which the caller closes; -1 if there are too many subscribers or no socket pair is
    // available. The subscription lasts until the other end of `connection` is closed. This object keeps a duplicate of
    // `connection`; the caller keeps and closes `connection`.
    int subscribe(int connection);

private:
    struct Subscriber {
        Descriptor connection, event;
        std::uint64_t news;  // number of node records that are not reported yet
    };
    void run() noexcept;
    void follow(const Segment& segment, std::uint32_t* wake) noexcept;
    void tell(std::uint32_t news) noexcept;
    bool drop_disconnected() noexcept;

    std::string node_name_;
    int wake_page_;
    std::mutex mutex_;  // guards the list of subscribers
    std::vector<Subscriber> subscribers_;
    std::atomic<bool> stop_{false};
    bool started_ = false;
    RtThread thread_;
};

}  // namespace tactiled
