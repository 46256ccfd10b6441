// Tells programs that live on epoll when the daemon has published. A thread of its own sleeps on the segment as any reader
// does and tells them, so the pipeline pays for one wake at most.
//
// Each gets one end of a socket pair and reads it as it would an eventfd: 8 bytes, how many node records. Not an eventfd:
// whoever has one shares its file description with us and can make our next write() wait for ever (clear O_NONBLOCK, fill
// the counter). The ends of a pair are two descriptions, and send() with MSG_DONTWAIT heeds no flag of either.
#pragma once
#include <atomic>
#include <mutex>
#include <vector>

#include "node/realtime.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

class EventFanOut {
public:
    static constexpr std::size_t kMax = 32;

    // `wake_page` as SegmentWriter has it. The thread starts with the first subscriber.
    EventFanOut(std::string node_name, int wake_page) : node_name_(std::move(node_name)), wake_page_(wake_page) {}
    ~EventFanOut();
    EventFanOut(const EventFanOut&) = delete;
    EventFanOut& operator=(const EventFanOut&) = delete;

    // The end to hand out, which the caller closes; -1 when there are too many or none is to be had. The subscription lasts
    // until the other end of `connection` is closed; the caller keeps `connection`, this a duplicate of its own, so that
    // neither closes a number under the other.
    int subscribe(int connection);

private:
    struct Subscriber {
        int connection, event;
        std::uint64_t news;  // node records that it was not told of yet
    };
    void run() noexcept;
    void follow(const Segment& segment, std::uint32_t* wake) noexcept;
    void tell(std::uint32_t news) noexcept;
    bool drop_disconnected() noexcept;

    std::string node_name_;
    int wake_page_;
    std::mutex mutex_;  // of the list
    std::vector<Subscriber> subscribers_;
    std::atomic<bool> stop_{false};
    bool started_ = false;
    RtThread thread_;
};

}  // namespace tactiled
