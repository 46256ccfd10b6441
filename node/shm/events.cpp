#include "node/shm/events.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

namespace tactiled {
namespace {
constexpr std::uint64_t kLookNs = 100'000'000;  // maximum time for which a disconnected subscriber stays on the list
}

EventFanOut::~EventFanOut() {
    stop_.store(true);
    thread_.join();
}

int EventFanOut::subscribe(int connection) {
    const std::lock_guard lock(mutex_);
    if (subscribers_.size() >= kMax) return -1;
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) != 0) return -1;
    Descriptor event(ends[0]), theirs(ends[1]), ours(::fcntl(connection, F_DUPFD_CLOEXEC, 0));
    if (ours < 0) return -1;
    const int min = 1;  // the kernel uses its minimum: at most a few packets wait for a subscriber
    ::setsockopt(event, SOL_SOCKET, SO_SNDBUF, &min, sizeof min);
    subscribers_.push_back({std::move(ours), std::move(event), 0});
    if (!started_) {
        thread_.start("events", 0, -1, [this] { run(); });
        started_ = true;
    }
    return theirs.release();
}

void EventFanOut::run() noexcept {
    while (!stop_.load()) {  // repeats, because a lack of descriptors or memory is temporary
        std::string why;
        const Segment segment = Segment::try_open(node_name_, why);
        void* const wake = ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, wake_page_, 0);
        if (segment.is_open() && wake != MAP_FAILED) follow(segment, static_cast<std::uint32_t*>(wake));
        if (wake != MAP_FAILED) ::munmap(wake, sizeof(tactiled_wake));
        if (!stop_.load()) sleep_until(monotonic_ns() + kLookNs);
    }
}

// Runs until the segment ends.
void EventFanOut::follow(const Segment& segment, std::uint32_t* wake) noexcept {
    std::uint64_t looked_ns = 0;
    std::uint32_t reported = tactiled_ring_head(segment.base(), &segment.header().node);
    tell(1);  // a record may have been published between the subscriber's read and this one
    while (!stop_.load()) {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - looked_ns >= kLookNs) {
            looked_ns = now_ns;
            if (!drop_disconnected()) {
                sleep_until(now_ns + kLookNs);
                continue;
            }
        }
        tactiled_sleep_on_node(segment.c(), wake, reported, now_ns, now_ns + kLookNs);
        const std::uint32_t head = tactiled_ring_head(segment.base(), &segment.header().node);
        tell(head - reported);
        reported = head;
    }
}

// A subscriber whose buffer is full still has an unread event; it is notified with the next record.
void EventFanOut::tell(std::uint32_t news) noexcept {
    const std::lock_guard lock(mutex_);
    for (auto& s : subscribers_) {
        s.news += news;
        if (s.news != 0 && ::send(s.event, &s.news, sizeof s.news, MSG_DONTWAIT | MSG_NOSIGNAL) > 0) s.news = 0;
    }
}

// Returns false if there is no subscriber left.
bool EventFanOut::drop_disconnected() noexcept {
    const std::lock_guard lock(mutex_);
    const auto disconnected = [](const Subscriber& s) {
        pollfd p{s.connection, POLLIN, 0};
        return ::poll(&p, 1, 0) == 1;  // a subscriber sends no data, so an event is its end
    };
    std::erase_if(subscribers_, disconnected);
    return !subscribers_.empty();
}

}  // namespace tactiled
