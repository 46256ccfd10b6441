// Litmus tests: small programs whose outcomes under the C11 model are known. The explorer must give exactly these.
#include <cstdio>
#include <set>
#include <string>

#include "instead.hpp"
#include "scenarios.hpp"

namespace orders {
namespace {

constexpr auto relaxed = std::memory_order_relaxed, acquire = std::memory_order_acquire, release = std::memory_order_release,
               acq_rel = std::memory_order_acq_rel, seq_cst = std::memory_order_seq_cst;
using Word = Atomic<std::uint32_t>;

// Words x, y; results r; the numbers of an outcome are those of `r`, then the last values of the words in `finals`.
struct Shared {
    Word x, y, z;
    Plain<std::uint32_t> data, more;
    std::uint32_t r[4] = {0, 0, 0, 0};
};
using Bodies = std::vector<std::function<void(Shared&)>>;

struct Litmus {
    const char* name;
    const char* expected;  // the set of outcomes; "race", "asleep": a violation
    int results;
    bool finals;
    Bodies bodies;
};

std::string outcomes_of(const Litmus& test, Explorer::Prune prune, Outcome& outcome) {
    std::set<std::string> seen;
    Scenario scenario;
    scenario.name = test.name;
    scenario.build = [&](Execution& run) {
        auto shared = run.make<Shared>();
        for (const auto& body : test.bodies) run.thread([shared, &body] { body(*shared); });
        run.at_end([shared, &test, &seen] {
            std::string text;
            for (int i = 0; i < test.results; ++i) text += char('0' + shared->r[i]);
            if (test.finals) text += char('0' + shared->x.load(relaxed)), text += char('0' + shared->y.load(relaxed));
            seen.insert(text);
        });
    };
    outcome = explorer().explore(scenario, nullptr, prune);
    if (!outcome.violation.empty())
        return outcome.violation.starts_with("data race")         ? "race"
               : outcome.violation.starts_with("a thread sleeps") ? "asleep"
                                                                  : outcome.violation;
    std::string text;
    for (const auto& one : seen) text += (text.empty() ? "" : " ") + one;
    return text;
}

Bodies store_buffering(std::memory_order store, std::memory_order load, std::memory_order between = relaxed) {
    return {[=](Shared& s) {
                s.x.store(1, store);
                if (between != relaxed) fence(between);
                s.r[0] = s.y.load(load);
            },
            [=](Shared& s) {
                s.y.store(1, store);
                if (between != relaxed) fence(between);
                s.r[1] = s.x.load(load);
            }};
}
Bodies message_passing(std::memory_order store, std::memory_order load, std::memory_order before = relaxed,
                       std::memory_order after = relaxed) {
    return {[=](Shared& s) {
                s.x.store(1, relaxed);
                if (before != relaxed) fence(before);
                s.y.store(1, store);
            },
            [=](Shared& s) {
                s.r[0] = s.y.load(load);
                if (after != relaxed) fence(after);
                s.r[1] = s.x.load(relaxed);
            }};
}
// The same with data that is not atomic, read only after the flag is seen.
Bodies message_of_data(std::memory_order store, std::memory_order load) {
    return {[=](Shared& s) {
                s.data = 1;
                s.y.store(1, store);
            },
            [=](Shared& s) {
                if (s.y.load(load) == 1) s.r[0] = 1 + s.data;
            }};
}
Bodies independent_reads(std::memory_order store, std::memory_order load, std::memory_order between = relaxed) {
    const auto reader = [=](Word Shared::*first, Word Shared::*second, int at) {
        return [=](Shared& s) {
            s.r[at] = (s.*first).load(load);
            if (between != relaxed) fence(between);
            s.r[at + 1] = (s.*second).load(load);
        };
    };
    return {[=](Shared& s) { s.x.store(1, store); }, [=](Shared& s) { s.y.store(1, store); },
            reader(&Shared::x, &Shared::y, 0), reader(&Shared::y, &Shared::x, 2)};
}
Bodies two_plus_two_writes(std::memory_order order, std::memory_order between = relaxed) {
    return {[=](Shared& s) {
                s.x.store(1, order);
                if (between != relaxed) fence(between);
                s.y.store(2, order);
            },
            [=](Shared& s) {
                s.y.store(1, order);
                if (between != relaxed) fence(between);
                s.x.store(2, order);
            }};
}
// A flag that another operation has changed after its release.
Bodies release_sequence(std::function<void(Shared&)> meanwhile, bool same_thread = false) {
    Bodies bodies{[=](Shared& s) {
                      s.data = 1;
                      s.x.store(1, release);
                      if (same_thread) meanwhile(s);
                  },
                  [](Shared& s) {
                      if (s.x.load(acquire) == 2) s.r[0] = s.data;
                  }};
    if (!same_thread) bodies.emplace_back([=](Shared& s) { meanwhile(s); });
    return bodies;
}
Bodies write_read_causality(std::memory_order store, std::memory_order load) {
    return {[=](Shared& s) { s.x.store(1, relaxed); },
            [=](Shared& s) {
                if (s.x.load(load) == 1) s.y.store(1, store);
            },
            [=](Shared& s) {
                s.r[0] = s.y.load(load);
                s.r[1] = s.x.load(relaxed);
            }};
}
Bodies sleeper(bool wakes, bool releases = true) {
    return {[=](Shared& s) {
                s.data = 1;
                s.x.store(1, releases ? release : relaxed);
                if (wakes) explorer().futex_wake(&s.x, 1);
            },
            [](Shared& s) {
                while (s.x.load(acquire) == 0) explorer().futex_wait(&s.x, 0);
                s.r[0] = s.data;
            }};
}

const char* const kAll16 = "0000 0001 0010 0011 0100 0101 0110 0111 1000 1001 1010 1011 1100 1101 1110 1111";
const char* const kNotIriw = "0000 0001 0010 0011 0100 0101 0110 0111 1000 1001 1011 1100 1101 1110 1111";

std::vector<Litmus> tests() {
    return {
        {"SB relaxed", "00 01 10 11", 2, false, store_buffering(relaxed, relaxed)},
        {"SB release, acquire", "00 01 10 11", 2, false, store_buffering(release, acquire)},
        {"SB seq_cst", "01 10 11", 2, false, store_buffering(seq_cst, seq_cst)},
        {"SB seq_cst fences", "01 10 11", 2, false, store_buffering(relaxed, relaxed, seq_cst)},
        {"SB acq_rel fences", "00 01 10 11", 2, false, store_buffering(relaxed, relaxed, acq_rel)},
        {"SB a membarrier on one side",
         "01 10 11",
         2,
         false,
         {[](Shared& s) {
              s.x.store(1, relaxed);
              s.r[0] = s.y.load(relaxed);
          },
          [](Shared& s) {
              s.y.store(1, relaxed);
              explorer().membarrier();
              s.r[1] = s.x.load(relaxed);
          }}},
        {"MP relaxed", "00 01 10 11", 2, false, message_passing(relaxed, relaxed)},
        {"MP release, acquire", "00 01 11", 2, false, message_passing(release, acquire)},
        {"MP release, relaxed", "00 01 10 11", 2, false, message_passing(release, relaxed)},
        {"MP relaxed, acquire", "00 01 10 11", 2, false, message_passing(relaxed, acquire)},
        {"MP release fence, acquire fence", "00 01 11", 2, false, message_passing(relaxed, relaxed, release, acquire)},
        {"MP release fence, acquire", "00 01 11", 2, false, message_passing(relaxed, acquire, release)},
        {"MP release, acquire fence", "00 01 11", 2, false, message_passing(release, relaxed, relaxed, acquire)},
        {"MP release fence alone", "00 01 10 11", 2, false, message_passing(relaxed, relaxed, release)},
        {"MP acquire fence alone", "00 01 10 11", 2, false, message_passing(relaxed, relaxed, relaxed, acquire)},
        {"MP of data, release, acquire", "0 2", 1, false, message_of_data(release, acquire)},
        {"MP of data, relaxed, acquire", "race", 1, false, message_of_data(relaxed, acquire)},
        {"MP of data, release, relaxed", "race", 1, false, message_of_data(release, relaxed)},
        {"LB relaxed (C11 allows 11, too)",
         "00 01 10",
         2,
         false,
         {[](Shared& s) {
              s.r[0] = s.x.load(relaxed);
              s.y.store(1, relaxed);
          },
          [](Shared& s) {
              s.r[1] = s.y.load(relaxed);
              s.x.store(1, relaxed);
          }}},
        {"CoRR",
         "00 01 02 11 12 22",
         2,
         false,
         {[](Shared& s) {
              s.x.store(1, relaxed);
              s.x.store(2, relaxed);
          },
          [](Shared& s) {
              s.r[0] = s.x.load(relaxed);
              s.r[1] = s.x.load(relaxed);
          }}},
        {"CoWR",
         "110 120 220",
         1,
         true,
         {[](Shared& s) {
              s.x.store(1, relaxed);
              s.r[0] = s.x.load(relaxed);
          },
          [](Shared& s) { s.x.store(2, relaxed); }}},
        {"2+2W relaxed", "11 12 21 22", 0, true, two_plus_two_writes(relaxed)},
        {"2+2W release", "11 12 21 22", 0, true, two_plus_two_writes(release)},
        {"2+2W seq_cst fences", "12 21 22", 0, true, two_plus_two_writes(relaxed, seq_cst)},
        {"2+2W seq_cst", "12 21 22", 0, true, two_plus_two_writes(seq_cst)},
        {"S release, acquire",
         "011 021 111",
         1,
         true,
         {[](Shared& s) {
              s.x.store(2, relaxed);
              s.y.store(1, release);
          },
          [](Shared& s) {
              s.r[0] = s.y.load(acquire);
              s.x.store(1, relaxed);
          }}},
        {"R seq_cst fences",
         "011 111 112",
         1,
         true,
         {[](Shared& s) {
              s.x.store(1, relaxed);
              fence(seq_cst);
              s.y.store(1, relaxed);
          },
          [](Shared& s) {
              s.y.store(2, relaxed);
              fence(seq_cst);
              s.r[0] = s.x.load(relaxed);
          }}},
        {"IRIW relaxed", kAll16, 4, false, independent_reads(relaxed, relaxed)},
        {"IRIW release, acquire", kAll16, 4, false, independent_reads(release, acquire)},
        {"IRIW seq_cst", kNotIriw, 4, false, independent_reads(seq_cst, seq_cst)},
        {"IRIW seq_cst fences", kNotIriw, 4, false, independent_reads(relaxed, relaxed, seq_cst)},
        {"WRC release, acquire", "00 01 11", 2, false, write_read_causality(release, acquire)},
        {"WRC relaxed", "00 01 10 11", 2, false, write_read_causality(relaxed, relaxed)},
        {"release sequence: fetch_add relaxed", "0 1", 1, false,
         release_sequence([](Shared& s) { s.x.fetch_add(1, relaxed); })},
        {"release sequence: a store of another thread", "race", 1, false,
         release_sequence([](Shared& s) { s.x.store(2, relaxed); })},
        {"release sequence: a store of the same thread (C++20)", "race", 1, false,
         release_sequence([](Shared& s) { s.x.store(2, relaxed); }, true)},
        {"two fetch_add",
         "0120 1020",
         2,
         true,
         {[](Shared& s) { s.r[0] = s.x.fetch_add(1, relaxed); }, [](Shared& s) { s.r[1] = s.x.fetch_add(1, relaxed); }}},
        {"fetch_add and store",
         "040 450",
         1,
         true,
         {[](Shared& s) { s.r[0] = s.x.fetch_add(1, relaxed); }, [](Shared& s) { s.x.store(4, relaxed); }}},
        {"two compare_exchange",
         "0120 1010",
         2,
         true,
         {[](Shared& s) {
              std::uint32_t none = 0;
              s.r[0] = s.x.compare_exchange_strong(none, 1, relaxed, relaxed);
          },
          [](Shared& s) {
              std::uint32_t none = 0;
              s.r[1] = s.x.compare_exchange_strong(none, 2, relaxed, relaxed);
          }}},
        {"futex", "1", 1, false, sleeper(true)},
        {"futex, without FUTEX_WAKE", "asleep", 1, false, sleeper(false)},
        {"futex, relaxed", "race", 1, false, sleeper(true, false)},
    };
}

}  // namespace

bool litmus(std::string& page) {
    bool all_right = true;
    page += "| test | outcomes | executions | without sleep sets and states |\n|---|---|---|---|\n";
    for (const auto& test : tests()) {
        Outcome one, two, all;
        const std::string found[3] = {outcomes_of(test, Explorer::Prune::states, one),
                                      outcomes_of(test, Explorer::Prune::repetitions, two),
                                      outcomes_of(test, Explorer::Prune::nothing, all)};
        page += fmt::format("| {} | {} | {} | {} |\n", test.name, found[0], one.executions, all.executions);
        if (std::count(std::begin(found), std::end(found), test.expected) == 3) continue;
        all_right = false;
        page += fmt::format("WRONG: expected {}; found {}; {}\n", test.expected, found[1], found[2]);
    }
    return all_right;
}

}  // namespace orders
