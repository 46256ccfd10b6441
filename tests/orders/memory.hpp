// One execution's memory under the C11 model, without the scheduler: every store ever made is kept, and a load may take any
// of them that coherence and happens-before do not forbid.
//
// The machine is that of Kang et al., "A promising semantics for relaxed-memory concurrency" (POPL 2017), without promises.
// It has the same executions as the axioms of RC11 (Lahav et al., PLDI 2017) where the program has no seq_cst access.
// A release sequence is that of C++20: a store of the same thread does not continue it, a read-modify-write does.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

namespace orders {

inline constexpr int kMaxThreads = 6, kMaxLocations = 192, kMaxMessages = 250;

[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t a, std::uint64_t b) noexcept {
    std::uint64_t x = (a ^ (b + 0x9E3779B97F4A7C15u)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 31)) * 0x94D049BB133111EBu;
    return x ^ (x >> 29);
}
[[nodiscard]] constexpr bool is_acquire(std::memory_order order) noexcept {
    return order == std::memory_order_acquire || order == std::memory_order_acq_rel || order == std::memory_order_seq_cst;
}
[[nodiscard]] constexpr bool is_release(std::memory_order order) noexcept {
    return order == std::memory_order_release || order == std::memory_order_acq_rel || order == std::memory_order_seq_cst;
}
[[nodiscard]] constexpr bool is_ordered(std::memory_order order) noexcept { return order == std::memory_order_seq_cst; }

// The newest message of each location that its owner has to respect, and what happens before its owner's next operation.
struct View {
    std::array<std::uint8_t, kMaxLocations> message{};
    std::array<std::uint16_t, kMaxThreads> clock{};
};

// A store. `place` is its index in the location's modification order.
struct Message {
    std::uint64_t value;
    View released;                          // passed on to a thread that acquires it
    std::uint64_t released_hash, identity;  // the same for the same store in another interleaving; the initial value's are 0
    std::uint8_t place;
    bool is_read_by_rmw;  // its successor in modification order is a read-modify-write that read it
};

struct Location {
    const void* address;
    std::vector<Message> messages;    // in the order in which they were made; 0 is the initial value
    std::vector<std::uint8_t> order;  // messages in modification order
    std::uint64_t hash;
};

// Options of one operation: messages to read, or places in modification order.
struct Options {
    std::array<std::uint8_t, kMaxMessages + 2> of;
    int count = 0;
    void add(int option) noexcept { of[std::size_t(count++)] = std::uint8_t(option); }
};

class Memory {
public:
    // Forgets everything.
    void clear(int threads) noexcept;

    // Index of the location of `address`, which begins with `value`.
    int location(const void* address, std::uint64_t value);
    [[nodiscard]] const Location& at(int location) const noexcept { return locations_[std::size_t(location)]; }

    // Messages that `thread` may read, newest first. `to_modify`: by a read-modify-write.
    [[nodiscard]] Options readable(int thread, int location, std::memory_order order, bool to_modify) const noexcept;
    // Reads one of them.
    std::uint64_t read(int thread, int location, int message, std::memory_order order) noexcept;

    // Places in modification order that a store of `thread` may take, newest first.
    [[nodiscard]] Options writable(int thread, int location, std::memory_order order) const noexcept;
    // Stores `value` at one of them. `modified`: the message that a read-modify-write has read, else -1. True where it is
    // now the last in modification order.
    bool write(int thread, int location, int place, std::uint64_t value, std::memory_order order, int modified = -1);

    void fence(int thread, std::memory_order order) noexcept;
    // Time passes: all stores become visible to `thread`. They do not happen before its next operation.
    void settle(int thread) noexcept;

    // True when all that `thread` did up to its `clock` happens before the next operation of `by`.
    [[nodiscard]] bool happened(int thread, std::uint16_t clock, int by) const noexcept {
        return threads_[std::size_t(by)].current.clock[std::size_t(thread)] >= clock;
    }
    [[nodiscard]] std::uint16_t clock(int thread) const noexcept {
        return threads_[std::size_t(thread)].current.clock[std::size_t(thread)];
    }

    // Hash of everything that later operations depend on. The order of operations that commute does not change it.
    [[nodiscard]] std::uint64_t hash() noexcept;

private:
    struct Thread {
        View current;   // bounds the next operation
        View acquired;  // and after an acquire fence
        View released;  // at the last release fence; a relaxed store passes it on
        std::uint64_t hash;
        bool changed;
    };

    [[nodiscard]] int bound(int thread, int location, std::memory_order order) const noexcept;
    void join(View& into, const View& from, bool clocks = true) const noexcept;
    void raise(View& view, int location, int message) const noexcept;
    void tick(int thread) noexcept {
        ++threads_[std::size_t(thread)].current.clock[std::size_t(thread)];
        threads_[std::size_t(thread)].changed = true;
    }
    [[nodiscard]] std::uint64_t hash_of(const View& view) const noexcept;
    void hash_location(Location& location) const noexcept;

    std::vector<Location> locations_;  // the vectors beyond n_locations_ keep their memory
    int n_locations_ = 0, n_threads_ = 0;
    std::array<Thread, kMaxThreads> threads_{};
    View ordered_;  // the seq_cst operations so far, in the order of the execution
};

}  // namespace orders
