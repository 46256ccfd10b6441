// The operations of a scenario's threads: each is a point of the schedule, then a choice of messages or places.
#include <cstring>

#include "explorer.hpp"

namespace orders {
namespace {

std::uint64_t get(const void* address, unsigned size) noexcept {
    std::uint64_t value = 0;
    std::memcpy(&value, address, size);
    return value;
}
void put(void* address, unsigned size, std::uint64_t value) noexcept { std::memcpy(address, &value, size); }

}  // namespace

const void* Explorer::canonical(const void* address) const noexcept {
    for (const auto& alias : aliases_) {
        const auto offset = std::uintptr_t(address) - std::uintptr_t(alias.second);
        if (offset < alias.size) return static_cast<const char*>(alias.first) + offset;
    }
    return address;
}

// A word that one thread alone uses, or that no thread stores, needs no place in the schedule. The address stands for the
// same word in every execution.
bool Explorer::is_shared(const void* address, bool stores) {
    Use& use = uses_[address];
    const bool was = use.stored && (use.threads & (use.threads - 1)) != 0;
    use.threads |= 1u << running_;
    use.stored |= stores;
    const bool is = use.stored && (use.threads & (use.threads - 1)) != 0;
    if (is && !was) leave(Stop::anew);
    return is;
}

void Explorer::remember(void* address, unsigned size) { before_.push_back({address, size, get(address, size)}); }

int Explorer::locate(void* address, unsigned size) { return memory_.location(canonical(address), get(address, size)); }

std::uint64_t Explorer::load(void* address, unsigned size, std::memory_order order, bool always_shared) {
    if (running_ < 0 || (!always_shared && !is_shared(canonical(address), false))) return get(address, size);
    const int location = locate(address, size);
    announce({Kind::load, location, is_ordered(order)});
    const int message = choose(memory_.readable(running_, location, order, false));
    tell("load", location, memory_.at(location).messages[std::size_t(message)].value);
    return memory_.read(running_, location, message, order);
}

void Explorer::store(void* address, unsigned size, std::uint64_t value, std::memory_order order, bool always_shared) {
    if (running_ < 0) return put(address, size, value);
    if (!always_shared && !is_shared(canonical(address), true)) {
        remember(address, size);
        return put(address, size, value);
    }
    const int location = locate(address, size);
    announce({Kind::store, location, is_ordered(order)});
    if (!always_shared) remember(address, size);
    tell("store", location, value);
    const int place = choose(memory_.writable(running_, location, order));
    if (memory_.write(running_, location, place, value, order)) put(address, size, value);
}

std::uint64_t Explorer::modify(void* address, unsigned size, std::memory_order order, std::memory_order failure,
                               const std::function<bool(std::uint64_t old, std::uint64_t& value)>& change) {
    std::uint64_t value = 0;
    if (running_ < 0) {
        const std::uint64_t old = get(address, size);
        if (change(old, value)) put(address, size, value);
        return old;
    }
    const int location = locate(address, size);
    announce({Kind::modify, location, is_ordered(order) || is_ordered(failure)});
    Options options;
    const Options coherent = memory_.readable(running_, location, order, false);
    for (int i = 0; i < coherent.count; ++i) {  // one that fails may read what another read-modify-write has read, too
        const int message = coherent.of[std::size_t(i)];
        const Message& m = memory_.at(location).messages[std::size_t(message)];
        if (!m.is_read_by_rmw || !change(m.value, value)) options.add(message);
    }
    const int message = choose(options);
    const std::uint64_t old = memory_.at(location).messages[std::size_t(message)].value;
    const bool changes = change(old, value);
    memory_.read(running_, location, message, changes ? order : failure);
    tell("modify", location, old);
    tell(changes ? "to" : "not", location, value);
    if (!changes) return old;
    const int place = memory_.at(location).messages[std::size_t(message)].place + 1;
    if (memory_.write(running_, location, place, value, order, message)) put(address, size, value);
    return old;
}

void Explorer::fence(std::memory_order order) {
    if (running_ < 0) return;
    if (is_ordered(order)) announce({Kind::fence, -1, true});
    memory_.fence(running_, order);
}

// The kernel interrupts each processor that runs a thread of the daemon, in no certain order.
void Explorer::membarrier() {
    if (running_ < 0) return;
    const int self = running_;
    fence(std::memory_order_seq_cst);
    for (int t = 0; t < n_threads_; ++t) {
        if (t == self || !fibers_[std::size_t(t)].daemon) continue;
        announce({Kind::interrupt, -1, true, t});
        tell("membarrier at thread", -1, std::uint64_t(t));
        memory_.fence(t, std::memory_order_seq_cst);
    }
    fence(std::memory_order_seq_cst);
}

// The kernel counts the waiter, executes a full barrier, compares, and queues the thread under the lock that FUTEX_WAKE
// takes, too; FUTEX_WAKE executes a full barrier before it looks for waiters (kernel/futex/core.c, "ordering").
bool Explorer::futex_wait(void* address, std::uint32_t expected) {
    if (running_ < 0) return false;
    const int self = running_, location = locate(address, 4);
    announce({Kind::load, location, true});
    memory_.fence(self, std::memory_order_seq_cst);
    const int message = choose(memory_.readable(self, location, std::memory_order_relaxed, false));
    tell("FUTEX_WAIT", location, memory_.at(location).messages[std::size_t(message)].value);
    if (memory_.read(self, location, message, std::memory_order_relaxed) != expected) return false;
    Fiber& fiber = fibers_[std::size_t(self)];
    fiber.sleeps_on = canonical(address);
    fiber.next = {Kind::resume, -1, false};
    schedule();
    fiber.next = {Kind::fence, -1, false};
    tell("woken", location, 0);
    return true;
}

int Explorer::futex_wake(void* address, int count) {
    if (running_ < 0) return 0;
    announce({Kind::fence, -1, true});
    memory_.fence(running_, std::memory_order_seq_cst);
    int woken = 0;
    for (int t = 0; t < n_threads_ && woken < count; ++t)
        if (fibers_[std::size_t(t)].sleeps_on == canonical(address)) {
            fibers_[std::size_t(t)].sleeps_on = nullptr;
            ++woken;
        }
    tell("FUTEX_WAKE", -1, std::uint64_t(woken));
    return woken;
}

// After kMaxNaps the thread goes on when another one has stored, or none is left that could: then it sees all stores.
void Explorer::nap() {
    if (running_ < 0) return;
    Fiber& self = fibers_[std::size_t(running_)];
    ++self.naps;
    announce({Kind::nap, -1, false});
    tell("nap", -1, 0);
    if (!self.settles) return;
    memory_.settle(running_);
    self.settles = false;
    self.naps = kSettled - 1;  // the next nap ends when another thread has stored
}

}  // namespace orders
