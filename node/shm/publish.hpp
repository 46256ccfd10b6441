// Publishes one record in a ring of tactiled/layout.h: the writer's counterpart of tactiled_ring_read().
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "tactiled/layout.h"

namespace tactiled {

// Writes record `number` of `size` bytes, a multiple of 8, into `ring` of the segment at `base`. Successive numbers differ
// by 1.
// rt: wait-free
inline void publish_record(char* base, const tactiled_ring& ring, std::uint64_t number, const void* record,
                           std::size_t size) noexcept {
#if defined(__SANITIZE_THREAD__)  // thread sanitizer does not model fences, so the stores have release order
    constexpr int kStore = __ATOMIC_RELEASE;
#else
    constexpr int kStore = __ATOMIC_RELAXED;
#endif
    const auto slot = [&](std::uint64_t n) {
        return base + ring.offset + std::size_t(n & (ring.slots - 1)) * ring.slot_size;
    };
    auto* lock_word = reinterpret_cast<std::uint32_t*>(slot(number));
    auto* words = reinterpret_cast<std::uint64_t*>(slot(number) + TACTILED_RECORD_OFFSET);
    const auto whole = std::uint32_t(2 * number + 2);
    __atomic_store_n(lock_word, whole - 1, __ATOMIC_RELAXED);
    // sets the lock odd before any word is written: pairs with the reader's acquire fence
    __atomic_thread_fence(__ATOMIC_RELEASE);
    const auto write = [words](std::size_t at, const void* from) {
        std::uint64_t word;
        std::memcpy(&word, from, 8);
        __atomic_store_n(words + at, word, kStore);
    };
    for (std::size_t i = size / 8; i-- > 0;)  // writes the lock's cache line last, because readers poll it
        write(i, static_cast<const char*>(record) + 8 * i);
    __atomic_store_n(lock_word, whole, __ATOMIC_RELEASE);  // pairs with the reader's acquire of the lock
    auto* head = reinterpret_cast<std::uint32_t*>(base + ring.head_offset);
    __atomic_store_n(head, std::uint32_t(number + 1), __ATOMIC_RELEASE);
    // Marks the next slot as being written, so that its cache line is fetched before the next publish.
    __atomic_store_n(reinterpret_cast<std::uint32_t*>(slot(number + 1)), std::uint32_t(2 * number + 3), __ATOMIC_RELAXED);
}

}  // namespace tactiled
