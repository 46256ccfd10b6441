// A segment of the daemon's own writer, and the reader's functions: sleeping readers, a reload, the end of the daemon.
#include "instead.hpp"
#include "scenarios.hpp"
// The product:
#include "node/shm/waker.cpp"
#include "node/shm/writer.cpp"
#include "tactiled/reader.h"

namespace orders {
namespace {

// A segment with one sensor, whose record 0 and that of the node are published. Executions leave it as they found it.
class Segment {
public:
    Segment() : writer(plan()) {
        writer.set_state(TACTILED_RUNNING);
        publish(0);
        tactiled_open(&mapped, plan().name.c_str());
        wake = static_cast<std::uint32_t*>(
            mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, writer.wake_page(), 0));
        const auto& all = mappings();  // the writer's: page and segment; the reader's: segment and page
        explorer().same_memory(all.at(1), mapped.base, mapped.size);
        explorer().same_memory(all.at(0), wake, sizeof(tactiled_wake));
    }

    // Sample `number`, then the node record that names it.
    void publish(std::uint64_t number) {
        tactiled_sample sample{};
        sample.sequence = number;
        sample.t_ns = monotonic_ns_here() + number;
        writer.publish(0, sample);
        tactiled_node node{};
        node.sequence = number;
        node.t_ns = monotonic_ns_here();
        node.count[0] = number + 1;
        writer.publish(node);
    }

    tactiled::SegmentWriter writer;
    tactiled_segment mapped{};
    std::uint32_t* wake = nullptr;

private:
    static std::uint64_t monotonic_ns_here() { return tactiled_now_ns(); }
    static tactiled::SegmentPlan plan() {
        tactiled::SegmentPlan plan;
        plan.name = fmt::format("orders-{}", ::getpid());
        plan.version = "test";
        plan.history = 8;
        tactiled_sensor sensor{};
        sensor.name[0] = 's';
        sensor.stale_ms = 100;
        plan.sensors.push_back(sensor);
        return plan;
    }
};

const tactiled_ring& ring_of(const Segment& s) { return tactiled_sensor_of(&s.mapped, 0)->ring; }

// Waits for sample `number` as tactiled_reader_wait() does, without its time limits.
void sleep_until_sample(Segment& s, std::uint32_t number, bool reads = true) {
    tactiled_reader reader{};
    reader.segment = s.mapped;
    reader.wake = s.wake;
    reader.asked_ns = 1;
    reader.cursor.next = number;
    while (tactiled_ring_head(s.mapped.base, &ring_of(s)) == number) tactiled_reader_block(&reader, 0, 1);
    if (!reads) return;
    tactiled_sample sample{};
    require(tactiled_ring_next(s.mapped.base, &ring_of(s), &reader.cursor, &sample, sizeof sample) != 0 &&
                sample.sequence == number,
            "a woken reader does not find the sample");
}

Scenario sleeping_readers(Segment& s, int readers) {
    Scenario scenario;
    scenario.name = fmt::format("{} sleeping reader{}", readers, readers == 1 ? "" : "s");
    scenario.bounds = "one sample and its node record";
    scenario.build = [&s, readers](Execution& run) {
        run.thread([&s] {
            s.publish(1);
            s.writer.wake_readers(INT_MAX);
        });
        for (int i = 0; i < readers; ++i) run.thread([&s, readers] { sleep_until_sample(s, 1, readers == 1); }, false);
    };
    return scenario;
}

// The same with the thread that wakes readers beyond the first.
Scenario waker(Segment& s, int readers) {
    Scenario scenario;
    scenario.name = fmt::format("the waker's thread and {} sleeping reader{}", readers, readers == 1 ? "" : "s");
    scenario.bounds = "one sample and its node record";
    scenario.may_sleep = true;
    scenario.build = [&s, readers](Execution& run) {
        auto waker = run.make<tactiled::Waker>(s.writer);
        *s.wake = TACTILED_WAKE_RECORDS;  // many sleep: the next wake is left to the thread
        waker->published();
        *s.wake = 0;
        run.thread([&s, waker] {
            s.publish(1);
            waker->published();
        });
        for (int i = 0; i < readers; ++i) run.thread([&s] { sleep_until_sample(s, 1, false); }, false);
        run.thread([waker] { waker->run(); });
        run.at_end([readers] {
            for (int i = 0; i < readers; ++i) require(!explorer().is_asleep(1 + i), "a reader sleeps for ever");
        });
    };
    return scenario;
}

// Two words of the directory's entry change together. The reader does as tactiled/layout.h says at struct tactiled_header.
Scenario reload(Segment& s, int times) {
    Scenario scenario;
    scenario.name = "reload";
    scenario.bounds = fmt::format("{} reloads of two words", times);
    scenario.build = [&s, times](Execution& run) {
        run.thread([&s, times] {
            tactiled_sensor entry = *tactiled_sensor_of(&s.mapped, 0);
            for (int i = 0; i < times; ++i) {
                ++entry.n_channels;
                ++entry.components;
                s.writer.begin_reload();
                s.writer.set_sensor(0, entry);
                s.writer.end_reload(std::uint32_t(i) + 1);
            }
        });
        run.thread(
            [&s] {
                const std::uint32_t* const reloads = &tactiled_header_of(&s.mapped)->reloads;
                const tactiled_sensor* const entry = tactiled_sensor_of(&s.mapped, 0);
                const std::uint32_t before = __atomic_load_n(reloads, __ATOMIC_ACQUIRE);
                const std::uint32_t channels = __atomic_load_n(&entry->n_channels, __ATOMIC_RELAXED);
                const std::uint32_t components = __atomic_load_n(&entry->components, __ATOMIC_RELAXED);
                __atomic_thread_fence(__ATOMIC_ACQUIRE);
                if (before % 2 != 0 || __atomic_load_n(reloads, __ATOMIC_RELAXED) != before) return;
                require(channels == components, "an entry of two reloads");
                require(channels == before / 2, "the entry of another reload");
            },
            false);
    };
    return scenario;
}

// A node record is published after the samples that it names: SegmentView::snapshot() depends on it.
Scenario snapshot(Segment& s) {
    Scenario scenario;
    scenario.name = "snapshot";
    scenario.bounds = "one sample and its node record";
    scenario.build = [&s](Execution& run) {
        run.thread([&s] { s.publish(1); });
        run.thread(
            [&s] {
                tactiled_node node{};
                tactiled_sample sample{};
                require(tactiled_ring_latest(s.mapped.base, &tactiled_header_of(&s.mapped)->node, &node, sizeof node) != 0,
                        "no node record");
                const auto number = std::uint32_t(node.count[0]) - 1;
                require(tactiled_ring_read(s.mapped.base, &ring_of(s), number, &sample, sizeof sample) != 0 &&
                            sample.sequence == number,
                        "a node record names a sample that is not there");
            },
            false);
    };
    return scenario;
}

// A reader that sees the end of the daemon finds the last records.
Scenario end_of_daemon(Segment& s) {
    Scenario scenario;
    scenario.name = "end of the daemon";
    scenario.bounds = "one sample and its node record, then TACTILED_STOPPED";
    scenario.build = [&s](Execution& run) {
        run.thread([&s] {
            s.publish(1);
            s.writer.set_state(TACTILED_STOPPED);
        });
        run.thread(
            [&s] {
                if (tactiled_is_current(&s.mapped) != 0) return;
                tactiled_cursor cursor{};
                cursor.next = 1;
                tactiled_sample sample{};
                require(tactiled_ring_next(s.mapped.base, &ring_of(s), &cursor, &sample, sizeof sample) != 0,
                        "the last sample of a daemon that has ended is not there");
                require(tactiled_ring_head(s.mapped.base, &tactiled_header_of(&s.mapped)->node) == 2,
                        "the last node record of a daemon that has ended is not there");
            },
            false);
    };
    return scenario;
}

}  // namespace

std::vector<Scenario> segment_scenarios() {
    static Segment segment;
    return {
        sleeping_readers(segment, 1), sleeping_readers(segment, 2), waker(segment, 1), reload(segment, 3), snapshot(segment),
        end_of_daemon(segment)};
}

}  // namespace orders
