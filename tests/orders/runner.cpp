// The right to run the pipeline, and the word on which the pipeline's thread sleeps.
#include "instead.hpp"
#include "scenarios.hpp"
// The product:
#include "node/ring.hpp"
#include "node/runner.hpp"
#include "node/wake_word.hpp"

namespace orders {
namespace {

constexpr int kMaxLinks = 3;

struct Frame {
    Plain<std::uint32_t> number;
};

// Uses Runner, WakeWord and the links' rings in the same way as Pipeline and Threads do.
struct Pipeline {
    explicit Pipeline(int rounds_at_most) : max_rounds(rounds_at_most) {}

    const int max_rounds;
    tactiled::Ring<Frame> ring[kMaxLinks] = {tactiled::Ring<Frame>(4), tactiled::Ring<Frame>(4), tactiled::Ring<Frame>(4)};
    tactiled::Runner runner;
    tactiled::WakeWord word;
    Plain<std::uint32_t> rounds;  // the runner's own
    std::uint32_t delivered[kMaxLinks] = {};

    void run() {
        const bool done = runner.run(max_rounds, [this] {
            rounds = rounds + 1;
            for (int link = 0; link < kMaxLinks; ++link)
                for (const Frame* frame = nullptr; (frame = ring[link].front()) != nullptr; ring[link].pop())
                    require(frame->number == ++delivered[link], "a frame is delivered twice, or out of order");
        });
        if (!done) word.wake();
    }
    void serve() {
        if (runner.enter()) run();
    }
    // A link's thread, or a commander's.
    void push(int link, std::uint32_t number) {
        Frame* const place = ring[link].claim();
        require(place != nullptr, "the ring is full");
        place->number = number;
        ring[link].push();
        ring[link].commit();
    }
};

// `links` threads push `frames` each and serve; the set-up opens the pipeline meanwhile, where `opens`, or has done so.
Scenario runner(int links, std::uint32_t frames, bool opens, int max_rounds) {
    Scenario scenario;
    scenario.name = fmt::format("runner: {} link{}{}", links, links == 1 ? "" : "s", opens ? " and the opening" : "");
    scenario.bounds = fmt::format("{} frame{} each, {} round{} at most", frames, frames == 1 ? "" : "s", max_rounds,
                                  max_rounds == 1 ? "" : "s");
    scenario.may_sleep = true;
    scenario.build = [=](Execution& execution) {
        auto pipeline = execution.make<Pipeline>(max_rounds);
        if (!opens) pipeline->run();
        for (int link = 0; link < links; ++link)
            execution.thread([pipeline, link, frames] {
                for (std::uint32_t n = 1; n <= frames; ++n) {
                    pipeline->push(link, n);
                    pipeline->serve();
                }
            });
        if (opens) execution.thread([pipeline] { pipeline->run(); });
        if (max_rounds < 4)
            execution.thread([pipeline] {
                for (;;) {
                    const std::uint32_t seen = pipeline->word.value();
                    pipeline->serve();
                    (void)pipeline->word.sleep(seen, UINT64_MAX);
                }
            });
        execution.at_end([pipeline, links, frames] {
            for (int link = 0; link < links; ++link)
                require(pipeline->delivered[link] == frames, "a committed frame is not delivered");
        });
    };
    return scenario;
}

// A thread that serves nothing pushes and wakes the pipeline's thread.
Scenario commander(std::uint32_t commands) {
    Scenario scenario;
    scenario.name = "runner: a commander";
    scenario.bounds = fmt::format("{} commands", commands);
    scenario.may_sleep = true;
    scenario.build = [=](Execution& execution) {
        auto pipeline = execution.make<Pipeline>(4);
        pipeline->run();
        execution.thread([pipeline, commands] {
            for (std::uint32_t n = 1; n <= commands; ++n) {
                pipeline->push(0, n);
                pipeline->word.wake();
            }
        });
        execution.thread([pipeline] {
            for (;;) {
                const std::uint32_t seen = pipeline->word.value();
                pipeline->serve();
                (void)pipeline->word.sleep(seen, UINT64_MAX);
            }
        });
        execution.at_end(
            [pipeline, commands] { require(pipeline->delivered[0] == commands, "a command is not carried out"); });
    };
    return scenario;
}

}  // namespace

std::vector<Scenario> runner_scenarios() {
    return {runner(2, 2, false, 4), runner(3, 1, false, 4), runner(1, 2, true, 4), runner(2, 1, true, 4),
            runner(1, 1, true, 1),  runner(2, 1, false, 1), commander(2)};
}

}  // namespace orders
