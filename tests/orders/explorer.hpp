// Runs a scenario in every way that the C11 model allows: every interleaving of its threads' operations, every store that a
// load may read, every place in modification order that a store may take. Depth first; each execution starts anew.
//
// Sleep sets (Godefroid 1996) leave out interleavings that cannot differ from one already explored. A load may read old
// stores, so it need not come before a store of another thread; only a store followed by a load of its location matters.
#pragma once
#include <ucontext.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "memory.hpp"
#include "sites.hpp"

namespace orders {

// One execution, as a scenario sets it up. Before the threads run and after they have ended, shared memory is plain memory.
class Execution {
public:
    // `daemon`: of the process that a membarrier of another one reaches.
    void thread(std::function<void()> body, bool daemon = true) { threads.push_back({std::move(body), daemon}); }
    // Makes an object that the threads share, at the same address in each execution: states are compared by addresses.
    template <class T, class... A>
    [[nodiscard]] std::shared_ptr<T> make(A&&... arguments) {
        void* const at = take(sizeof(T), alignof(T));
        return {new (at) T(std::forward<A>(arguments)...), [](T* object) { object->~T(); }};
    }
    // After the last thread has ended, or can only sleep.
    void at_end(std::function<void()> check) { end = std::move(check); }

    struct Thread {
        std::function<void()> body;
        bool daemon;
    };
    std::vector<Thread> threads;
    std::function<void()> end;

private:
    void* take(std::size_t size, std::size_t alignment);
    std::size_t taken_ = 0;
};

struct Scenario {
    std::string name, bounds;
    std::function<void(Execution&)> build;
    bool may_sleep = false;  // threads may sleep at the end: `at_end` looks at is_asleep()
};

struct Outcome {
    std::string violation;                     // "" = none
    std::string story;                         // the operations of the execution that violates
    std::uint64_t executions = 0, pruned = 0;  // complete ones, and those that only repeated another
};

class Explorer {
public:
    Explorer();
    enum class Prune { nothing, repetitions, states };  // `states`: repetitions, too
    // Stops at the first violation, or after `limit` executions, which is a violation too.
    Outcome explore(const Scenario& scenario, const Plant* plant = nullptr, Prune prune = Prune::states,
                    std::uint64_t limit = 20'000'000);

    // ---- for the operations; -1 = no thread of an execution: memory is plain ----
    [[nodiscard]] int thread() const noexcept { return running_; }
    std::uint64_t load(void* address, unsigned size, std::memory_order order, bool always_shared);
    void store(void* address, unsigned size, std::uint64_t value, std::memory_order order, bool always_shared);
    // `change` returns false where the value stays, as a failed compare-exchange does.
    std::uint64_t modify(void* address, unsigned size, std::memory_order order, std::memory_order failure,
                         const std::function<bool(std::uint64_t old, std::uint64_t& value)>& change);
    void fence(std::memory_order order);
    void membarrier();
    bool futex_wait(void* address, std::uint32_t expected);  // false: the word has another value
    int futex_wake(void* address, int count);
    void nap();  // the thread goes on after a step of another one

    [[nodiscard]] const Plant* plant() const noexcept { return plant_; }
    [[nodiscard]] bool is_asleep(int thread) const noexcept { return fibers_[std::size_t(thread)].sleeps_on != nullptr; }
    // `second` maps the memory of `first`.
    void same_memory(const void* first, const void* second, std::size_t size) { aliases_.push_back({first, second, size}); }
    void forget_memory() { aliases_.clear(); }
    // Ends the execution: a property is violated.
    void fail(const std::string& what);
    [[nodiscard]] const Memory& memory() const noexcept { return memory_; }

private:
    static constexpr int kMaxNaps = 1, kSettled = 100;
    enum class Kind : std::uint8_t { load, store, modify, fence, nap, interrupt, resume };
    struct Operation {
        Kind kind;
        int location;     // -1 = none
        bool ordered;     // takes part in the total order of seq_cst operations
        int target = -1;  // the thread that is interrupted
    };
    struct Fiber {
        ucontext_t context;
        std::unique_ptr<char[]> stack;
        std::function<void()>* body;
        bool daemon, ended, settles;
        int naps;               // since another thread stored
        const void* sleeps_on;  // the word of a futex
        Operation next;         // after this point of the schedule
    };
    struct Choice {
        std::array<std::uint8_t, kMaxThreads> option;  // in a choice of the schedule
        std::uint8_t taken, count;
    };
    enum class Stop { none, complete, pruned, violated, anew };

    void run(const Scenario& scenario);
    void announce(const Operation& next);  // lets other threads go first, in every way
    void schedule();
    void leave(Stop why);  // never returns to the fiber
    // The result of an operation, from which the thread's next steps follow.
    void tell(const char* operation, int location, std::uint64_t value) {
        steps_.push_back({operation, running_, location, value});
        history_[std::size_t(running_)] = mix(history_[std::size_t(running_)], value);
    }
    [[nodiscard]] bool is_known_state();
    [[nodiscard]] std::string story() const;
    static void body_of_fiber();
    int choose(int count);
    int choose(const Options& options) { return options.of[std::size_t(choose(options.count))]; }
    [[nodiscard]] bool may_differ_after(const Operation& done, const Operation& next, int thread) const noexcept;
    void performed(const Operation& done);
    [[nodiscard]] const void* canonical(const void* address) const noexcept;
    bool is_shared(const void* address, bool stores);
    int locate(void* address, unsigned size);
    void remember(void* address, unsigned size);

    Memory memory_;
    std::vector<Fiber> fibers_;
    ucontext_t explorer_;
    int n_threads_ = 0, running_ = -1;
    Prune prune_ = Prune::states;
    unsigned asleep_ = 0;  // threads whose next operation, if performed now, only repeats what was explored
    std::vector<Choice> trail_;
    std::size_t depth_ = 0;
    Stop stop_ = Stop::none;
    std::string violation_;
    const Plant* plant_ = nullptr;

    struct Use {
        unsigned threads;
        bool stored;
    };
    std::unordered_map<const void*, Use> uses_;  // by the scenario's threads, in all executions
    struct Alias {
        const void *first, *second;
        std::size_t size;
    };
    std::vector<Alias> aliases_;
    struct Before {
        void* address;
        unsigned size;
        std::uint64_t value;
    };
    struct Step {
        const char* operation;
        int thread, location;
        std::uint64_t value;
    };
    std::vector<Step> steps_;
    std::array<std::uint64_t, kMaxThreads> history_{};  // hash of each thread's results
    // States that were reached, by their hash, and the threads that were asleep then each time.
    std::unordered_map<std::uint64_t, unsigned> states_;
    std::vector<Before> before_;  // contents of memory before the threads ran
};

Explorer& explorer();  // the only one

// Ends the execution, unless `holds`.
inline void require(bool holds, const char* what) {
    if (!holds) explorer().fail(what);
}

// Memory that is not atomic: an access that races with another one is a violation.
template <class T>
class Plain {
public:
    Plain(T value = {}) : value_(value) {}
    Plain(const Plain& other) : Plain(T(other)) {}
    Plain& operator=(const Plain& other) { return *this = T(other); }
    Plain& operator=(T value) {
        if (const int self = explorer().thread(); self >= 0) {
            for (int t = 0; t < kMaxThreads; ++t)
                if (!explorer().memory().happened(t, read_[std::size_t(t)], self))
                    explorer().fail("data race: write after read");
            check_written(self);
            writer_ = self;
            written_ = explorer().memory().clock(self);
        }
        value_ = value;
        return *this;
    }
    operator T() const {
        if (const int self = explorer().thread(); self >= 0) {
            check_written(self);
            read_[std::size_t(self)] = explorer().memory().clock(self);
        }
        return value_;
    }

private:
    void check_written(int self) const {
        if (writer_ >= 0 && writer_ != self && !explorer().memory().happened(writer_, written_, self))
            explorer().fail("data race: access after write");
    }
    T value_;
    int writer_ = -1;
    std::uint16_t written_ = 0;
    mutable std::array<std::uint16_t, kMaxThreads> read_{};
};

}  // namespace orders
