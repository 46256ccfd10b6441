#include "node/bridges/follower.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cassert>
#include <cerrno>

#include "drivers/descriptor.hpp"

namespace tactiled::bridges {
namespace {

constexpr std::uint64_t kTryEachNs = 100'000'000;
// The longest sleep: a daemon that dies wakes nobody.
constexpr std::uint64_t kLongestNs = 20'000'000;
constexpr std::uint64_t kAskEachNs = 1'000'000'000;

}  // namespace

Follower::~Follower() { forget_wakes(); }

void Follower::forget_wakes() {
    if (wake_ != nullptr) ::munmap(wake_, sizeof(tactiled_wake));
    wake_ = nullptr;
    asked_ns_ = 0;
}

void Follower::look() {
    const std::uint64_t now_ns = monotonic_ns();
    if (!alive_) attach(now_ns);
    alive_ = false;
    if (!segment_.is_open()) return;
    seen_ = tactiled_ring_head(segment_.base(), &segment_.c()->node);  // before the samples: a later record ends wait()
    if (!segment_.latest_node(node_)) {
        why_ = "the daemon is starting";
    } else if (!segment_.is_current()) {
        why_ = "the daemon has ended";
    } else if (tactiled_is_alive(segment_.c(), node_.t_ns, monotonic_ns()) == 0) {
        why_ = "the daemon does not respond: it was killed, or hangs";
    } else {
        alive_ = true;
        why_.clear();
    }
    if (!alive_ && !unreadable_.empty()) why_ = unreadable_;
    const std::uint32_t reloads = __atomic_load_n(&segment_.header().reloads, __ATOMIC_ACQUIRE);
    if (reloads % 2 == 0 && std::exchange(reloads_, reloads) != reloads) ++structure_;
}

void Follower::attach(std::uint64_t now_ns) {
    if (now_ns - tried_ns_ < kTryEachNs) return;
    tried_ns_ = now_ns;
    errno = 0;
    Segment fresh = Segment::try_open(node_name_, why_);
    unreadable_ = fresh.is_open() || errno == ENOENT ? "" : why_;
    if (!fresh.is_open() || !fresh.is_current()) return;
    const auto& is = fresh.header();
    const bool first = !segment_.is_open();
    if (!first && segment_.header().epoch == is.epoch && segment_.header().pid == is.pid) return;
    for (bool& owes : owes_end_) owes = false;  // next() has given the end in the rounds since
    forget_wakes();
    segment_ = std::move(fresh);
    assert(segment_.n_sensors() <= cursor_.size());  // try_open() has refused it otherwise
    ++structure_;
    reloads_ = __atomic_load_n(&segment_.header().reloads, __ATOMIC_ACQUIRE);
    for (std::uint32_t i = 0; i < segment_.n_sensors(); ++i) {
        cursor_[i] = {};
        last_[i] = {};
        if (first) tactiled_ring_seek(segment_.base(), &segment_.c()->ring[i], &cursor_[i], 0);
    }
}

bool Follower::next(std::uint32_t sensor, tactiled_sample& sample) {
    if (sensor >= n_sensors()) return false;
    tactiled_cursor& cursor = cursor_[sensor];
    const std::uint64_t lost = cursor.lost;
    const bool found =
        tactiled_ring_next(segment_.base(), &segment_.c()->ring[sensor], &cursor, &sample, sizeof sample) != 0;
    missed_ += cursor.lost - lost;
    if (found) {
        tactiled_judge(&sample, segment_.c()->stale_ms[sensor], monotonic_ns());
        if (!alive_ || tactiled_is_whole(segment_.base(), segment_.c()->size, segment_.c()->entry) == 0)
            tactiled_invalidate(&sample, TACTILED_STALE);
        last_[sensor] = sample;
        owes_end_[sensor] = true;
        return true;
    }
    if (alive_ || !std::exchange(owes_end_[sensor], false)) return false;
    sample = last_[sensor];
    tactiled_invalidate(&sample, TACTILED_DAEMON_STOPPED);
    return true;
}

void Follower::ask_for_wakes(std::uint64_t now_ns, std::uint64_t until_ns) {
    if (asked_ns_ != 0 && now_ns - asked_ns_ < kAskEachNs) return;
    const Descriptor fd(tactiled_ask_descriptor(segment_.c(), "wake", nullptr, until_ns));
    if (fd >= 0 && tactiled_is_wake_page(fd) != 0) {
        void* const page = ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        if (page != MAP_FAILED) wake_ = static_cast<std::uint32_t*>(page);
    }
    asked_ns_ = now_ns;
}

void Follower::wait(std::uint64_t until_ns, std::uint64_t spacing_ns) {
    std::uint64_t now_ns = monotonic_ns();
    const std::uint64_t earliest_ns = std::min(woke_ns_ + spacing_ns, until_ns);
    if (now_ns < earliest_ns) {
        tactiled_sleep_until(earliest_ns);
        now_ns = monotonic_ns();
    }
    until_ns = std::min(until_ns, now_ns + kLongestNs);
    if (now_ns < until_ns && spacing_ns < kLongestNs) {
        if (alive_ && wake_ == nullptr) ask_for_wakes(now_ns, until_ns);
        if (alive_ && wake_ != nullptr)
            tactiled_sleep_on_node(segment_.c(), wake_, seen_, now_ns, until_ns);
        else
            tactiled_sleep_until(alive_ ? std::min(until_ns, now_ns + 1'000'000) : until_ns);
    }
    woke_ns_ = monotonic_ns();
}

}  // namespace tactiled::bridges
