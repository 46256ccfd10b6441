// The ring between a link's thread and the pipeline's.
#include "instead.hpp"
#include "scenarios.hpp"
// The product:
#include "node/ring.hpp"

namespace orders {
namespace {

struct Item {
    Plain<std::uint32_t> number, again;
};

// Pushes items 1 .. `items`, `burst` a commit; takes them in order.
Scenario ring(std::size_t capacity, std::uint32_t items, std::uint32_t burst) {
    struct Shared {
        explicit Shared(std::size_t capacity) : ring(capacity) {}
        tactiled::Ring<Item> ring;
        std::uint32_t taken = 0;
    };
    Scenario scenario;
    scenario.name = fmt::format("ring of {}", capacity);
    scenario.bounds = fmt::format("{} items, {} a commit", items, burst);
    scenario.build = [=](Execution& run) {
        auto shared = run.make<Shared>(capacity);
        run.thread([&ring = shared->ring, items, burst] {
            for (std::uint32_t n = 1; n <= items; ++n) {
                Item* place = ring.claim();
                for (; place == nullptr; place = ring.claim()) explorer().nap();
                place->number = n;
                place->again = n;
                ring.push();
                if (n % burst == 0 || n == items) ring.commit();
            }
        });
        run.thread([&ring = shared->ring, &taken = shared->taken, items] {
            while (taken < items) {
                const Item* const item = ring.front();
                if (item == nullptr) {
                    explorer().nap();
                    continue;
                }
                require(item->number == taken + 1 && item->again == taken + 1, "an item that was not pushed next");
                ++taken;
                ring.pop();
            }
        });
        run.at_end([shared, items] { require(shared->taken == items, "an item is lost"); });
    };
    return scenario;
}

}  // namespace

std::vector<Scenario> ring_scenarios() { return {ring(1, 3, 1), ring(2, 4, 1), ring(2, 5, 2)}; }

}  // namespace orders
