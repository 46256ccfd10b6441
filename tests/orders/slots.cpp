// The slots of shared memory: the writer's half in node/shm/publish.hpp, the reader's in tactiled/layout.h.
#include "instead.hpp"
#include "scenarios.hpp"
// The product:
#include "node/shm/publish.hpp"
#include "tactiled/layout.h"

namespace orders {
namespace {

constexpr std::uint32_t kSlotSize = 128, kMaxSlots = 8;
alignas(128) char segment[128 + kSlotSize * kMaxSlots];  // the head's word, then the slots

struct Record {
    std::uint64_t number, again;
};

tactiled_ring ring_of(std::uint32_t slots) {
    return {.offset = 128, .slot_size = kSlotSize, .slots = slots, .record_size = sizeof(Record), .head_offset = 0};
}
void publish(const tactiled_ring& ring, std::uint64_t number) {
    const Record record{number, ~number};
    tactiled::publish_record(segment, ring, number, &record, sizeof record);
}
// Record 0 is published, the next slot open.
void begin(const tactiled_ring& ring) {
    std::memset(segment, 0, sizeof segment);
    for (std::uint32_t i = 0; i < ring.slots; ++i) segment[ring.offset + i * ring.slot_size] = 1;
    publish(ring, 0);
}
void require_whole(const Record& record, std::uint32_t number) {
    require(record.number == number && record.again == ~std::uint64_t(number), "a copy is torn, or another record's");
}

Scenario scenario(const char* name, std::uint32_t slots, std::uint32_t last,
                  const std::function<void(const tactiled_ring&)>& read) {
    Scenario s;
    s.name = fmt::format("slots: {}", name);
    s.bounds = fmt::format("{} slots, records 1 to {} of two words", slots, last);
    s.build = [=, ring = ring_of(slots)](Execution& run) {
        begin(ring);
        run.thread([=] {
            for (std::uint32_t n = 1; n <= last; ++n) publish(ring, n);
        });
        run.thread([=] { read(ring); });
    };
    return s;
}

// Records are overwritten while they are read. Each is asked for once.
void read_by_number(const tactiled_ring& ring, std::uint32_t first, std::uint32_t last) {
    for (std::uint32_t n = first; n <= last; ++n) {
        Record record{};
        if (tactiled_ring_read(segment, &ring, n, &record, sizeof record) != 0) require_whole(record, n);
    }
}

// No record is overwritten: the newest one is there at once, and none is newer than one read later.
void read_newest(const tactiled_ring& ring) {
    std::uint32_t before = 0;
    for (int i = 0; i < 2; ++i) {
        const std::uint32_t head = tactiled_ring_head(segment, &ring);
        Record record{};
        require(tactiled_ring_read(segment, &ring, head - 1, &record, sizeof record) != 0, "the newest record is not there");
        require_whole(record, head - 1);
        require(head >= before, "an older record after a newer one");
        before = head;
    }
}

// By a cursor, whose record may be overwritten meanwhile. Records that it skipped are counted, and it never goes back.
void follow(const tactiled_ring& ring) {
    tactiled_cursor cursor{.lost = 0, .next = 1};
    Record record{};
    const int got = tactiled_ring_next(segment, &ring, &cursor, &record, sizeof record);
    require(cursor.next - std::uint32_t(got) == 1 + cursor.lost, "a skipped record is not counted");
    if (got != 0) require_whole(record, cursor.next - 1);
}

}  // namespace

std::vector<Scenario> slot_scenarios() {
    return {scenario("overwritten", 2, 3, [](const tactiled_ring& ring) { read_by_number(ring, 0, 1); }),
            scenario("overwritten, the second lap", 2, 5, [](const tactiled_ring& ring) { read_by_number(ring, 2, 3); }),
            scenario("newest", 8, 4, read_newest), scenario("a cursor", 2, 3, follow)};
}

}  // namespace orders
