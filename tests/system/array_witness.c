/* Reads the arrays of a Ramp (array_ramp.py) as fast as it can until SIGTERM, then prints what it counted. It is compiled as C
 * with reader.h, and as C++ with reader.hpp.
 *
 *     array_witness NODE SENSOR STALE_MS newest|history
 *
 * newest: the newest array. history: in C all arrays of the ring, from the oldest one on, which the daemon is about to
 * overwrite; in C++ the array of each sample. */
#ifndef __cplusplus
#define _GNU_SOURCE
#endif
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef __cplusplus
#include "tactiled/reader.hpp"
#else
#include "tactiled/reader.h"
#endif

enum { kMaxTaxels = 4096, kMaxComponents = 3 };
static const double kHalfCount_N = 0.0005;

static volatile sig_atomic_t ended;
static void end(int number) { ended = number; }

/* reads: arrays asked for; lost: no longer in the ring; frames: different ones with values; bad: without values; mixed: values
 * of two frames, or of another one than stated; old: values beyond stale_ms; kept: values in a BAD array. */
static uint64_t reads, lost, frames, bad, mixed, old, kept, last_sequence;
static uint64_t stale_ns;

/* Counts of every value of frame n, as array_ramp.py sends them. */
static double force_N(uint32_t n) {
    const int32_t k = (int32_t)(n % 20000u) - 10000;
    return 0.001 * (1000 + (k < 0 ? -k : k));
}

static void count(const struct tactiled_array* head, const float* force, uint32_t n_taxels, uint32_t n_components) {
    const double expected_N = force_N(head->sample.device_sequence);
    uint32_t i, c, wrong = 0, numbers = 0;
    for (i = 0; i < n_taxels; ++i)
        for (c = 0; c < n_components; ++c) {
            const double f = (double)force[i * n_components + c];
            numbers += !isnan(f);
            wrong += !(fabs(fabs(f) - expected_N) < kHalfCount_N);
        }
    if (head->sample.quality == TACTILED_BAD) {
        ++bad;
        kept += numbers != 0 || !isnan(head->peak_N) || !isnan(head->sample.force_S_N[2]);
        return;
    }
    frames += last_sequence != head->sample.sequence;
    last_sequence = head->sample.sequence;
    mixed += wrong != 0 || !(fabs(fabs(head->sample.force_S_N[2]) - n_taxels * expected_N) < n_taxels * kHalfCount_N);
}

static void judge_age(const struct tactiled_sample* s, uint64_t before_ns) {
    if (s->quality != TACTILED_BAD && (int64_t)(before_ns - s->t_ns) > (int64_t)stale_ns) ++old;
}

#ifdef __cplusplus
static void count(const tactiled::Array& array) { count(&array.head(), array.forces(), array.n_taxels(), array.n_components()); }

static void read_newest(tactiled::Reader& reader, tactiled::Array& array) {
    const std::uint64_t before_ns = tactiled::monotonic_ns();
    if (!reader.latest(array)) return;
    ++reads;
    judge_age(&array.head().sample, before_ns);
    count(array);
}

static void read_history(tactiled::Reader& reader, tactiled::Array& array) {
    tactiled_sample s;
    if (!reader.wait(s, 20) || s.quality == TACTILED_BAD) return;
    ++reads;
    if (!reader.segment().array_of(std::uint32_t(reader.segment().find("skin")), s, array)) ++lost;
    else if (array.head().sample.sequence != s.sequence || array.head().sample.epoch != s.epoch) ++mixed;
    count(array);
}
#else
/* The buffer of an array. */
static struct {
    struct tactiled_array head;
    float force[kMaxTaxels * kMaxComponents];
    uint8_t state[kMaxTaxels];
} array;

static void count_array(const struct tactiled_segment* segment, uint32_t index) {
    count(&array.head, tactiled_taxel_forces(&array.head), segment->array[index].n_taxels, segment->array[index].n_components);
}

static void read_newest(struct tactiled_reader* reader) {
    struct tactiled_sample s;
    const uint64_t before_ns = tactiled_now_ns();
    tactiled_reader_latest(reader, &s); /* attaches to a successor */
    if (reader->index < 0) return;
    ++reads;
    tactiled_latest_array(&reader->segment, (uint32_t)reader->index, &array.head, 0);
    judge_age(&array.head.sample, before_ns);
    count_array(&reader->segment, (uint32_t)reader->index);
}

static void read_history(struct tactiled_reader* reader) {
    struct tactiled_sample s;
    uint64_t n;
    tactiled_reader_latest(reader, &s);
    if (reader->index < 0 || s.quality == TACTILED_BAD) return;
    const uint32_t index = (uint32_t)reader->index, slots = reader->segment.array[index].ring.slots;
    for (n = s.sequence < slots ? 0 : s.sequence - slots; n <= s.sequence; ++n, ++reads) {
        if (!tactiled_array_of_sample(&reader->segment, index, n, &array.head)) ++lost;
        else if (array.head.sample.sequence != n) ++mixed;
        count_array(&reader->segment, index);
    }
}
#endif

int main(int argc, char** argv) {
    if (argc != 5) return 2;
    const int newest = strcmp(argv[4], "newest") == 0;
    stale_ns = (uint64_t)atoi(argv[3]) * 1000000u;
    signal(SIGTERM, end);
#ifdef __cplusplus
    tactiled::Reader reader(argv[1], argv[2]);
    tactiled::Array array;
    while (!ended) newest ? read_newest(reader, array) : read_history(reader, array);
#else
    struct tactiled_reader reader;
    tactiled_reader_init(&reader, argv[1], argv[2]);
    while (!ended) newest ? read_newest(&reader) : read_history(&reader);
#endif
    printf("{\"reads\": %" PRIu64 ", \"lost\": %" PRIu64 ", \"frames\": %" PRIu64 ", \"bad\": %" PRIu64 ", \"mixed\": %" PRIu64
           ", \"old\": %" PRIu64 ", \"kept\": %" PRIu64 "}\n",
           reads, lost, frames, bad, mixed, old, kept);
    return 0;
}
