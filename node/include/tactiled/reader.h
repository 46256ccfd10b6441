/* Reads the segment of a tactiled daemon in C11. Header only, nothing to link. C++ programs use reader.hpp.
 *
 *     struct tactiled_reader left;
 *     struct tactiled_sample s;
 *     tactiled_reader_init(&left, "gripper", "left");
 *     while (tactiled_reader_wait(&left, &s, 1000, TACTILED_BLOCK))
 *         if (s.quality == TACTILED_GOOD) use(s.force_S_N);
 *
 * A reader costs the daemon nothing and cannot delay it. When the daemon ends, the reader gets one BAD sample and
 * attaches to the next daemon automatically. Each thread needs its own object. The header needs -std=gnu11 (or
 * _DEFAULT_SOURCE).
 *
 * folder.h states in which folder the segment is and when a reader trusts it. mapping.h states how a reader
 * survives a truncated file, for which it installs a handler of SIGBUS. */
#ifndef TACTILED_READER_H
#define TACTILED_READER_H

#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <linux/membarrier.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "folder.h"
#include "layout.h"
#include "mapping.h"

#ifdef __cplusplus
extern "C" {
#endif

static inline uint64_t tactiled_now_ns(void) /* CLOCK_MONOTONIC */
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

/* ---- One mapping of one segment ------------------------------------------------------------------------------------ */

/* The array of a sensor with taxels: constant while the segment exists. */
struct tactiled_array_plan {
    struct tactiled_ring ring; /* no slots: the sensor is not an array, or the daemon publishes none (before 1.9) */
    uint32_t n_taxels, components, n_components; /* bits 0..2 of `components`: fx fy fz */
    uint32_t rows, columns;                      /* 0 = a list of places */
    uint32_t place_offset;
};

struct tactiled_segment {
    const char* base; /* NULL: not open */
    size_t size;
    struct tactiled_mapping* entry;
    /* Copies of the constant fields, made and checked when the segment was opened, so that later damage to the
     * file cannot make a reader leave the mapping. */
    uint32_t watchdog_ms, n_sensors, sensor_offset, sensor_size, n_links, link_offset, link_size;
    uint32_t stale_ms[TACTILED_MAX_SENSORS];
    struct tactiled_ring node, ring[TACTILED_MAX_SENSORS];
    struct tactiled_array_plan array[TACTILED_MAX_SENSORS];
    struct tactiled_ring taxels[TACTILED_MAX_LINKS]; /* raw values of a link's arrays; no slots: none, or before 1.9 */
    char folder[TACTILED_FOLDER_SIZE];               /* the folder of the segment */
    char why[320];                                   /* the reason if the segment is not open; else a warning or "" */
};

static inline const struct tactiled_header* tactiled_header_of(const struct tactiled_segment* segment) {
    return (const struct tactiled_header*)(const void*)segment->base;
}
static inline const struct tactiled_sensor* tactiled_sensor_of(const struct tactiled_segment* segment, uint32_t index) {
    return (const struct tactiled_sensor*)(const void*)(segment->base + segment->sensor_offset +
                                                        (size_t)index * segment->sensor_size);
}
/* Returns the names of the methods of method "auto", or "" if there are none or the daemon is of version 1.0.
 * With "", do not read the fields of struct tactiled_sensor that 1.1 added. */
static inline const char* tactiled_methods_of(const struct tactiled_segment* segment, uint32_t index) {
    const int has = segment->sensor_size >= TACTILED_SENSOR_SIZE_1_1;
    const char* methods = has ? tactiled_sensor_of(segment, index)->methods : "";
    return memchr(methods, 0, has ? TACTILED_METHODS_SIZE : 1) != NULL ? methods : "";
}
/* Returns the number of samples of a sensor with reason bit `bit` (0 .. 31) since the daemon started; 0 if the
 * daemon does not count (before 1.3). */
static inline uint32_t tactiled_reason_count(const struct tactiled_segment* segment, uint32_t index, unsigned bit) {
    if (segment->sensor_size < TACTILED_SENSOR_SIZE_1_3) return 0;
    return __atomic_load_n(&tactiled_sensor_of(segment, index)->count[bit], __ATOMIC_RELAXED);
}
/* Returns how the age of a sensor's samples is proved (enum tactiled_freshness); 0 if the daemon does not publish
 * that (before 1.5). */
static inline uint32_t tactiled_freshness_of(const struct tactiled_segment* segment, uint32_t index) {
    if (segment->sensor_size < TACTILED_SENSOR_SIZE_1_5) return 0;
    return __atomic_load_n(&tactiled_sensor_of(segment, index)->freshness, __ATOMIC_RELAXED);
}
/* Returns the largest possible age of a sensor's newest frame, as of the node record, in us, rounded up;
 * TACTILED_AGE_UNBOUNDED if there is no frame yet or if the daemon does not publish the bound (before 1.8). */
static inline uint32_t tactiled_age_bound_us_of(const struct tactiled_segment* segment, uint32_t index) {
    if (segment->sensor_size < TACTILED_SENSOR_SIZE_1_8) return TACTILED_AGE_UNBOUNDED;
    return __atomic_load_n(&tactiled_sensor_of(segment, index)->age_bound_us, __ATOMIC_RELAXED);
}
/* The undetected damage that a sensor's calibration states: the members of tactiled_sensor of these names. */
struct tactiled_undetected {
    float mean, worst; /* NaN if the calibration or the daemon (before 1.9) states none */
    uint32_t channel, kind;
};
static inline struct tactiled_undetected tactiled_undetected_in(const struct tactiled_sensor* sensor) {
    struct tactiled_undetected found;
    found.mean = sensor->undetected_mean;
    found.worst = sensor->undetected_worst;
    found.channel = sensor->undetected_channel;
    found.kind = sensor->undetected_kind;
    return found;
}
static inline struct tactiled_undetected tactiled_undetected_of(const struct tactiled_segment* segment, uint32_t index) {
    struct tactiled_undetected unknown;
    memset(&unknown, 0, sizeof unknown);
    unknown.mean = unknown.worst = __builtin_nanf("");
    if (segment->sensor_size < sizeof(struct tactiled_sensor)) return unknown;
    return tactiled_undetected_in(tactiled_sensor_of(segment, index));
}
/* Returns the array of a sensor; one without slots if it has none. */
static inline struct tactiled_array_plan tactiled_array_of(const struct tactiled_segment* segment, uint32_t index) {
    const struct tactiled_sensor* const sensor = tactiled_sensor_of(segment, index);
    struct tactiled_array_plan plan;
    memset(&plan, 0, sizeof plan);
    if (segment->sensor_size < sizeof *sensor || sensor->arrays.slots == 0) return plan;
    plan.ring = sensor->arrays;
    plan.n_taxels = sensor->n_taxels;
    plan.components = sensor->taxel_components & 7u;
    plan.n_components = (uint32_t)__builtin_popcount(plan.components);
    plan.rows = sensor->taxel_rows;
    plan.columns = sensor->taxel_columns;
    plan.place_offset = sensor->taxel_place_offset;
    return plan;
}
static inline const struct tactiled_link* tactiled_link_of(const struct tactiled_segment* segment, uint32_t index) {
    return (const struct tactiled_link*)(const void*)(segment->base + segment->link_offset +
                                                      (size_t)index * segment->link_size);
}
/* Returns 0 if the daemon has ended cleanly, if a successor has taken over, or if the file was truncated: open
 * again. */
static inline int tactiled_is_current(const struct tactiled_segment* segment) {
    const uint32_t state = __atomic_load_n(&tactiled_header_of(segment)->state, __ATOMIC_ACQUIRE);
    return (state == TACTILED_RUNNING || state == TACTILED_STARTING) &&
           tactiled_is_whole(segment->base, segment->size, segment->entry);
}
/* Returns the time at which a record that was just copied is judged: the clock's, or `now_ns` if that is later. The clock
 * is read after the copy, so that an interruption of this thread makes the record older, never younger. */
static inline uint64_t tactiled_judged_ns(uint64_t now_ns) {
    const uint64_t clock_ns = tactiled_now_ns();
    return clock_ns > now_ns ? clock_ns : now_ns;
}
/* Returns 1 if the newest node record is at most watchdog_ms old. A record that is too old is copied once more, because this
 * thread may have been interrupted after the copy. */
static inline int tactiled_is_beating(const struct tactiled_segment* segment, uint64_t now_ns) {
    struct tactiled_node node;
    int tries;
    for (tries = 0; tries < 2; ++tries)
        if (tactiled_ring_latest(segment->base, &segment->node, &node, sizeof node) &&
            tactiled_is_fresh(node.t_ns, tactiled_judged_ns(now_ns), segment->watchdog_ms))
            return 1;
    return 0;
}
/* Returns 1 if the daemon published within its watchdog_ms. `t_published_ns` is the time of any of its records;
 * if that time is recent enough, the node record is not read. */
static inline int tactiled_is_alive(const struct tactiled_segment* segment, uint64_t t_published_ns, uint64_t now_ns) {
    return tactiled_is_fresh(t_published_ns, now_ns, segment->watchdog_ms) || tactiled_is_beating(segment, now_ns);
}

static inline int tactiled_fits(const struct tactiled_segment* segment, uint64_t offset, uint64_t size, uint32_t alignment) {
    return offset % alignment == 0 && offset + size <= segment->size;
}
static inline int tactiled_ring_fits(const struct tactiled_segment* segment, const struct tactiled_ring* ring) {
    return ring->slots >= 8 && (ring->slots & (ring->slots - 1)) == 0 && ring->slot_size % 128 == 0 &&
           ring->record_size % 4 == 0 && TACTILED_RECORD_OFFSET + (uint64_t)ring->record_size <= ring->slot_size &&
           tactiled_fits(segment, ring->offset, (uint64_t)ring->slots * ring->slot_size, 128) &&
           tactiled_fits(segment, ring->head_offset, 4, 4);
}
/* Returns 1 if all names have their terminating zero. */
static inline int tactiled_names_end(const char* names, uint32_t count, uint32_t size) {
    uint32_t i;
    for (i = 0; i < count; ++i)
        if (memchr(names + (size_t)i * size, 0, size) == NULL) return 0;
    return 1;
}
/* Returns 1 if the array of a sensor is within the mapping, or if it has none. */
static inline int tactiled_array_fits(const struct tactiled_segment* segment, const struct tactiled_array_plan* plan) {
    if (plan->ring.slots == 0) return 1;
    return plan->n_taxels >= 1 && plan->n_taxels <= TACTILED_MAX_TAXELS && tactiled_ring_fits(segment, &plan->ring) &&
           plan->ring.record_size >= tactiled_array_size(plan->n_taxels, plan->components) &&
           (plan->rows == 0 || (uint64_t)plan->rows * plan->columns == plan->n_taxels) &&
           tactiled_fits(segment, plan->place_offset, (uint64_t)plan->n_taxels * 6 * sizeof(float), 4);
}
/* Returns 1 if everything that the header describes is within the mapping; else segment->why has the reason. */
static inline int tactiled_check(struct tactiled_segment* segment, const char* file) {
    struct tactiled_header copy;
    const struct tactiled_header* const h = &copy;
    const char* wrong = NULL;
    uint32_t i;
    memcpy(&copy, segment->base, sizeof copy);
    if (memcmp(h->magic, TACTILED_MAGIC, sizeof h->magic) != 0)
        wrong = "no tactiled segment";
    else if (h->byte_order != TACTILED_BYTE_ORDER)
        wrong = "written by a machine of the other byte order";
    else if (h->major != TACTILED_MAJOR) {
        snprintf(
            segment->why, sizeof segment->why,
            "%s/%s: its layout is version %u.%u, this reader knows %u.%u: build the reader against the daemon's headers",
            segment->folder, file, h->major, h->minor, TACTILED_MAJOR, TACTILED_MINOR);
        return 0;
    } else if (h->total_size > segment->size || h->header_size < sizeof *h)
        wrong = "truncated";
    else if (h->n_sensors > TACTILED_MAX_SENSORS || h->n_links > TACTILED_MAX_LINKS)
        wrong = "more sensors or links than can be";
    else if (h->sensor_size < TACTILED_SENSOR_SIZE_1_0 || h->link_size < sizeof(struct tactiled_link) ||
             h->sensor_size % 4 != 0 || h->link_size % 128 != 0)
        wrong = "directory entries of a wrong size";
    else if (!tactiled_fits(segment, h->sensor_offset, (uint64_t)h->sensor_size * h->n_sensors, 4) ||
             !tactiled_fits(segment, h->link_offset, (uint64_t)h->link_size * h->n_links, 128))
        wrong = "a directory lies outside";
    else if (!tactiled_ring_fits(segment, &h->node))
        wrong = "the node ring lies outside";
    else if (!tactiled_names_end(h->boot_id, 1, sizeof h->boot_id) || !tactiled_names_end(h->name, 2, TACTILED_NAME_SIZE) ||
             !tactiled_names_end(h->control, 1, sizeof h->control))
        wrong = "a name has no end";
    segment->watchdog_ms = h->watchdog_ms;
    segment->n_sensors = h->n_sensors;
    segment->sensor_offset = h->sensor_offset;
    segment->sensor_size = h->sensor_size;
    segment->n_links = h->n_links;
    segment->link_offset = h->link_offset;
    segment->link_size = h->link_size;
    segment->node = h->node;
    for (i = 0; wrong == NULL && i < h->n_sensors; ++i) {
        const struct tactiled_sensor* sensor = tactiled_sensor_of(segment, i);
        segment->stale_ms[i] = sensor->stale_ms;
        memcpy(&segment->ring[i], &sensor->ring, sizeof sensor->ring);
        if (!tactiled_ring_fits(segment, &segment->ring[i])) wrong = "a sensor's ring lies outside";
        segment->array[i] = tactiled_array_of(segment, i);
        if (!tactiled_array_fits(segment, &segment->array[i])) wrong = "a sensor's array lies outside";
        if (!tactiled_names_end(sensor->name, 5, TACTILED_NAME_SIZE)) wrong = "a name of a sensor has no end";
    }
    for (i = 0; wrong == NULL && i < h->n_links; ++i) {
        const struct tactiled_link* link = tactiled_link_of(segment, i);
        if (link->frames.slots != 0 && !tactiled_ring_fits(segment, &link->frames)) wrong = "a link's ring lies outside";
        memset(&segment->taxels[i], 0, sizeof segment->taxels[i]);
        if (h->minor >= 9) segment->taxels[i] = link->taxels;
        if (segment->taxels[i].slots != 0 && (!tactiled_ring_fits(segment, &segment->taxels[i]) ||
                                              segment->taxels[i].record_size < sizeof(struct tactiled_taxels)))
            wrong = "a link's taxels lie outside";
        if (!tactiled_names_end(link->name, 2, TACTILED_NAME_SIZE)) wrong = "a name of a link has no end";
    }
    if (wrong != NULL) snprintf(segment->why, sizeof segment->why, "%s/%s: %s", segment->folder, file, wrong);
    return wrong == NULL;
}

static inline void tactiled_close(struct tactiled_segment* segment) {
    if (segment->base != NULL) tactiled_unmap(segment->base, segment->size, segment->entry);
    segment->base = NULL;
}

/* Returns the age beyond which the grasp and the tool of a node record are "not known": they then do not reflect that the
 * sensors are silent. */
static inline uint32_t tactiled_node_limit_ms(const struct tactiled_segment* segment) {
    const uint32_t min_ms = 20; /* the daemon publishes at least each 10 ms */
    uint32_t i, limit_ms = segment->watchdog_ms;
    for (i = 0; i < segment->n_sensors; ++i)
        if (segment->stale_ms[i] < limit_ms) limit_ms = segment->stale_ms[i];
    return limit_ms < min_ms ? min_ms : limit_ms;
}
/* Copies the newest node record, judged after the copy, or at `now_ns` if that is later. Its grasp and its tool are "not
 * known" if the daemon has ended, if the daemon publishes no grasp (before 1.1), or if the record is older than
 * tactiled_node_limit_ms(). Returns 1, or 0 if there is no record. */
static inline int tactiled_latest_node(const struct tactiled_segment* segment, struct tactiled_node* node, uint64_t now_ns) {
    if (!tactiled_ring_latest(segment->base, &segment->node, node, sizeof *node)) return 0;
    if (segment->node.record_size < TACTILED_NODE_SIZE_1_1 || !tactiled_is_current(segment) ||
        !tactiled_is_fresh(node->t_ns, tactiled_judged_ns(now_ns), tactiled_node_limit_ms(segment))) {
        tactiled_forget_grasp(&node->grasp);
        tactiled_forget_tool(&node->tool);
    }
    return 1;
}

/* Returns 1 if a name is valid. A name that is too long must not be cut to another valid name. The name of a node
 * becomes a part of a path and is limited to the characters that a configuration allows. */
static inline int tactiled_check_name(struct tactiled_segment* segment, const char* of_what, const char* name) {
    const int is_node = of_what[0] == 'n';
    const size_t length = strlen(name);
    if (length == 0 || length >= TACTILED_NAME_SIZE) {
        snprintf(segment->why, sizeof segment->why, "%s \"%.100s\": a name has 1 to %d characters", of_what, name,
                 TACTILED_NAME_SIZE - 1);
        return 0;
    }
    if (is_node && strspn(name, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-") != length) {
        snprintf(segment->why, sizeof segment->why, "node \"%s\": a name has the characters A-Z a-z 0-9 _ . - only", name);
        return 0;
    }
    return 1;
}

/* Maps the segment of a node in segment->folder. errno is ENOENT if there is none. */
static inline int tactiled_open_here(struct tactiled_segment* segment, const char* node_name) {
    char file[16 + TACTILED_NAME_SIZE];
    struct stat status;
    int fd, error = EPERM;
    snprintf(file, sizeof file, "tactiled.%s", node_name);
    fd = tactiled_open_file(segment->folder, file, &status, segment->why, sizeof segment->why);
    if (fd < 0) return 0;
    if (status.st_size < (off_t)sizeof(struct tactiled_header)) {
        snprintf(segment->why, sizeof segment->why, "%s/%s: too short to be a segment", segment->folder, file);
    } else {
        segment->size = (size_t)status.st_size;
        segment->base = tactiled_map(fd, segment->size, &segment->entry);
        error = errno;
        if (segment->base == NULL)
            snprintf(segment->why, sizeof segment->why, "%s/%s: mmap: %s", segment->folder, file, strerror(error));
        else if (!tactiled_check(segment, file))
            tactiled_close(segment);
    }
    close(fd);
    errno = error == ENOENT ? EPERM : error;
    return segment->base != NULL;
}

/* Maps the segment of a node read-only and checks it, in `folder` or, if that is NULL or "", in the folders of
 * folder.h. Returns 1, or 0 with the reason in segment->why. */
static inline int tactiled_open_in(struct tactiled_segment* segment, const char* folder, const char* node_name) {
    const int given = folder != NULL && folder[0] != 0;
    int open = 0, n = 0;
    memset(segment, 0, sizeof *segment);
    if (!tactiled_check_name(segment, "node", node_name)) return 0;
    if (given && strlen(folder) >= sizeof segment->folder) {
        snprintf(segment->why, sizeof segment->why, "folder \"%.100s...\": the path is too long", folder);
        return 0;
    }
    if (given) {
        memcpy(segment->folder, folder, strlen(folder) + 1);
        open = tactiled_open_here(segment, node_name);
    }
    for (errno = ENOENT; !given && !open && errno == ENOENT; ++n) {
        if (!tactiled_folder((unsigned)n, segment->folder, sizeof segment->folder)) break;
        open = tactiled_open_here(segment, node_name);
    }
    if (open && strcmp(segment->folder, TACTILED_SHARED_FOLDER) == 0)
        snprintf(segment->why, sizeof segment->why, "%s", TACTILED_SHARED_WARNING);
    if (!open && !given && errno == ENOENT) {
        char second[TACTILED_FOLDER_SIZE];
        const int both =
            tactiled_folder(0, segment->folder, sizeof segment->folder) && tactiled_folder(1, second, sizeof second);
        snprintf(segment->why, sizeof segment->why,
                 "node \"%s\": no daemon of that name runs: no tactiled.%s in %.90s%s%.90s", node_name, node_name,
                 segment->folder, both ? " or " : "", both ? second : "");
    }
    if (!open) segment->folder[0] = 0; /* the next attempt searches all folders */
    return open;
}
static inline int tactiled_open(struct tactiled_segment* segment, const char* node_name) {
    return tactiled_open_in(segment, NULL, node_name);
}

/* Returns the index of the sensor with that name, or -1. */
static inline int tactiled_find(const struct tactiled_segment* segment, const char* sensor_name) {
    uint32_t i;
    for (i = 0; i < segment->n_sensors; ++i)
        if (strncmp(tactiled_sensor_of(segment, i)->name, sensor_name, TACTILED_NAME_SIZE) == 0) return (int)i;
    return -1;
}

/* Writes the message for a name that no sensor has, with the names that there are, cut at `size`. */
static inline void tactiled_no_sensor(const struct tactiled_segment* segment, const char* node_name, const char* sensor_name,
                                      char* text, size_t size) {
    uint32_t i;
    int at = snprintf(text, size, "node \"%s\" has no sensor \"%s\"; it has:", node_name, sensor_name);
    for (i = 0; i < segment->n_sensors && at > 0 && (size_t)at < size; ++i)
        at += snprintf(text + at, size - (size_t)at, "%s %.*s", i == 0 ? "" : ",", TACTILED_NAME_SIZE,
                       tactiled_sensor_of(segment, i)->name);
}

/* Part of the two functions below: `size` bytes of the record, which begins with the sample. */
static inline int tactiled_latest_(const struct tactiled_segment* segment, uint32_t index, struct tactiled_sample* sample,
                                   uint32_t size, uint64_t now_ns) {
    const struct tactiled_ring* ring = &segment->ring[index];
    uint64_t judged_ns = 0;
    int tries, is_fresh = 0;
    for (tries = 0; tries < 2 && !is_fresh; ++tries) { /* twice, as in tactiled_is_beating() */
        if (!tactiled_ring_latest(segment->base, ring, sample, size)) {
            memset(sample, 0, size);
            tactiled_invalidate(
                sample, tactiled_ring_head(segment->base, ring) == 0 ? TACTILED_NO_DATA_YET : TACTILED_READER_OVERRUN);
            return 0;
        }
        judged_ns = tactiled_judged_ns(now_ns);
        is_fresh = tactiled_is_fresh(sample->t_ns, judged_ns, segment->stale_ms[index]);
    }
    if (!is_fresh) tactiled_invalidate(sample, TACTILED_STALE);
    if (!tactiled_is_current(segment) || !tactiled_is_alive(segment, sample->t_published_ns, judged_ns))
        tactiled_invalidate(sample, TACTILED_DAEMON_STOPPED);
    return 1;
}

/* Copies the newest sample of a sensor, judged after the copy, or at `now_ns` if that is later: BAD if it is older than
 * stale_ms, if the daemon has ended, or if the daemon has published nothing for watchdog_ms. Returns 0 and a BAD sample if
 * there is none. */
static inline int tactiled_latest(const struct tactiled_segment* segment, uint32_t index, struct tactiled_sample* sample,
                                  uint64_t now_ns) {
    return tactiled_latest_(segment, index, sample, sizeof *sample, now_ns);
}
/* Does the same, with the standard deviation of the centre of pressure and the parts of the others (uncertainty.h). */
static inline int tactiled_latest_placed(const struct tactiled_segment* segment, uint32_t index,
                                         struct tactiled_placed* placed, uint64_t now_ns) {
    struct tactiled_sample* const sample = (struct tactiled_sample*)(void*)placed;
    const int is_read = tactiled_latest_(segment, index, sample, sizeof *placed, now_ns);
    tactiled_forget_appended(placed, placed->sample.quality == TACTILED_BAD ? 0 : segment->ring[index].record_size);
    return is_read;
}

/* ---- Arrays. `array` has tactiled_array_size() bytes, at least those of segment->array[index]; see struct
 * tactiled_array for what follows it. ---- */

/* The forces of the taxels, N, frame S: component c of the measured ones of taxel i is [i * n_components + c]. */
static inline const float* tactiled_taxel_forces(const struct tactiled_array* array) {
    return (const float*)(const void*)(array + 1);
}
/* The states of the taxels, enum tactiled_taxel_state. */
static inline const uint8_t* tactiled_taxel_states(const struct tactiled_array* array,
                                                   const struct tactiled_array_plan* plan) {
    return (const uint8_t*)(tactiled_taxel_forces(array) + (size_t)plan->n_taxels * plan->n_components);
}
/* Places, m, and normals of the taxels in frame S: six numbers for each. */
static inline const float* tactiled_taxel_places(const struct tactiled_segment* segment, uint32_t index) {
    return (const float*)(const void*)(segment->base + segment->array[index].place_offset);
}

/* Copies the array that belongs to the sample with this sequence number, as it was published. Returns 1, or 0 if the ring
 * has another one there. */
static inline int tactiled_array_of_sample(const struct tactiled_segment* segment, uint32_t index, uint64_t sequence,
                                           struct tactiled_array* array) {
    const struct tactiled_array_plan* const plan = &segment->array[index];
    const uint32_t size = tactiled_array_size(plan->n_taxels, plan->components);
    if (plan->ring.slots != 0 && tactiled_ring_read(segment->base, &plan->ring, (uint32_t)sequence, array, size)) return 1;
    memset(array, 0, size); /* the copy may be a mixture */
    tactiled_invalidate_array(array, plan->n_taxels * plan->n_components, TACTILED_READER_OVERRUN);
    return 0;
}
/* Copies the newest array of a sensor, judged as in tactiled_latest(): where its sample is BAD, its forces are NaN. Returns
 * 0 and a BAD array if there is none. */
static inline int tactiled_latest_array(const struct tactiled_segment* segment, uint32_t index, struct tactiled_array* array,
                                        uint64_t now_ns) {
    const struct tactiled_array_plan* const plan = &segment->array[index];
    const uint32_t n_forces = plan->n_taxels * plan->n_components;
    uint64_t judged_ns = 0;
    int tries, is_fresh = 0;
    for (tries = 0; tries < 2 && !is_fresh; ++tries) { /* twice, as in tactiled_is_beating() */
        if (plan->ring.slots == 0 || !tactiled_ring_latest(segment->base, &plan->ring, array,
                                                           tactiled_array_size(plan->n_taxels, plan->components))) {
            const int is_empty = plan->ring.slots == 0 || tactiled_ring_head(segment->base, &plan->ring) == 0;
            memset(array, 0, tactiled_array_size(plan->n_taxels, plan->components));
            tactiled_invalidate_array(array, n_forces, is_empty ? TACTILED_NO_DATA_YET : TACTILED_READER_OVERRUN);
            return 0;
        }
        judged_ns = tactiled_judged_ns(now_ns);
        is_fresh = tactiled_is_fresh(array->sample.t_ns, judged_ns, segment->stale_ms[index]);
    }
    if (!is_fresh) tactiled_invalidate_array(array, n_forces, TACTILED_STALE);
    if (!tactiled_is_current(segment) || !tactiled_is_alive(segment, array->sample.t_published_ns, judged_ns))
        tactiled_invalidate_array(array, n_forces, TACTILED_DAEMON_STOPPED);
    return 1;
}

/* Limits each call on the socket `s` to the time `until_ns`. */
static inline void tactiled_limit_socket(int s, uint64_t until_ns) {
    const uint64_t now_ns = tactiled_now_ns(), left_us = until_ns > now_ns ? (until_ns - now_ns) / 1000u : 0;
    struct timeval limit;
    limit.tv_sec = (time_t)(left_us / 1000000u);
    limit.tv_usec = (suseconds_t)(left_us % 1000000u + (left_us == 0)); /* 0 would mean no limit */
    /* also limits connect(): the queue of a hung daemon is full */
    setsockopt(s, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
}

/* Asks the control socket for a descriptor: "wake" gives the page of struct tactiled_wake; "events" gives a
 * descriptor that epoll can watch as long as *connection is open. The descriptor does not block. Each read() of 8
 * bytes gives a uint64_t, the number of node records that were published since the last read(), as an eventfd
 * does, but read until EAGAIN. The first number may be too large by one. A read() of 0 bytes means that the
 * daemon has ended. Returns the descriptor, or -1 if there was none before `until_ns`. */
static inline int tactiled_ask_descriptor(const struct tactiled_segment* segment, const char* what, int* connection,
                                          uint64_t until_ns) {
    const struct tactiled_header* h = tactiled_header_of(segment);
    struct sockaddr_un address;
    struct msghdr message;
    struct iovec part;
    struct cmsghdr* extra;
    union {
        struct cmsghdr align;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control;
    char text[64 + TACTILED_NAME_SIZE];
    int fd = -1;
    const int s = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    snprintf(address.sun_path, sizeof address.sun_path, "%.*s", (int)sizeof h->control - 1, h->control);
    snprintf(text, sizeof text, "%s %s", h->name, what);
    tactiled_limit_socket(s, until_ns);
    memset(&message, 0, sizeof message);
    memset(&control, 0, sizeof control);
    if (h->control[0] != 0 && s >= 0 && connect(s, (const struct sockaddr*)&address, sizeof address) == 0 &&
        send(s, text, strlen(text), MSG_NOSIGNAL) > 0) {
        part.iov_base = text;
        part.iov_len = sizeof text;
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = &control;
        message.msg_controllen = sizeof control;
        tactiled_limit_socket(s, until_ns);
        if (recvmsg(s, &message, MSG_CMSG_CLOEXEC) > 0 && (extra = CMSG_FIRSTHDR(&message)) != NULL &&
            extra->cmsg_level == SOL_SOCKET && extra->cmsg_type == SCM_RIGHTS)
            memcpy(&fd, CMSG_DATA(extra), sizeof fd);
    }
    if (connection != NULL && fd >= 0)
        *connection = s;
    else if (s >= 0)
        close(s);
    return fd;
}

/* Returns 1 if a descriptor from the control socket is a page that cannot shrink while it is mapped. */
static inline int tactiled_is_wake_page(int fd) {
    enum { kGetSeals = 1024 + 10, kSealShrink = 2 }; /* F_GET_SEALS and F_SEAL_SHRINK, which need _GNU_SOURCE */
    struct stat status;
    const int seals = fcntl(fd, kGetSeals);
    return seals >= 0 && (seals & kSealShrink) != 0 && fstat(fd, &status) == 0 && status.st_size > 0;
}

/* ---- One sensor of one node, across restarts of the daemon ------------------------------------------------------------ */

enum tactiled_wait {
    TACTILED_POLL = 0,    /* spins: lowest latency, uses a whole CPU */
    TACTILED_PREDICT = 1, /* sleeps until just before the next sample is due, then spins: as fast, a few percent of a CPU */
    TACTILED_BLOCK = 2    /* sleeps until woken: uses no CPU, adds the latency of a wake-up */
};

/* The times between records, learnt in order to sleep until shortly before the next one. */
struct tactiled_rhythm {
    uint64_t last_ns, period_ns, jitter_ns;
};
/* Learns from a record at `t_ns` that followed the one at last_ns. */
static inline void tactiled_rhythm_learn(struct tactiled_rhythm* rhythm, uint64_t t_ns) {
    const int64_t step_ns = (int64_t)(t_ns - rhythm->last_ns);
    const int64_t off_ns = rhythm->period_ns == 0 ? 0 : step_ns - (int64_t)rhythm->period_ns;
    rhythm->period_ns = rhythm->period_ns == 0 ? (uint64_t)step_ns : (uint64_t)((int64_t)rhythm->period_ns + off_ns / 16);
    rhythm->jitter_ns += (uint64_t)(off_ns < 0 ? -off_ns : off_ns) / 16 - rhythm->jitter_ns / 16;
    rhythm->last_ns = t_ns;
}
/* Returns how long before the next record a reader must wake: the duration of a wake-up plus the variation of the
 * period. */
static inline uint64_t tactiled_rhythm_early_ns(const struct tactiled_rhythm* rhythm) {
    const uint64_t early_ns = 40000 + 2 * rhythm->jitter_ns;
    return early_ns < 500000 ? early_ns : 500000;
}
/* Returns the time until which to sleep. The time is later than `now_ns`, by a short nap where the next record is
 * overdue or the period is unknown. */
static inline uint64_t tactiled_rhythm_wake_ns(const struct tactiled_rhythm* rhythm, uint64_t now_ns) {
    const uint64_t early_ns = tactiled_rhythm_early_ns(rhythm);
    const uint64_t wake_ns = rhythm->last_ns + rhythm->period_ns - early_ns;
    return rhythm->period_ns <= early_ns || wake_ns <= now_ns ? now_ns + 200000 : wake_ns;
}

struct tactiled_reader {
    char node[TACTILED_NAME_SIZE], sensor[TACTILED_NAME_SIZE];
    struct tactiled_segment segment;
    int index; /* index of the sensor in the segment, -1 = not attached */
    struct tactiled_cursor cursor;
    struct tactiled_sample last; /* the last result of next() */
    int begun;                   /* 1: `last` has a sample */
    int placed;                  /* 1: the cursor is valid; 0: the next call begins with the newest sample */
    /* 1: latest() has left a daemon whose end next() has not returned yet; `placed` is then 0 */
    int owed;
    int broken;                    /* 1: the last result was the end of a daemon */
    uint32_t empty;                /* calls without a result since the last sample */
    uint64_t tried_ns;             /* time of the last attempt to attach */
    struct tactiled_rhythm rhythm; /* learnt from published records, for TACTILED_PREDICT */
    uint32_t* wake;                /* struct tactiled_wake, for TACTILED_BLOCK; NULL = not requested or not available */
    uint64_t asked_ns;             /* time of the request for `wake`, 0 = never */
};

static inline void tactiled_reader_detach(struct tactiled_reader* r) {
    tactiled_close(&r->segment);
    if (r->wake != NULL) munmap(r->wake, sizeof(struct tactiled_wake));
    r->wake = NULL;
    r->asked_ns = 0;
    r->index = -1;
}

/* Tries to attach; segment.why has the reason if that fails. After a restart the reader begins with the first
 * record of the new daemon. */
static inline int tactiled_reader_attach(struct tactiled_reader* r, uint64_t now_ns) {
    struct tactiled_segment fresh;
    int index;
    if (r->node[0] == 0) return 0; /* init() has refused the names */
    r->tried_ns = now_ns;
    /* the first folder that has the segment remains the only one */
    if (!tactiled_open_in(&fresh, r->segment.folder, r->node)) {
        memcpy(r->segment.why, fresh.why, sizeof fresh.why);
        return 0;
    }
    index = tactiled_find(&fresh, r->sensor);
    if (index < 0 || !tactiled_is_current(&fresh)) {
        if (index < 0)
            tactiled_no_sensor(&fresh, r->node, r->sensor, r->segment.why, sizeof r->segment.why);
        else
            snprintf(r->segment.why, sizeof r->segment.why, "node \"%s\" has stopped", r->node);
        tactiled_close(&fresh);
        return 0;
    }
    if (r->index >= 0 && tactiled_header_of(&fresh)->epoch == tactiled_header_of(&r->segment)->epoch) {
        tactiled_close(&fresh); /* the same segment as before */
        return tactiled_is_current(&r->segment);
    }
    if (r->index >= 0 && r->begun) { /* next() has read everything before it comes here; latest() may leave records unread */
        const struct tactiled_ring* old = &r->segment.ring[r->index];
        const uint32_t left = tactiled_ring_head(r->segment.base, old) - r->cursor.next;
        if ((int32_t)left > 0)
            r->cursor.lost += left; /* may be ahead of the head: published last, and 0 in a truncated file */
        r->owed = (r->last.reasons & TACTILED_DAEMON_STOPPED) == 0;
    }
    tactiled_reader_detach(r);
    r->segment = fresh;
    r->index = index;
    r->broken = 0;
    r->placed = (r->begun || r->placed) && !r->owed;
    if (r->begun)
        r->cursor.next = 0; /* the ring counts records that are already overwritten */
    else
        tactiled_ring_seek(fresh.base, &fresh.ring[index], &r->cursor, 1);
    return 1;
}

/* Attaches at once if possible; otherwise the other functions keep trying until the daemon exists. An invalid
 * name is refused permanently, with the reason in segment.why. `folder` is as for tactiled_open_in(). */
static inline void tactiled_reader_init_in(struct tactiled_reader* r, const char* folder, const char* node_name,
                                           const char* sensor_name) {
    memset(r, 0, sizeof *r);
    r->index = -1;
    if (!tactiled_check_name(&r->segment, "node", node_name) || !tactiled_check_name(&r->segment, "sensor", sensor_name))
        return;
    if (folder != NULL && strlen(folder) >= sizeof r->segment.folder) {
        snprintf(r->segment.why, sizeof r->segment.why, "folder \"%.100s...\": the path is too long", folder);
        return;
    }
    if (folder != NULL) memcpy(r->segment.folder, folder, strlen(folder) + 1);
    memcpy(r->node, node_name, strlen(node_name));
    memcpy(r->sensor, sensor_name, strlen(sensor_name));
    tactiled_reader_attach(r, tactiled_now_ns());
}
static inline void tactiled_reader_init(struct tactiled_reader* r, const char* node_name, const char* sensor_name) {
    tactiled_reader_init_in(r, NULL, node_name, sensor_name);
}

/* Restarts at the oldest sample that is kept. */
static inline void tactiled_reader_rewind(struct tactiled_reader* r) {
    if (r->index < 0) return;
    tactiled_ring_seek(r->segment.base, &r->segment.ring[r->index], &r->cursor, 1);
    r->placed = !r->owed;
}

/* Returns 1 if the segment may be read. Tries to attach if necessary, at most each 10 ms. */
static inline int tactiled_reader_ready(struct tactiled_reader* r) {
    uint64_t now_ns;
    if (r->index >= 0 && !r->broken && tactiled_is_current(&r->segment)) return 1;
    now_ns = tactiled_now_ns();
    if (now_ns - r->tried_ns >= 10000000u) tactiled_reader_attach(r, now_ns);
    return r->index >= 0 && tactiled_is_current(&r->segment);
}

/* Copies the newest sample, which is BAD with a reason if there is no valid one. Never blocks. If this function
 * attaches to the next daemon before next() does, next() still returns the end of the old one, and the samples
 * that it had not returned count as lost. */
static inline void tactiled_reader_latest(struct tactiled_reader* r, struct tactiled_sample* sample) {
    uint64_t now_ns;
    if (tactiled_reader_ready(r)) {
        tactiled_latest(&r->segment, (uint32_t)r->index, sample, 0);
        if (sample->quality != TACTILED_BAD) return;
        now_ns = tactiled_now_ns(); /* the daemon may be dead and its file removed, or a successor may exist */
        if (now_ns - r->tried_ns >= 10000000u) tactiled_reader_attach(r, now_ns);
        return;
    }
    memset(sample, 0, sizeof *sample);
    tactiled_invalidate(sample, TACTILED_DAEMON_STOPPED);
}

/* Returns the BAD sample that marks the end of a daemon. */
static inline int tactiled_reader_end(struct tactiled_reader* r, struct tactiled_sample* sample) {
    *sample = r->last;
    tactiled_invalidate(sample, TACTILED_DAEMON_STOPPED);
    r->last = *sample; /* one for this end, also if the successor has published nothing yet */
    r->owed = 0;
    r->placed = 1;
    return 1;
}

/* Checks, when there is no new sample, whether the daemon has ended or died. If it has, gives one BAD sample with
 * the reason and returns 1. */
static inline int tactiled_reader_look(struct tactiled_reader* r, struct tactiled_sample* sample) {
    const struct tactiled_ring* ring;
    uint32_t number, behind;
    int disconnected = r->index < 0;
    if (!disconnected) {
        ring = &r->segment.ring[r->index];
        number = r->cursor.next;
        behind = tactiled_ring_head(r->segment.base, ring) - number;
        /* The reader slept for 2^30 records or more, or next is one ahead of the head, which is published last. */
        if (behind > ring->slots && (int32_t)behind > 0) {
            tactiled_ring_seek(r->segment.base, ring, &r->cursor, 1);
            r->cursor.lost += r->cursor.next - number;
        }
        disconnected = !tactiled_is_current(&r->segment) || !tactiled_is_beating(&r->segment, 0);
    }
    if (!disconnected) {
        r->broken = 0; /* the daemon hung and has recovered */
        return 0;
    }
    if (r->broken) return 0;
    r->broken = 1;
    /* the daemon's last sample says so already */
    if (!r->begun || (r->last.reasons & TACTILED_DAEMON_STOPPED) != 0) return 0;
    return tactiled_reader_end(r, sample);
}

/* Gives the sample after the last one that it gave, or returns 0 if there is none yet. The first call gives the
 * newest sample. When the daemon ends, hangs or dies, next() gives the samples that are left in the ring, then
 * one BAD sample, then the samples of the successor. */
static inline int tactiled_reader_next(struct tactiled_reader* r, struct tactiled_sample* sample) {
    if (r->index >= 0) {
        const struct tactiled_ring* ring = &r->segment.ring[r->index];
        if (!r->placed) {
            if (r->owed) return tactiled_reader_end(r, sample);
            tactiled_ring_seek(r->segment.base, ring, &r->cursor, 0);
        }
        if (tactiled_ring_next(r->segment.base, ring, &r->cursor, sample, sizeof *sample)) {
            const uint64_t now_ns = tactiled_now_ns();
            tactiled_judge(sample, r->segment.stale_ms[r->index], now_ns);
            if (r->begun && sample->epoch == r->last.epoch && sample->sequence == r->last.sequence + 1)
                tactiled_rhythm_learn(&r->rhythm, sample->t_published_ns);
            r->rhythm.last_ns = sample->t_published_ns;
            if (!tactiled_is_alive(&r->segment, sample->t_published_ns, now_ns) ||
                !tactiled_is_whole(r->segment.base, r->segment.size, r->segment.entry))
                tactiled_invalidate(sample, TACTILED_STALE); /* the stop is reported after the samples that are left */
            r->last = *sample;
            r->begun = r->placed = 1;
            r->empty = 0;
            r->broken = 0;
            return 1;
        }
        /* only in each 16th call, because it reads the clock */
        if (++r->empty % 16 != 0 && tactiled_is_current(&r->segment)) return 0;
    }
    if (tactiled_reader_look(r, sample)) return 1;
    if (r->index < 0 || r->broken) tactiled_reader_ready(r);
    return 0;
}

static inline void tactiled_sleep_until(uint64_t until_ns) {
    struct timespec t;
    t.tv_sec = (time_t)(until_ns / 1000000000u);
    t.tv_nsec = (long)(until_ns % 1000000000u);
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
}

/* The time structure of the system call, which differs from timespec in a 32-bit program with _TIME_BITS=64. The
 * time is relative, so this call works beyond 2038. It exists on kernels before 5.1, too. */
#ifdef SYS_futex
#define TACTILED_SYS_FUTEX SYS_futex
typedef __kernel_long_t tactiled_futex_word;
#else /* a 32-bit architecture that never had 32-bit times */
#define TACTILED_SYS_FUTEX SYS_futex_time64
typedef int64_t tactiled_futex_word;
#endif
struct tactiled_futex_limit {
    tactiled_futex_word s, ns;
};

/* Sleeps until more than `seen` node records are published or `until_ns` is reached. Requests the wake-up in
 * `wake`. */
static inline void tactiled_sleep_on_node(const struct tactiled_segment* segment, uint32_t* wake, uint32_t seen,
                                          uint64_t now_ns, uint64_t until_ns) {
    const uint32_t* head = (const uint32_t*)(const void*)(segment->base + segment->node.head_offset);
    struct tactiled_wake* page = (struct tactiled_wake*)(void*)wake;
    const uint32_t wanted = __atomic_load_n(&page->wanted_until, __ATOMIC_RELAXED) - seen;
    const uint32_t ordered = __atomic_load_n(&page->ordered_until, __ATOMIC_RELAXED) - seen;
    struct tactiled_futex_limit limit;
    /* The request ends soon, or is one that the daemon ignores, or is one of another reader that the daemon may
     * not have seen yet. */
    if (wanted < TACTILED_WAKE_RECORDS / 2 || wanted > TACTILED_WAKE_RECORDS || ordered < TACTILED_WAKE_RECORDS / 2 ||
        ordered > TACTILED_WAKE_RECORDS) {
        __atomic_store_n(&page->wanted_until, seen + TACTILED_WAKE_RECORDS, __ATOMIC_RELAXED);
        /* The request must be visible before the head is read, also to the daemon, which executes no fence. If
         * the kernel refuses the call, one wake-up may be missed; the next record causes another one. */
        syscall(SYS_membarrier, MEMBARRIER_CMD_GLOBAL_EXPEDITED, 0, 0);
        __atomic_store_n(&page->ordered_until, seen + TACTILED_WAKE_RECORDS, __ATOMIC_RELAXED);
    }
    limit.s = (tactiled_futex_word)((until_ns - now_ns) / 1000000000u);
    limit.ns = (tactiled_futex_word)((until_ns - now_ns) % 1000000000u);
    syscall(TACTILED_SYS_FUTEX, head, FUTEX_WAIT, seen, &limit, NULL, 0);
}

/* Sleeps until the next node record or until `until_ns`. Without a wake page (no control socket, or a daemon that
 * does not answer; the request is repeated each second) the function sleeps for 1 ms at a time. */
static inline void tactiled_reader_block(struct tactiled_reader* r, uint64_t now_ns, uint64_t until_ns) {
    const struct tactiled_ring *node, *ring;
    uint32_t seen;
    if (until_ns > now_ns + 20000000u) until_ns = now_ns + 20000000u; /* a daemon that dies wakes no reader */
    if (r->wake == NULL && r->index >= 0 && !r->broken && (r->asked_ns == 0 || now_ns - r->asked_ns >= 1000000000u)) {
        const int fd = tactiled_ask_descriptor(&r->segment, "wake", NULL, until_ns);
        void* page = fd < 0 || !tactiled_is_wake_page(fd)
                         ? MAP_FAILED
                         : mmap(NULL, sizeof(struct tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        if (page != MAP_FAILED) r->wake = (uint32_t*)page;
        if (fd >= 0) close(fd);
        r->asked_ns = now_ns;
        return; /* the request took long */
    }
    if (r->wake == NULL || r->broken) {
        tactiled_sleep_until(now_ns + 1000000u < until_ns ? now_ns + 1000000u : until_ns);
        return;
    }
    node = &r->segment.node;
    ring = &r->segment.ring[r->index];
    seen = tactiled_ring_head(r->segment.base, node); /* read before the sensor's ring, whose sample is published first */
    if (tactiled_ring_head(r->segment.base, ring) == r->cursor.next)
        tactiled_sleep_on_node(&r->segment, r->wake, seen, now_ns, until_ns);
}

/* Does the same as tactiled_reader_next(), but waits for up to `timeout_ms`. Returns 0 on timeout. */
static inline int tactiled_reader_wait(struct tactiled_reader* r, struct tactiled_sample* sample, uint32_t timeout_ms,
                                       enum tactiled_wait mode) {
    uint64_t now_ns, until_ns = 0, spin_until_ns = 0;
    uint32_t i;
    if (tactiled_reader_next(r, sample)) return 1;
    until_ns = tactiled_now_ns() + (uint64_t)timeout_ms * 1000000u;
    for (;;) {
        now_ns = tactiled_now_ns();
        if (now_ns >= until_ns) return 0;
        if (mode == TACTILED_BLOCK) {
            tactiled_reader_block(r, now_ns, until_ns);
            r->empty |= 15; /* makes the next call check the daemon, too */
        } else if (mode == TACTILED_PREDICT && now_ns >= spin_until_ns) {
            const int known = r->begun && !r->broken;
            uint64_t wake_ns = known ? tactiled_rhythm_wake_ns(&r->rhythm, now_ns) : now_ns + 1000000;
            if (wake_ns > until_ns) wake_ns = until_ns;
            tactiled_sleep_until(wake_ns);
            spin_until_ns = known ? wake_ns + 3 * tactiled_rhythm_early_ns(&r->rhythm) : 0;
            r->empty |= 15;
        }
        for (i = 0; i < 64; ++i)
            if (tactiled_reader_next(r, sample)) return 1;
    }
}

#ifdef __cplusplus
}
#endif
#endif
