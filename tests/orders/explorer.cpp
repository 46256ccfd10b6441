#include "explorer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace orders {
namespace {

constexpr std::size_t kStack = 128 * 1024;

}  // namespace

void* Execution::take(std::size_t size, std::size_t alignment) {
    alignas(128) static char memory[16 * 1024];
    taken_ = (taken_ + alignment - 1) / alignment * alignment;
    if (taken_ + size > sizeof memory) {
        std::fprintf(stderr, "a scenario shares too much\n");
        std::abort();
    }
    return memory + std::exchange(taken_, taken_ + size);
}

Explorer& explorer() {
    static Explorer the;
    return the;
}

Explorer::Explorer() : fibers_(kMaxThreads) {
    for (auto& fiber : fibers_) fiber.stack = std::make_unique<char[]>(kStack);
}

// ---- all executions ------------------------------------------------------------------------------------------------------

Outcome Explorer::explore(const Scenario& scenario, const Plant* plant, Prune prune, std::uint64_t limit) {
    Outcome outcome;
    plant_ = plant;
    prune_ = prune;
    trail_.clear();
    uses_.clear();
    states_.clear();
    for (;;) {
        run(scenario);
        if (stop_ == Stop::anew) {  // a word that one thread seemed to have to itself is shared
            trail_.clear();
            states_.clear();
            outcome = {};
            continue;
        }
        ++(stop_ == Stop::pruned ? outcome.pruned : outcome.executions);
        if (stop_ != Stop::violated && outcome.executions + outcome.pruned >= limit) {
            stop_ = Stop::violated;
            violation_ = "more executions than allowed";
        }
        if (stop_ == Stop::violated) {
            outcome.violation = violation_;
            outcome.story = story();
            break;
        }
        while (!trail_.empty() && trail_.back().taken + 1 == trail_.back().count) trail_.pop_back();
        if (trail_.empty()) break;
        ++trail_.back().taken;
    }
    plant_ = nullptr;
    return outcome;
}

int Explorer::choose(int count) {
    if (count == 1) return 0;
    if (count == 0) leave(Stop::pruned);  // no such execution
    if (depth_ == trail_.size()) trail_.push_back({{}, 0, std::uint8_t(count)});
    const Choice& choice = trail_[depth_++];
    if (choice.count != count) {
        std::fprintf(stderr, "the scenario is not deterministic\n");
        std::abort();
    }
    return choice.taken;
}

// ---- one execution -------------------------------------------------------------------------------------------------------

void Explorer::run(const Scenario& scenario) {
    Execution execution;
    scenario.build(execution);
    n_threads_ = int(execution.threads.size());
    assert(n_threads_ <= kMaxThreads);
    memory_.clear(n_threads_);
    before_.clear();
    steps_.clear();
    history_ = {};
    depth_ = 0;
    asleep_ = 0;
    stop_ = Stop::none;
    for (int t = 0; t < n_threads_; ++t) {
        Fiber& fiber = fibers_[std::size_t(t)];
        fiber.body = &execution.threads[std::size_t(t)].body;
        fiber.daemon = execution.threads[std::size_t(t)].daemon;
        fiber.ended = fiber.settles = false;
        fiber.naps = 0;
        fiber.sleeps_on = nullptr;
        fiber.next = {Kind::resume, -1, false};
        ::getcontext(&fiber.context);
        fiber.context.uc_stack.ss_sp = fiber.stack.get();
        fiber.context.uc_stack.ss_size = kStack;
        fiber.context.uc_link = nullptr;
        ::makecontext(&fiber.context, &Explorer::body_of_fiber, 0);
    }
    ::ucontext_t* const here = &explorer_;
    running_ = 0;
    // Each thread first runs to its first operation, which is before the first choice.
    ::swapcontext(here, &fibers_[0].context);
    running_ = -1;
    if (stop_ == Stop::complete && execution.end) {
        stop_ = Stop::none;
        execution.end();
        if (stop_ == Stop::none) stop_ = Stop::complete;
    }
    if (stop_ == Stop::complete && !scenario.may_sleep)
        for (int t = 0; t < n_threads_; ++t)
            if (is_asleep(t)) {
                stop_ = Stop::violated;
                violation_ = "a thread sleeps for ever";
            }
    for (auto b = before_.rbegin(); b != before_.rend(); ++b) std::memcpy(b->address, &b->value, b->size);
}

void Explorer::body_of_fiber() {
    Explorer& self = explorer();
    Fiber& fiber = self.fibers_[std::size_t(self.running_)];
    (*fiber.body)();
    fiber.ended = true;
    self.schedule();
    std::abort();
}

void Explorer::leave(Stop why) {
    stop_ = why;
    if (running_ < 0) return;  // at the end of an execution
    ::setcontext(&explorer_);
    std::abort();
}

void Explorer::fail(const std::string& what) {
    if (stop_ == Stop::violated) return;
    violation_ = what;
    leave(Stop::violated);
}

std::string Explorer::story() const {
    std::string text;
    for (const auto& step : steps_)
        text +=
            fmt::format("    thread {}: {} location {} value {}\n", step.thread, step.operation, step.location, step.value);
    return text;
}

// ---- the schedule --------------------------------------------------------------------------------------------------------

void Explorer::announce(const Operation& next) {
    fibers_[std::size_t(running_)].next = next;
    schedule();
    performed(next);
}

void Explorer::schedule() {
    const int from = running_;
    // Threads that have not begun come to their first operation first: what is before it concerns no other thread.
    int next = -1;
    unsigned able = 0, resting = 0;
    bool naps = false, settles = false;
    for (int t = 0; t < n_threads_; ++t) {
        Fiber& fiber = fibers_[std::size_t(t)];
        if (fiber.ended || fiber.sleeps_on != nullptr) continue;
        if (fiber.next.kind == Kind::resume && next < 0) next = t;
        const int count = fiber.next.kind == Kind::nap ? fiber.naps : 0;
        if (count < kSettled) (count > kMaxNaps ? resting : able) |= 1u << t;
        naps |= count == kSettled;
    }
    if (next < 0) {
        if (able == 0 && resting == 0 && naps) fail("threads wait for each other");
        if (able == 0 && resting == 0) leave(Stop::complete);
        if (able == 0) {
            able = resting;
            settles = true;
        }
        Choice fresh{{}, 0, 0};
        const auto add = [&](auto wanted) {
            for (int i = 0; i < n_threads_; ++i) {
                const int t = (from + i) % n_threads_;  // the same thread first: no switch
                if (((able & ~asleep_) >> t & 1) != 0 && wanted(fibers_[std::size_t(t)].next.kind))
                    fresh.option[fresh.count++] = std::uint8_t(t);
            }
        };
        add([](Kind k) { return k == Kind::store; });  // first: a load after it may read both old and new
        add([](Kind k) { return k == Kind::modify; });
        add([](Kind k) { return k == Kind::fence || k == Kind::interrupt; });
        add([](Kind k) { return k == Kind::load; });
        add([](Kind k) { return k == Kind::nap; });
        if (fresh.count == 0 || is_known_state()) leave(Stop::pruned);
        if (fresh.count == 1) {
            next = fresh.option[0];
        } else {
            const std::size_t at = depth_;
            const int taken = choose(fresh.count);
            if (trail_[at].option[1] == 0 && trail_[at].option[0] == 0) trail_[at].option = fresh.option;
            if (trail_[at].option != fresh.option) {
                std::fprintf(stderr, "the scenario is not deterministic\n");
                std::abort();
            }
            next = fresh.option[std::size_t(taken)];
            if (prune_ != Prune::nothing)
                for (int i = 0; i < taken; ++i) asleep_ |= 1u << fresh.option[std::size_t(i)];
        }
    }
    fibers_[std::size_t(next)].settles = settles;
    if (next == from && !fibers_[std::size_t(from)].ended) return;
    running_ = next;
    if (fibers_[std::size_t(from)].ended)
        ::setcontext(&fibers_[std::size_t(next)].context);
    else
        ::swapcontext(&fibers_[std::size_t(from)].context, &fibers_[std::size_t(next)].context);
}

// True if all that can follow has been explored: the state was reached before, and no thread was asleep then that is not
// now.
bool Explorer::is_known_state() {
    if (prune_ != Prune::states || depth_ < trail_.size()) return false;  // on the way to the choice that is new
    std::uint64_t state = memory_.hash();
    for (int t = 0; t < n_threads_; ++t) {
        const Fiber& fiber = fibers_[std::size_t(t)];
        state = mix(state, history_[std::size_t(t)]);
        state =
            mix(state, std::uint64_t(fiber.sleeps_on) ^ std::uint64_t(fiber.ended) << 1 ^ std::uint64_t(fiber.naps) << 2);
        state = mix(state, std::uint64_t(fiber.next.kind));
    }
    const auto [known, is_new] = states_.try_emplace(state, asleep_);
    if (is_new) return false;
    if ((known->second & ~asleep_) == 0) return true;
    known->second &= asleep_;
    return false;
}

// True if `next` of another `thread` has outcomes after `done` that it did not have before.
bool Explorer::may_differ_after(const Operation& done, const Operation& next, int thread) const noexcept {
    if (done.target == thread || next.target == running_ || (done.ordered && next.ordered)) return true;
    const bool stored = done.kind == Kind::store || done.kind == Kind::modify;
    return stored && (next.kind == Kind::load || next.kind == Kind::modify) && done.location == next.location;
}

void Explorer::performed(const Operation& done) {
    for (int t = 0; t < n_threads_; ++t) {
        Fiber& fiber = fibers_[std::size_t(t)];
        const bool changes =
            done.kind == Kind::store || (t != running_ && done.kind != Kind::load && done.kind != Kind::nap);
        if (changes) fiber.naps = 0;
        if ((asleep_ >> t & 1) != 0 && may_differ_after(done, fiber.next, t)) asleep_ &= ~(1u << t);
    }
}

}  // namespace orders
