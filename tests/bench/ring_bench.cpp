// The ring between a link and the pipeline, compared with other projects' rings in one run: 128-byte items from a
// thread on CPU 0 to a thread on CPU 1, each of the 16 words written and checked, 1024 items of room, so that it
// wraps and fills. Peers take turns, a tenth of a second each, and the median of the rounds' ratios counts: a
// hypervisor that moves the CPUs moves all of them.
//
//   ring_bench [rounds]
//
// Not shown: latency under load, several producers, items larger than two cache lines.
#include <pthread.h>
#include <sched.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "node/ring.hpp"
#if __has_include(<readerwriterqueue/readerwriterqueue.h>)
#include <readerwriterqueue/readerwriterqueue.h>
#define HAVE_MOODYCAMEL 1
#endif
#ifdef HAVE_DPDK
#include <rte_ring.h>
#include <rte_ring_peek_zc.h>
#endif

namespace {

struct Item {
    std::uint64_t word[16];
};
constexpr std::size_t kRoom = 1024;

void fill(Item& item, std::uint64_t number) {
    for (std::uint64_t k = 0; k < 16; ++k) item.word[k] = number + k;
}
std::uint64_t differences(const Item& item, std::uint64_t number) {
    std::uint64_t bits = 0;
    for (std::uint64_t k = 0; k < 16; ++k) bits |= item.word[k] ^ (number + k);
    return bits;
}

// Each peer: put(first, n) writes up to n items numbered from `first` and returns how many there was room for;
// take(first) reads and checks what there is, adds the differences to `bad`, and returns how many it took.
struct Ours {
    static constexpr const char* kName = "tactiled.ring";
    tactiled::Ring<Item> ring{kRoom};
    std::size_t put(std::uint64_t first, std::size_t n) {
        std::size_t done = 0;
        for (; done < n; ++done) {
            Item* const slot = ring.claim();
            if (slot == nullptr) break;
            fill(*slot, first + done);
            ring.push();
        }
        ring.commit();
        return done;
    }
    std::size_t take(std::uint64_t first, std::uint64_t& bad) {
        const Item* const item = ring.front();
        if (item == nullptr) return 0;
        bad |= differences(*item, first);
        ring.pop();
        return 1;
    }
};

struct Boost {
    static constexpr const char* kName = "boost.spsc_queue";
    boost::lockfree::spsc_queue<Item, boost::lockfree::capacity<kRoom>> queue;
    std::size_t put(std::uint64_t first, std::size_t n) {
        Item items[8];
        for (std::size_t i = 0; i < n; ++i) fill(items[i], first + i);
        return n == 1 ? std::size_t(queue.push(items[0])) : queue.push(items, n);
    }
    std::size_t take(std::uint64_t first, std::uint64_t& bad) {
        return queue.consume_all([&](const Item& item) { bad |= differences(item, first++); });
    }
};

#ifdef HAVE_MOODYCAMEL
struct Moodycamel {
    static constexpr const char* kName = "moodycamel.rwq";
    moodycamel::ReaderWriterQueue<Item> queue{kRoom};
    std::size_t put(std::uint64_t first, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) {
            Item item;
            fill(item, first + i);
            if (!queue.try_enqueue(item)) return i;
        }
        return n;
    }
    std::size_t take(std::uint64_t first, std::uint64_t& bad) {
        const Item* const item = queue.peek();
        if (item == nullptr) return 0;
        bad |= differences(*item, first);
        queue.pop();
        return 1;
    }
};
#endif

#ifdef HAVE_DPDK
struct Dpdk {
    static constexpr const char* kName = "dpdk.rte_ring.zc";
    rte_ring* ring;
    Dpdk() {
        const auto size = (std::size_t(rte_ring_get_memsize_elem(sizeof(Item), kRoom)) + 127) / 128 * 128;
        ring = static_cast<rte_ring*>(std::aligned_alloc(128, size));
        if (rte_ring_init(ring, "bench", kRoom, RING_F_SP_ENQ | RING_F_SC_DEQ) != 0) std::abort();
    }
    ~Dpdk() { std::free(ring); }
    static Item& at(const rte_ring_zc_data& zc, unsigned i) {
        return i < zc.n1 ? static_cast<Item*>(zc.ptr1)[i] : static_cast<Item*>(zc.ptr2)[i - zc.n1];
    }
    std::size_t put(std::uint64_t first, std::size_t n) {
        rte_ring_zc_data zc;
        const unsigned got = rte_ring_enqueue_zc_burst_elem_start(ring, sizeof(Item), unsigned(n), &zc, nullptr);
        if (got == 0) return 0;
        for (unsigned i = 0; i < got; ++i) fill(at(zc, i), first + i);
        rte_ring_enqueue_zc_elem_finish(ring, got);
        return got;
    }
    std::size_t take(std::uint64_t first, std::uint64_t& bad) {
        rte_ring_zc_data zc;
        const unsigned got = rte_ring_dequeue_zc_burst_elem_start(ring, sizeof(Item), burst, &zc, nullptr);
        if (got == 0) return 0;
        for (unsigned i = 0; i < got; ++i) bad |= differences(at(zc, i), first + i);
        rte_ring_dequeue_zc_elem_finish(ring, got);
        return got;
    }
    unsigned burst = 1;
};
#endif

double now_s() {
    timespec t{};
    clock_gettime(CLOCK_MONOTONIC, &t);
    return double(t.tv_sec) + double(t.tv_nsec) * 1e-9;
}

void pin(int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(unsigned(cpu), &set);
    sched_setaffinity(0, sizeof set, &set);
    sched_param p{};
    p.sched_priority = 50;
    sched_setscheduler(0, SCHED_FIFO, &p);  // if permitted
}

// Million items a second through a fresh ring, `burst` at a time.
template <class Peer>
double run(std::size_t burst) {
    auto peer = std::make_unique<Peer>();
    if constexpr (requires { peer->burst; }) peer->burst = unsigned(burst);
    std::atomic<std::uint64_t> end{~0ull};
    std::atomic<int> ready{0};
    std::uint64_t bad = 0;
    std::thread consumer([&] {
        pin(1);
        std::uint64_t taken = 0;
        ready.fetch_add(1);
        while (ready.load() < 2) {}
        for (;;) {
            const std::size_t n = peer->take(taken, bad);
            taken += n;
            if (n == 0 && taken == end.load(std::memory_order_acquire)) break;
        }
    });
    double rate = 0;
    std::thread producer([&] {
        pin(0);
        ready.fetch_add(1);
        while (ready.load() < 2) {}
        std::uint64_t sent = 0;
        const double began = now_s();
        double now = began;
        for (std::uint64_t look = 0; now - began < 0.1;) {
            sent += peer->put(sent, burst);
            if (sent >= look) {
                look = sent + 4096;
                now = now_s();
            }
        }
        rate = double(sent) / (now - began) / 1e6;
        end.store(sent, std::memory_order_release);
    });
    producer.join();
    consumer.join();
    if (bad != 0) {
        std::printf("%s CORRUPT\n", Peer::kName);
        std::exit(1);
    }
    return rate;
}

double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
}

template <class... Peers>
void compare(int rounds) {
    constexpr std::size_t kPeers = sizeof...(Peers);
    const char* names[] = {Peers::kName...};
    std::vector<double> single[kPeers], burst[kPeers], ratio_single, ratio_burst, ratio_burst_to_single;
    for (int round = 0; round < rounds; ++round) {
        const double one[] = {run<Peers>(1)...}, eight[] = {run<Peers>(8)...};
        for (std::size_t i = 0; i < kPeers; ++i) {
            single[i].push_back(one[i]);
            burst[i].push_back(eight[i]);
        }
        const double best_one = *std::max_element(one + 1, one + kPeers),
                     best_eight = *std::max_element(eight + 1, eight + kPeers);
        ratio_single.push_back(one[0] / best_one);
        ratio_burst.push_back(eight[0] / best_eight);
        ratio_burst_to_single.push_back(eight[0] / best_one);
    }
    for (std::size_t i = 0; i < kPeers; ++i)
        std::printf("%-18s one by one %6.1f   bursts of 8 %6.1f M items/s\n", names[i], median(single[i]), median(burst[i]));
    std::printf("ours / best peer of the round, one by one            %5.2f x\n", median(ratio_single));
    std::printf("ours / best peer of the round, bursts of 8           %5.2f x\n", median(ratio_burst));
    std::printf("ours in bursts of 8 / best peer of the round one by one %5.2f x\n", median(ratio_burst_to_single));
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 15;
    compare<Ours, Boost
#ifdef HAVE_MOODYCAMEL
            ,
            Moodycamel
#endif
#ifdef HAVE_DPDK
            ,
            Dpdk
#endif
            >(rounds);
}
