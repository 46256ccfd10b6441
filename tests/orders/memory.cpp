#include "memory.hpp"

#include <cstdio>
#include <cstdlib>

namespace orders {

void Memory::clear(int threads) noexcept {
    n_locations_ = 0;
    n_threads_ = threads;
    for (int t = 0; t < threads; ++t) threads_[std::size_t(t)] = {};
    for (int t = 0; t < threads; ++t) tick(t);
    ordered_ = {};
}

int Memory::location(const void* address, std::uint64_t value) {
    for (int i = 0; i < n_locations_; ++i)
        if (locations_[std::size_t(i)].address == address) return i;
    if (n_locations_ == kMaxLocations) {
        std::fprintf(stderr, "more than %d shared locations\n", kMaxLocations);
        std::abort();
    }
    if (n_locations_ == int(locations_.size())) locations_.emplace_back();
    Location& fresh = locations_[std::size_t(n_locations_)];
    fresh.address = address;
    fresh.messages.clear();
    fresh.messages.push_back({value, {}, 0, 0, 0, false});
    fresh.order.assign(1, 0);
    fresh.hash = 0;
    return n_locations_++;
}

void Memory::raise(View& view, int location, int message) const noexcept {
    const auto& messages = locations_[std::size_t(location)].messages;
    std::uint8_t& known = view.message[std::size_t(location)];
    if (messages[std::size_t(message)].place > messages[known].place) known = std::uint8_t(message);
}

void Memory::join(View& into, const View& from, bool clocks) const noexcept {
    for (int i = 0; i < n_locations_; ++i)
        if (from.message[std::size_t(i)] != into.message[std::size_t(i)]) raise(into, i, from.message[std::size_t(i)]);
    if (!clocks) return;
    for (int t = 0; t < n_threads_; ++t)
        if (from.clock[std::size_t(t)] > into.clock[std::size_t(t)]) into.clock[std::size_t(t)] = from.clock[std::size_t(t)];
}

// The first place in modification order that an operation of `thread` may read, or behind which it may store.
int Memory::bound(int thread, int location, std::memory_order order) const noexcept {
    const auto& messages = locations_[std::size_t(location)].messages;
    int place = messages[threads_[std::size_t(thread)].current.message[std::size_t(location)]].place;
    if (is_ordered(order)) place = std::max(place, int(messages[ordered_.message[std::size_t(location)]].place));
    return place;
}

Options Memory::readable(int thread, int location, std::memory_order order, bool to_modify) const noexcept {
    const Location& l = locations_[std::size_t(location)];
    Options options;
    for (int place = int(l.order.size()) - 1, first = bound(thread, location, order); place >= first; --place) {
        const int message = l.order[std::size_t(place)];
        if (!to_modify || !l.messages[std::size_t(message)].is_read_by_rmw) options.add(message);
    }
    return options;
}

std::uint64_t Memory::read(int thread, int location, int message, std::memory_order order) noexcept {
    Thread& t = threads_[std::size_t(thread)];
    const Message& m = locations_[std::size_t(location)].messages[std::size_t(message)];
    raise(t.current, location, message);
    raise(t.acquired, location, message);
    join(t.acquired, m.released);
    if (is_acquire(order)) join(t.current, m.released);
    if (is_ordered(order)) raise(ordered_, location, message);
    tick(thread);
    return m.value;
}

Options Memory::writable(int thread, int location, std::memory_order order) const noexcept {
    const Location& l = locations_[std::size_t(location)];
    Options options;
    for (int place = int(l.order.size()), first = bound(thread, location, order); place > first; --place)
        if (!l.messages[l.order[std::size_t(place - 1)]].is_read_by_rmw) options.add(place);
    return options;
}

bool Memory::write(int thread, int location, int place, std::uint64_t value, std::memory_order order, int modified) {
    Thread& t = threads_[std::size_t(thread)];
    Location& l = locations_[std::size_t(location)];
    const int message = int(l.messages.size());
    if (message >= kMaxMessages) {
        std::fprintf(stderr, "more than %d stores to one location\n", kMaxMessages);
        std::abort();
    }
    std::uint64_t nth = 1;
    for (const Message& m : l.messages) nth += m.identity >> 8 == std::uint64_t(thread) + 1;
    l.messages.push_back({value, t.released, 0, (std::uint64_t(thread) + 1) << 8 | nth, std::uint8_t(place), false});
    l.order.insert(l.order.begin() + place, std::uint8_t(message));
    for (std::size_t later = std::size_t(place) + 1; later < l.order.size(); ++later)
        l.messages[l.order[later]].place = std::uint8_t(later);
    raise(t.current, location, message);
    raise(t.acquired, location, message);
    Message& m = l.messages.back();
    if (is_release(order)) m.released = t.current;
    raise(m.released, location, message);
    if (modified >= 0) {  // continues the release sequence
        l.messages[std::size_t(modified)].is_read_by_rmw = true;
        join(m.released, l.messages[std::size_t(modified)].released);
    }
    if (is_ordered(order)) raise(ordered_, location, message);
    m.released_hash = hash_of(m.released);
    hash_location(l);
    tick(thread);
    return std::size_t(place) + 1 == l.order.size();
}

void Memory::fence(int thread, std::memory_order order) noexcept {
    Thread& t = threads_[std::size_t(thread)];
    if (is_acquire(order)) join(t.current, t.acquired);
    if (is_ordered(order)) {
        join(t.current, ordered_, false);
        join(ordered_, t.current, false);
    }
    join(t.acquired, t.current);
    if (is_release(order)) t.released = t.current;
    tick(thread);
}

void Memory::settle(int thread) noexcept {
    Thread& t = threads_[std::size_t(thread)];
    for (int i = 0; i < n_locations_; ++i) {
        raise(t.current, i, locations_[std::size_t(i)].order.back());
        raise(t.acquired, i, locations_[std::size_t(i)].order.back());
    }
    t.changed = true;
}

std::uint64_t Memory::hash_of(const View& view) const noexcept {
    std::uint64_t sum = 0;  // without an order of locations: their indices come from their first use
    for (std::size_t i = 0; i < std::size_t(n_locations_); ++i)
        if (view.message[i] != 0)
            sum += mix(std::uint64_t(locations_[i].address), locations_[i].messages[view.message[i]].identity);
    for (std::size_t t = 0; t < std::size_t(n_threads_); ++t) sum = mix(sum, view.clock[t]);
    return sum;
}

void Memory::hash_location(Location& location) const noexcept {
    location.hash = std::uint64_t(location.address);
    for (const auto message : location.order) {
        const Message& m = location.messages[message];
        location.hash =
            mix(mix(location.hash, m.identity << 1 | std::uint64_t(m.is_read_by_rmw)), mix(m.value, m.released_hash));
    }
}

std::uint64_t Memory::hash() noexcept {
    std::uint64_t all = hash_of(ordered_);
    for (std::size_t t = 0; t < std::size_t(n_threads_); ++t) {
        Thread& thread = threads_[t];
        if (thread.changed)
            thread.hash = mix(mix(hash_of(thread.current), hash_of(thread.acquired)), hash_of(thread.released));
        thread.changed = false;
        all = mix(all, thread.hash);
    }
    std::uint64_t sum = 0;
    for (int i = 0; i < n_locations_; ++i) sum += locations_[std::size_t(i)].hash;
    return mix(all, sum);
}

}  // namespace orders
