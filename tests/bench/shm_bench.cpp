// One row for the table of shared-memory transports in peers/shm (its common.hpp: two processes, 256-byte messages, each
// byte checked): our ring, written and read by the very functions of the daemon and of its readers.
//   cmake -DTACTILED_PEERS=.../peers ... ; EXTRA=.../shm_bench .../peers/shm/run.sh
#include "common.hpp"

#include <fcntl.h>

#include <memory>

#include "node/shm/publish.hpp"
#include "node/shm/writer.hpp"
#include "tactiled/reader.hpp"

namespace {

// A segment that carries messages of the bench instead of samples: a header, and one ring that is the node ring, too.
struct Tactiled : b::Base {
    static constexpr std::uint32_t kSlots = 1024, kSlot = 384;
    static constexpr std::size_t kSize = 4096 + kSlots * kSlot;
    char* writable = nullptr;
    tactiled_segment segment{};
    std::uint32_t* wake = nullptr;
    tactiled_cursor cursor{};
    tactiled_rhythm rhythm{};
    std::uint64_t number = 0, spin_until_ns = 0;
    tactiled_ring ring{};
    int fd = -1;

    const char* name() { return "tactiled"; }
    void before_fork() {
        fd = memfd_create("bench", 0);
        if (ftruncate(fd, kSize) != 0) abort();
        writable = static_cast<char*>(mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, 0));
        wake = static_cast<std::uint32_t*>(
            mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0));
        ring = {4096, kSlot, kSlots, sizeof(b::Msg), 1024};
        reinterpret_cast<tactiled_header*>(writable)->node = ring;
        for (std::uint32_t i = 0; i < kSlots; ++i) *reinterpret_cast<std::uint32_t*>(writable + ring.offset + i * kSlot) = 1;
    }
    void init_pub() { syscall(SYS_membarrier, MEMBARRIER_CMD_REGISTER_GLOBAL_EXPEDITED, 0, 0); }
    void init_sub() {
        segment.base = static_cast<const char*>(mmap(nullptr, kSize, PROT_READ, MAP_SHARED | MAP_POPULATE, fd, 0));
        segment.size = kSize;
    }
    template <class F>
    bool publish(F&& fill) {
        b::Msg message;
        fill(&message);
        tactiled::publish_record(writable, ring, number++, &message, sizeof message);
        const std::uint32_t ahead = __atomic_load_n(wake, __ATOMIC_RELAXED) - std::uint32_t(number);  // like SegmentWriter
        if (ahead != 0 && ahead <= TACTILED_WAKE_RECORDS)
            syscall(SYS_futex, writable + ring.head_offset, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
        return true;
    }
    template <class F>
    bool try_read(F&& use) {
        b::Msg message;
        if (!tactiled_ring_next(segment.base, &ring, &cursor, &message, sizeof message)) return false;
        use(&message);
        return true;
    }
    template <class F>
    bool wait_read(F&& use, int ms) {
        if (try_read(use)) return true;
        const std::uint64_t now_ns = tactiled_now_ns();
        tactiled_sleep_on_node(&segment, wake, cursor.next, now_ns, now_ns + std::uint64_t(ms) * 1'000'000u);
        return try_read(use);
    }
    template <class F>
    bool predict_read(F&& use, int) {
        const auto learn = [&](const b::Msg* message) {
            use(message);
            const std::uint64_t now_ns = tactiled_now_ns();
            if (rhythm.last_ns != 0 && now_ns - rhythm.last_ns < 3'000'000u) tactiled_rhythm_learn(&rhythm, now_ns);
            rhythm.last_ns = now_ns;
            spin_until_ns = 0;
        };
        for (int i = 0; i < 64; ++i)
            if (try_read(learn)) return true;
        const std::uint64_t now_ns = tactiled_now_ns();
        if (now_ns < spin_until_ns) return false;
        const std::uint64_t wake_ns = tactiled_rhythm_wake_ns(&rhythm, now_ns);
        tactiled_sleep_until(wake_ns);
        spin_until_ns = wake_ns + 3 * tactiled_rhythm_early_ns(&rhythm);
        return false;
    }
    // Time that the daemon itself adds to a reader and to the loop: a real segment of 16 sensors.
    void extra(const char* peer) {
        tactiled::SegmentPlan plan;
        plan.name = "shm-bench-" + std::to_string(getpid());
        plan.sensors.resize(16);
        for (auto& s : plan.sensors) s.stale_ms = 10'000;
        plan.sensors[0].name[0] = 's';
        tactiled::SegmentWriter writer(plan);
        writer.set_state(TACTILED_RUNNING);
        tactiled_sample s{};
        s.quality = TACTILED_GOOD;
        s.t_ns = tactiled_now_ns();
        std::vector<std::uint32_t> attach, publish, latest, given, none;
        for (int i = 0; i < 2000; ++i) {
            std::uint64_t a = b::tick();
            writer.publish(0, s);
            publish.push_back(std::uint32_t(b::tick() - a));
            ++s.sequence;
        }
        std::string why;
        for (int i = 0; i < 300; ++i) {
            const std::uint64_t a = b::tick();
            auto segment = tactiled::Segment::try_open(plan.name, why);
            tactiled_sample first;
            segment.latest(0, first);
            attach.push_back(std::uint32_t(b::tick() - a));
        }
        const auto segment = tactiled::Segment::open(plan.name);
        tactiled::Reader reader(plan.name, "s");
        tactiled_sample got{};
        tactiled_node node{};
        reader.next(got);
        for (int r = 0; r < 200; ++r) {  // 1,000 calls each, as in a loop
            constexpr int kCalls = 1000;
            const std::uint64_t now_ns = tactiled_now_ns();
            node.t_ns = now_ns;
            writer.publish(node);
            ++node.sequence;
            std::uint64_t a = b::tick();
            for (int i = 0; i < kCalls; ++i) segment.latest(0, got, now_ns);
            given.push_back(std::uint32_t(b::tick() - a));
            a = b::tick();
            for (int i = 0; i < kCalls; ++i) segment.latest(0, got);
            latest.push_back(std::uint32_t(b::tick() - a));
            a = b::tick();
            for (int i = 0; i < kCalls; ++i) reader.next(got);
            none.push_back(std::uint32_t(b::tick() - a));
        }
        b::row(peer, "sample.publish_call.p50", b::med(publish), "ns");
        b::row(peer, "sample.latest.time_given.p50", b::med(given) / 1000, "ns");
        b::row(peer, "sample.latest.reads_clock.p50", b::med(latest) / 1000, "ns");
        b::row(peer, "sample.nothing_new.p50", b::med(none) / 1000, "ns");
        b::row(peer, "attach_and_first_read.p50", b::med(attach), "ns");
        b::row(peer, "segment_of_16_sensors", double(segment.header().total_size), "bytes");
    }
};

}  // namespace

int main() {
    Tactiled t;
    return b::run(t);
}
