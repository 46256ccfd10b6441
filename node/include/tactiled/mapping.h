/* Maps a file so that its reader survives when the file is truncated. Used by reader.h.
 *
 * The kernel sends SIGBUS to a process that reads a mapped page beyond the end of its file. No check before a
 * read prevents that, because the file can become shorter in between. The first mapping therefore installs a
 * handler of SIGBUS, which replaces the missing pages by zeros and marks the mapping as cut. The interrupted read
 * continues and finds zeros, which are never a finished record. A signal that concerns no mapping of a segment is
 * passed on to the handler that was installed before.
 *
 * A program that installs its own handler of SIGBUS does so before it opens a segment. A program that must not
 * have this handler defines TACTILED_NO_SIGBUS_HANDLER before it includes this file: then a truncated segment
 * ends it. */
#ifndef TACTILED_MAPPING_H
#define TACTILED_MAPPING_H

#include <errno.h>
#include <signal.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "layout.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One mapping of the process. `base` is 0 where the entry is free, 1 while it is being filled. */
struct tactiled_mapping {
    uintptr_t base;
    size_t size;  /* a multiple of the page size */
    uint32_t cut; /* 1: the file is shorter than when it was mapped */
};
#define TACTILED_MAX_MAPPINGS 128 /* per process; further mappings are not protected */

/* One object for all source files of a program that include this header. */
struct tactiled_mappings {
    struct tactiled_mapping mapping[TACTILED_MAX_MAPPINGS];
    uint32_t installed;
    struct sigaction before;
};
__attribute__((weak)) struct tactiled_mappings tactiled_mappings;

static inline size_t tactiled_page_size(void) { return (size_t)sysconf(_SC_PAGESIZE); }

/* Handles SIGBUS. The function is async-signal-safe. */
static inline void tactiled_on_sigbus(int number, siginfo_t* info, void* context) {
    const uintptr_t address = (uintptr_t)info->si_addr;
    const struct sigaction* const before = &tactiled_mappings.before;
    const int error = errno;
    int i;
    for (i = 0; i < TACTILED_MAX_MAPPINGS && info->si_code > 0; ++i) {
        struct tactiled_mapping* const m = &tactiled_mappings.mapping[i];
        const uintptr_t base = __atomic_load_n(&m->base, __ATOMIC_ACQUIRE);
        const uintptr_t page = address & ~(uintptr_t)(tactiled_page_size() - 1);
        if (base <= 1 || address - base >= m->size) continue;
        __atomic_store_n(&m->cut, 1, __ATOMIC_RELAXED);
        if (mmap((void*)page, base + m->size - page, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) ==
            MAP_FAILED)
            break;
        errno = error;
        return;
    }
    errno = error;
    if ((before->sa_flags & SA_SIGINFO) != 0) {
        before->sa_sigaction(number, info, context);
    } else if (before->sa_handler != SIG_DFL && before->sa_handler != SIG_IGN) {
        before->sa_handler(number);
    } else { /* ends the process, as without this handler; the signal is delivered after this function returns */
        signal(number, SIG_DFL);
        raise(number);
    }
}

static inline void tactiled_install_sigbus(void) {
#ifndef TACTILED_NO_SIGBUS_HANDLER
    struct sigaction ours;
    if (__atomic_exchange_n(&tactiled_mappings.installed, 1, __ATOMIC_ACQ_REL) != 0) return;
    memset(&ours, 0, sizeof ours);
    ours.sa_sigaction = tactiled_on_sigbus;
    ours.sa_flags = SA_SIGINFO | SA_RESTART;
    sigaction(SIGBUS, NULL, &tactiled_mappings.before);
    sigaction(SIGBUS, &ours, NULL);
#endif
}

/* Maps `size` bytes of a file for reading. Returns NULL with errno set on failure. `*entry` is where the mapping
 * is registered, NULL if there was no room. */
static inline const char* tactiled_map(int fd, size_t size, struct tactiled_mapping** entry) {
    const size_t page = tactiled_page_size();
    int i;
    void* const base = mmap(NULL, size, PROT_READ, MAP_SHARED | MAP_POPULATE, fd, 0);
    *entry = NULL;
    if (base == MAP_FAILED) return NULL;
    tactiled_install_sigbus();
    for (i = 0; i < TACTILED_MAX_MAPPINGS && *entry == NULL; ++i) {
        struct tactiled_mapping* const m = &tactiled_mappings.mapping[i];
        uintptr_t none = 0;
        if (!__atomic_compare_exchange_n(&m->base, &none, 1, 0, __ATOMIC_ACQ_REL, __ATOMIC_RELAXED)) continue;
        m->size = (size + page - 1) / page * page;
        m->cut = 0;
        __atomic_store_n(&m->base, (uintptr_t)base, __ATOMIC_RELEASE);
        *entry = m;
    }
    return (const char*)base;
}

static inline void tactiled_unmap(const char* base, size_t size, struct tactiled_mapping* entry) {
    if (entry != NULL) __atomic_store_n(&entry->base, 0, __ATOMIC_RELEASE);
    munmap((void*)(uintptr_t)base, size);
}

/* Returns 0 if the file is known to be shorter than the mapping. The access to the last byte faults if its page
 * is missing. A record that was copied before this call is whole if the call returns 1, because the kernel
 * removes the missing pages before it clears the rest of the last one. A segment with a link ends with frames, so
 * a file that lost less than a page has not lost a sample. */
static inline int tactiled_is_whole(const char* base, size_t size, const struct tactiled_mapping* entry) {
    TACTILED_READ_FENCE();
    (void)__atomic_load_n(base + size - 1, __ATOMIC_ACQUIRE);
    return entry == NULL || __atomic_load_n(&entry->cut, __ATOMIC_RELAXED) == 0;
}

#ifdef __cplusplus
}
#endif
#endif
