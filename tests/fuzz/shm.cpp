// The C reader on a segment that another program has written: any header, any directory, any ring, and slots, heads
// and states that change between the reader's calls. Oracles: nothing outside of the segment is read (the sanitizer
// knows its end to the byte), no call runs on, and a sample that is too old or of a daemon that ended is BAD and NaN.
//
// Names and the rings of frames do not change after they were checked: they are read in place, and folder.h says whom a
// reader trusts. Geometry is a copy of the reader's own.
#include <cmath>
#include <cstddef>
#include <cstring>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "node/shm/writer.hpp"
#include "tactiled/reader.h"
#include "tests/fuzz/input.hpp"

namespace {

using namespace tactiled;
using fuzz::check;
using fuzz::Input;

// Later than this machine's clock: the reader judges at the later of the two.
constexpr std::uint64_t kBegin_ns = std::uint64_t(1) << 62;

// A daemon's own, to begin with: else no fuzzer finds the way to the rings.
const std::vector<char>& good_segment() {
    static const std::vector<char> bytes = [] {
        SegmentPlan plan;
        plan.name = "fuzz-" + std::to_string(::getpid());
        plan.history = 8;
        plan.sensors.resize(2);
        plan.links.resize(1);
        std::strcpy(plan.sensors[0].name, "left");
        plan.sensors[0].stale_ms = plan.sensors[1].stale_ms = 100;
        std::strcpy(plan.links[0].name, "usb0");
        SegmentWriter writer(plan);
        writer.set_state(TACTILED_RUNNING);
        tactiled_sample sample{};
        sample.quality = TACTILED_GOOD;
        for (; sample.sequence < 12; ++sample.sequence) {
            sample.t_ns = kBegin_ns + sample.sequence;
            writer.publish(0, sample);
        }
        tactiled_node node{};
        writer.publish(node);
        tactiled_segment mapped;
        check(tactiled_open(&mapped, plan.name.c_str()) == 1);
        std::vector<char> copy(mapped.base, mapped.base + mapped.size);
        tactiled_close(&mapped);
        return copy;
    }();
    return bytes;
}

class Memory {  // ends where the segment does
public:
    explicit Memory(std::size_t size) : size_(size), at_(static_cast<char*>(::operator new (size, std::align_val_t{128}))) {}
    ~Memory() { ::operator delete (at_, std::align_val_t{128}); }
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;
    char* at() const { return at_; }
    std::size_t size() const { return size_; }

private:
    std::size_t size_;
    char* at_;
};

// The part that a daemon never changes, at the place that the checked header states.
class Constants {
public:
    explicit Constants(const Memory& memory) {
        const auto& h = *reinterpret_cast<const tactiled_header*>(memory.at());
        keep(memory, 0, offsetof(tactiled_header, state));
        keep(memory, h.sensor_offset, std::size_t{h.n_sensors} * h.sensor_size);
        keep(memory, h.link_offset, std::size_t{h.n_links} * h.link_size);
    }
    void put_back() const {
        for (const auto& [at, bytes] : kept_) std::copy(bytes.begin(), bytes.end(), at);
    }

private:
    void keep(const Memory& memory, std::size_t at, std::size_t size) {
        kept_.emplace_back(memory.at() + at, std::vector<char>(memory.at() + at, memory.at() + at + size));
    }

    std::vector<std::pair<char*, std::vector<char>>> kept_;
};

// Words anywhere get the fuzzer's values.
void scribble(Input& input, const Memory& memory) {
    for (unsigned n = input.byte() % 8; n > 0; --n) {
        const std::size_t at = input.number(2) * 4u % (memory.size() - 3) / 4 * 4;
        const auto bytes = input.take(4);
        std::copy(bytes.begin(), bytes.end(), memory.at() + at);
    }
}

// A ring's words say what is read: one of them gets a small number, or one that little is missing to the segment's end.
void bend_ring(Input& input, const Memory& memory) {
    tactiled_segment good{};
    good.base = good_segment().data();
    good.size = good_segment().size();
    check(tactiled_check(&good, "good") == 1);
    const tactiled_ring* const rings[] = {&tactiled_header_of(&good)->node, &tactiled_sensor_of(&good, 0)->ring,
                                          &tactiled_sensor_of(&good, 1)->ring, &tactiled_link_of(&good, 0)->frames};
    const unsigned what = input.byte();
    const auto at = std::size_t(reinterpret_cast<const char*>(rings[what % 4]) - good.base) + what / 4 % 5 * 4;
    const std::uint32_t small = std::uint32_t(input.byte()) << input.byte() % 16;
    const std::uint32_t number = what < 128 ? small : std::uint32_t(memory.size() / 128 * 128) - small;
    if (at + sizeof number <= memory.size()) std::memcpy(memory.at() + at, &number, sizeof number);
}

void read_all(Input& input, const tactiled_segment& segment, const Memory& memory) {
    const Constants constants(memory);
    const tactiled_header* const h = tactiled_header_of(&segment);
    tactiled_cursor cursor[TACTILED_MAX_SENSORS]{};
    (void)tactiled_find(&segment, "left");
    for (int turn = 0; turn < 8 && !input.is_empty(); ++turn) {
        const std::uint64_t now_ns = kBegin_ns + std::uint64_t(input.byte()) * 1'000'000;
        tactiled_node node;
        (void)tactiled_latest_node(&segment, &node, now_ns);
        for (std::uint32_t i = 0; i < h->n_sensors; ++i) {
            const tactiled_sensor* const sensor = tactiled_sensor_of(&segment, i);
            (void)std::strlen(tactiled_methods_of(&segment, i));
            (void)std::strlen(sensor->name);
            tactiled_sample sample;
            const int there = tactiled_latest(&segment, i, &sample, now_ns);
            const bool stale = there == 0 || !tactiled_is_fresh(sample.t_ns, now_ns, sensor->stale_ms);
            if (stale || !tactiled_is_current(&segment))
                check(sample.quality == TACTILED_BAD && std::isnan(sample.force_S_N[2]) &&
                      std::isnan(sample.raw_force_S_N[2]));
            if (turn == 0) tactiled_ring_seek(segment.base, &sensor->ring, &cursor[i], 1);
            const std::uint64_t lost = cursor[i].lost;
            for (unsigned n = 0; n <= 2 * sensor->ring.slots && n < 64; ++n)
                if (tactiled_ring_next(segment.base, &sensor->ring, &cursor[i], &sample, sizeof sample) == 0) break;
            check(cursor[i].lost >= lost);
        }
        for (std::uint32_t i = 0; i < h->n_links; ++i) {
            const tactiled_link* const link = tactiled_link_of(&segment, i);
            (void)std::strlen(link->name);
            (void)std::strlen(link->driver);
            tactiled_frame frame;
            if (link->frames.slots != 0) (void)tactiled_ring_latest(segment.base, &link->frames, &frame, sizeof frame);
        }
        scribble(input, memory);
        constants.put_back();
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(data, size);
    const auto& good = good_segment();
    const std::size_t cut = input.byte() == 0xFF ? input.number(3) % good.size() : 0;
    static const Memory whole(good.size());
    const Memory short_one(cut == 0 ? 0 : std::max(good.size() - cut, sizeof(tactiled_header)));
    const Memory& memory = cut == 0 ? whole : short_one;
    std::memcpy(memory.at(), good.data(), memory.size());
    const auto* const h = reinterpret_cast<const tactiled_header*>(memory.at());
    // Half of the inputs are about the header and the directories, where most of what can be wrong is.
    const std::size_t directories =
        h->sensor_offset + std::size_t{h->n_sensors} * h->sensor_size + h->n_links * h->link_size;
    for (unsigned n = input.byte() % 8; n > 0; --n) {
        const std::size_t at = input.number(2) % std::min(memory.size(), directories);
        const auto bytes = input.take(input.byte() % 8u);
        std::copy_n(bytes.begin(), std::min(bytes.size(), memory.size() - at), memory.at() + at);
    }
    for (unsigned n = input.byte() % 4; n > 0; --n) bend_ring(input, memory);
    tactiled_segment segment{};
    segment.base = memory.at();
    segment.size = memory.size();
    if (tactiled_check(&segment, "fuzz") == 0) {
        check(segment.why[0] != 0);
        return 0;
    }
    (void)std::strlen(h->name);
    (void)std::strlen(h->control);
    read_all(input, segment, memory);
    return 0;
}
