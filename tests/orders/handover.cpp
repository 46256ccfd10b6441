// Objects that one thread lends to another: the sensors of a reload, and a driver that another thread reads.
#include "instead.hpp"
#include "scenarios.hpp"
// The product:
#include "node/handover.hpp"
#include "node/lending.hpp"

namespace orders {
namespace {

struct Replacement {
    Plain<std::uint32_t> part = 1;  // 2: exchanged
};

// Two offers, of which the loop may miss any, and a loop of some cycles. With patience, one offer, and a loop that sleeps.
Scenario handover(int offers, int patience_ms, int cycles, bool sleeps) {
    struct Shared {
        tactiled::Handover<Replacement> handover;
        tactiled::WakeWord word;
        Replacement offers[2];
        bool taken[2] = {};
        std::uint32_t exchanged = 0;  // the loop's own
    };
    Scenario scenario;
    scenario.name = sleeps ? "handover, woken" : "handover";
    scenario.may_sleep = sleeps;
    scenario.bounds = fmt::format("{} offer{}, patience of {} nap{}, {} cycles", offers, offers == 1 ? "" : "s", patience_ms,
                                  patience_ms == 1 ? "" : "s", cycles);
    scenario.build = [=](Execution& run) {
        auto shared = run.make<Shared>();
        run.thread([shared, offers, patience_ms] {
            for (int i = 0; i < offers; ++i) {
                auto& offer = shared->offers[i];
                offer.part = 1;
                shared->taken[i] = shared->handover.offer(offer, shared->word, patience_ms);
                require(offer.part == (shared->taken[i] ? 2u : 1u),
                        "an offer that was withdrawn was exchanged, or the reverse");
                offer.part = 3;  // its owner's again
            }
        });
        run.thread([shared, cycles, sleeps] {
            for (int n = 0; n < cycles; ++n) {
                const std::uint32_t seen = sleeps ? shared->word.value() : 0;
                Replacement* const offer = shared->handover.take();
                if (offer == nullptr) {
                    if (sleeps) (void)shared->word.sleep(seen, UINT64_MAX);
                    continue;
                }
                require(offer->part == 1, "an offer that is not filled");
                offer->part = 2;
                ++shared->exchanged;
                shared->handover.give_back();
            }
        });
        run.at_end([shared] {
            require(shared->exchanged == std::uint32_t(shared->taken[0]) + std::uint32_t(shared->taken[1]),
                    "an exchange that its owner does not know");
        });
    };
    return scenario;
}

// The borrower uses what is lent `uses` times at most, and returns it after the last time, if `returns`. An owner that would
// wait for ever takes it back.
Scenario lending(int uses, bool returns) {
    struct Shared {
        tactiled::Lending lending;
        Plain<std::uint32_t> driver;
        Atomic<bool> ends{false};
    };
    Scenario scenario;
    scenario.name = returns ? "lending, returned" : "lending, taken back";
    scenario.bounds = fmt::format("{} uses", uses);
    scenario.build = [=](Execution& run) {
        auto shared = run.make<Shared>();
        run.thread([shared, returns] {
            auto& [lending, driver, ends] = *shared;
            driver = 1;
            lending.lend();
            for (;;) {
                const std::uint32_t seen = lending.returned().value();
                if (lending.is_returned()) break;
                if (returns) {
                    (void)lending.returned().sleep(seen, UINT64_MAX);
                    continue;
                }
                if (ends.load(std::memory_order_relaxed) && lending.take_back()) break;
                explorer().nap();
            }
            driver = driver + 1;
        });
        run.thread([shared, uses, returns] {
            auto& [lending, driver, ends] = *shared;
            for (int n = 1; n <= uses; ++n) {
                if (lending.begin()) {
                    driver = driver + 1;
                    lending.end(!returns || n < uses);
                } else if (returns) {
                    --n;
                    explorer().nap();
                }
            }
            ends.store(true, std::memory_order_relaxed);
        });
    };
    return scenario;
}

}  // namespace

std::vector<Scenario> handover_scenarios() {
    return {handover(2, 1, 4, false), handover(1, 1000, 3, true), lending(3, true), lending(3, false)};
}

}  // namespace orders
