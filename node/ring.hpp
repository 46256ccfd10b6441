// The ring between a link's thread (producer) and the pipeline's (consumer): single producer, single consumer,
// lock-free. Items are filled and read in place.
//
// Each side works on its own position and reads the other side's published index only if its copy of this index indicates a
// full or empty ring. Indices are published once per burst, so that a burst of frames costs one cache-line transfer and not
// one per frame. tests/bench/ring_bench.cpp compares it with boost::lockfree, moodycamel and DPDK.
#pragma once
#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>

namespace tactiled {

inline constexpr std::size_t kCacheLine = 128;  // two lines, because the adjacent-line prefetcher fetches pairs

template <class T>
class Ring {
public:
    // `capacity` is a power of two. setup
    explicit Ring(std::size_t capacity) : mask_(capacity - 1), items_(new (std::align_val_t{kCacheLine}) T[capacity]{}) {
        assert(capacity != 0 && (capacity & mask_) == 0);
    }

    // Returns the next free item to fill, or nullptr if the ring is full; the caller then refuses and counts the newest
    // item.
    // rt: wait-free
    [[nodiscard]] T* claim() noexcept {
        if (produced_ - seen_tail_ > mask_) {
            commit();  // the consumer cannot remove items that were not committed
            // pairs with release(): the consumer has finished reading the item
            seen_tail_ = tail_.load(std::memory_order_acquire);
            if (produced_ - seen_tail_ > mask_) return nullptr;
        }
        return &items_[produced_ & mask_];
    }
    // Adds the claimed item; the consumer sees it at the next commit(). rt: wait-free
    void push() noexcept { ++produced_; }
    // Publishes all pushed items to the consumer. rt: wait-free
    void commit() noexcept {
        if (committed_ == produced_) return;
        committed_ = produced_;
        head_.store(produced_, std::memory_order_release);  // pairs with front(): the items are filled
    }

    // Returns the oldest item, or nullptr if there is none. rt: wait-free
    [[nodiscard]] const T* front() noexcept {
        if (consumed_ == seen_head_) {
            release();
            seen_head_ = head_.load(std::memory_order_acquire);
            if (consumed_ == seen_head_) return nullptr;
        }
        return &items_[consumed_ & mask_];
    }
    // Removes the oldest item. Room is returned to the producer every kReleaseEvery items, and whenever front() finds
    // the ring empty.
    // rt: wait-free
    void pop() noexcept {
        if (++consumed_ - released_ >= kReleaseEvery) release();
    }

    [[nodiscard]] std::size_t capacity() const noexcept { return mask_ + 1; }
    // Returns the slot of an item of this ring, 0 .. capacity() - 1: what travels with the item has its place there.
    [[nodiscard]] std::size_t slot_of(const T* item) const noexcept { return std::size_t(item - items_.get()); }

private:
    static constexpr std::uint64_t kReleaseEvery = 16;

    void release() noexcept {
        if (released_ == consumed_) return;
        released_ = consumed_;
        tail_.store(consumed_, std::memory_order_release);
    }

    const std::uint64_t mask_;
    struct AlignedDelete {
        void operator()(T* items) const noexcept { ::operator delete[](items, std::align_val_t{kCacheLine}); }
    };
    static_assert(std::is_trivially_destructible_v<T>);
    const std::unique_ptr<T[], AlignedDelete> items_;         // aligned, so that an item of two lines does not occupy three
    alignas(kCacheLine) std::atomic<std::uint64_t> head_{0};  // items the consumer may read; 64 bits never wrap
    alignas(kCacheLine) std::atomic<std::uint64_t> tail_{0};  // items the producer may overwrite
    alignas(kCacheLine) std::uint64_t produced_ = 0;          // used by the producer only
    std::uint64_t committed_ = 0, seen_tail_ = 0;
    alignas(kCacheLine) std::uint64_t consumed_ = 0;  // used by the consumer only
    std::uint64_t released_ = 0, seen_head_ = 0;
};

}  // namespace tactiled
