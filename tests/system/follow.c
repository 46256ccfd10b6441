/* Prints every sample of a sensor as hexadecimal words. Uses only tactiled/layout.h and POSIX, like a program
 * that has only the header.   follow NODE SENSOR SECONDS It looks where the daemon of its user has its segment:
 * folder.h. A line: sequence device_sequence t_ns t_published_ns epoch quality reasons fx fy fz (the doubles'
 * bits), then "end LOST". */
#define _POSIX_C_SOURCE 200809L
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "layout.h"

static uint64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static uint64_t bits(double value) {
    uint64_t b;
    memcpy(&b, &value, sizeof b);
    return b;
}

int main(int argc, char** argv) {
    char path[256];
    struct stat status;
    int fd;
    uint32_t i, number = 0, lost = 0;
    if (argc != 4) return 2;
    const char* given = getenv("TACTILED_RUNTIME_DIR");
    const char* users = getuid() == 0 ? NULL : getenv("XDG_RUNTIME_DIR");
    snprintf(path, sizeof path, "%s%s/tactiled.%s",
             given   ? given
             : users ? users
                     : "/run/tactiled",
             given == NULL && users != NULL ? "/tactiled" : "", argv[1]);
    const uint64_t until = now_ns() + (uint64_t)(atof(argv[3]) * 1e9);
    while ((fd = open(path, O_RDONLY)) < 0)
        if (now_ns() > until) return 3;
    if (fstat(fd, &status) != 0) return 3;
    const char* base = mmap(NULL, (size_t)status.st_size, PROT_READ, MAP_SHARED, fd, 0);
    if (base == MAP_FAILED) return 3;
    const struct tactiled_header* header = (const void*)base;
    if (memcmp(header->magic, TACTILED_MAGIC, 8) != 0 || header->major != TACTILED_MAJOR) return 3;
    const struct tactiled_sensor* sensor = NULL;
    for (i = 0; i < header->n_sensors; ++i) {
        const struct tactiled_sensor* s = (const void*)(base + header->sensor_offset + i * header->sensor_size);
        if (strcmp(s->name, argv[2]) == 0) sensor = s;
    }
    if (sensor == NULL) return 3;
    while (now_ns() < until) {
        struct tactiled_sample sample;
        /* The state is read first: samples that were published before the daemon ended are read completely. */
        const int runs = __atomic_load_n(&header->state, __ATOMIC_ACQUIRE) <= TACTILED_RUNNING;
        const uint32_t head = tactiled_ring_head(base, &sensor->ring);
        if (head == number) {
            if (!runs) break;
            const struct timespec pause = {0, 200000};
            fflush(stdout);
            nanosleep(&pause, NULL);
            continue;
        }
        /* the writer is about to overwrite the record: skip ahead, and report it */
        if (head - number >= sensor->ring.slots) {
            lost += head - sensor->ring.slots / 2 - number;
            number = head - sensor->ring.slots / 2;
        }
        if (!tactiled_ring_read(base, &sensor->ring, number, &sample, sizeof sample)) {
            ++lost;
            ++number;
            continue;
        }
        ++number;
        printf("%" PRIu64 " %" PRIu32 " %" PRIu64 " %" PRIu64 " %" PRIx32 " %" PRIu32 " %" PRIx32 " %016" PRIx64
               " %016" PRIx64 " %016" PRIx64 "\n",
               sample.sequence, sample.device_sequence, sample.t_ns, sample.t_published_ns, sample.epoch, sample.quality,
               sample.reasons, bits(sample.force_S_N[0]), bits(sample.force_S_N[1]), bits(sample.force_S_N[2]));
    }
    printf("end %" PRIu32 "\n", lost);
    return 0;
}
