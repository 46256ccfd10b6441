// Include this file first, and the product's headers and sources after it: their atomic operations, futexes, membarriers and
// naps are then those of the explorer. The product's text is unchanged. Standard headers come before the macros.
#pragma once
#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <limits.h>
#include <linux/futex.h>
#include <linux/membarrier.h>
#include <signal.h>
#include <sys/auxv.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cassert>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <source_location>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "explorer.hpp"

namespace orders {

using Here = std::source_location;

template <class T>
std::uint64_t bits_of(const T& value) noexcept {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= 8);
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof value);
    return bits;
}
template <class T>
T from_bits(std::uint64_t bits) noexcept {
    T value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

// In place of std::atomic: of its size, without the conversions that name no order.
template <class T>
class Atomic {
public:
    Atomic(T value = {}) noexcept : value_(value) {}
    Atomic(const Atomic&) = delete;
    Atomic& operator=(const Atomic&) = delete;

    T load(std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) const noexcept {
        return from_bits<T>(explorer().load(const_cast<T*>(&value_), sizeof(T), order_at(at, Use::load, order), true));
    }
    void store(T value, std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) noexcept {
        explorer().store(&value_, sizeof(T), bits_of(value), order_at(at, Use::store, order), true);
    }
    T exchange(T value, std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) noexcept {
        return change(order, at, [value](T) { return value; });
    }
    T fetch_add(T value, std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) noexcept {
        return change(order, at, [value](T old) { return T(old + value); });
    }
    T fetch_sub(T value, std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) noexcept {
        return change(order, at, [value](T old) { return T(old - value); });
    }
    T fetch_or(T value, std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) noexcept {
        return change(order, at, [value](T old) { return T(old | value); });
    }
    T fetch_and(T value, std::memory_order order = std::memory_order_seq_cst, Here at = Here::current()) noexcept {
        return change(order, at, [value](T old) { return T(old & value); });
    }
    bool compare_exchange_strong(T& expected, T desired, std::memory_order success, std::memory_order failure,
                                 Here at = Here::current()) noexcept {
        const std::uint64_t wanted = bits_of(expected);
        const std::uint64_t old =
            explorer().modify(&value_, sizeof(T), order_at(at, Use::modify, success), order_at(at, Use::load, failure, 1),
                              [wanted, desired](std::uint64_t found, std::uint64_t& value) {
                                  value = bits_of(desired);
                                  return found == wanted;
                              });
        expected = from_bits<T>(old);
        return old == wanted;
    }
    // Never fails spuriously here.
    bool compare_exchange_weak(T& expected, T desired, std::memory_order success, std::memory_order failure,
                               Here at = Here::current()) noexcept {
        return compare_exchange_strong(expected, desired, success, failure, at);
    }

private:
    template <class F>
    T change(std::memory_order order, const Here& at, F next) noexcept {
        order = order_at(at, Use::modify, order);
        return from_bits<T>(
            explorer().modify(&value_, sizeof(T), order, order, [next](std::uint64_t old, std::uint64_t& value) {
                value = bits_of(next(from_bits<T>(old)));
                return true;
            }));
    }
    T value_;
};

// In place of the compiler's functions on plain words. A word that these are used on outlives the scenario.
template <class T>
T load_word(const T* address, int order, Here at = Here::current()) noexcept {
    return from_bits<T>(
        explorer().load(const_cast<T*>(address), sizeof(T), order_at(at, Use::load, std::memory_order(order)), false));
}
template <class T, class V>
void store_word(T* address, V value, int order, Here at = Here::current()) noexcept {
    explorer().store(address, sizeof(T), bits_of(T(value)), order_at(at, Use::store, std::memory_order(order)), false);
}
// Only before and after the threads of a scenario.
template <class T, class V>
T exchange_word(T* address, V value, int /*order*/) noexcept {
    if (explorer().thread() >= 0) explorer().fail("an operation that the explorer does not know");
    return std::exchange(*address, T(value));
}
template <class T, class V>
bool compare_exchange_word(T* address, T* expected, V value, bool /*weak*/, int /*success*/, int /*failure*/) noexcept {
    if (explorer().thread() >= 0) explorer().fail("an operation that the explorer does not know");
    const bool same = *address == *expected;
    (same ? *address : *expected) = same ? T(value) : *address;
    return same;
}
inline void fence(std::memory_order order, Here at = Here::current()) noexcept {
    explorer().fence(order_at(at, Use::fence, order));
}

inline long numeric(const void* value) noexcept { return long(std::uintptr_t(value)); }
inline long numeric(long value) noexcept { return value; }

// futex(word, operation, value) and membarrier(command); others are not made while threads run.
template <class... A>
long system_call(const Here& at, long number, A... arguments) noexcept {
    const std::array<long, 8> a{numeric(arguments)...};
    if (explorer().thread() < 0) return number == SYS_futex ? a[2] : 0;  // the call "wakes" the number that it asks for
    const auto is_left_out = [&at] {
        return order_at(at, Use::call, std::memory_order_seq_cst) != std::memory_order_seq_cst;
    };
    if (number == SYS_membarrier) {
        if (!is_left_out()) explorer().membarrier();
        return 0;
    }
    if (number != SYS_futex) explorer().fail("a system call that the explorer does not know");
    void* const word = reinterpret_cast<void*>(a[0]);
    const long operation = a[1] & FUTEX_CMD_MASK;
    if (operation == FUTEX_WAKE) return is_left_out() ? 0 : explorer().futex_wake(word, int(a[2]));
    if (operation != FUTEX_WAIT && operation != FUTEX_WAIT_BITSET) explorer().fail("a futex operation that is not known");
    if (explorer().futex_wait(word, std::uint32_t(a[2]))) return 0;
    errno = EAGAIN;
    return -1;
}

// The mappings that the product has made, in order.
inline std::vector<void*>& mappings() {
    static std::vector<void*> all;
    return all;
}

}  // namespace orders

namespace std {
template <class T>
using explored_atomic = orders::Atomic<T>;
inline void explored_fence(memory_order order, orders::Here at = orders::Here::current()) noexcept {
    orders::fence(order, at);
}
}  // namespace std
template <class... A>
long explored_call(const orders::Here& at, A... arguments) noexcept {
    return orders::system_call(at, arguments...);
}
inline void* explored_mmap(void* address, std::size_t size, int protection, int flags, int fd, off_t offset) {
    return orders::mappings().emplace_back(::mmap(address, size, protection, flags, fd, offset));
}
inline int explored_nap(clockid_t, int, const timespec*, timespec*) noexcept {
    orders::explorer().nap();
    return 0;
}
inline int explored_clock(clockid_t, timespec* now) noexcept {
    *now = {1000, 0};  // time stands still
    return 0;
}

#define atomic explored_atomic
#define atomic_thread_fence explored_fence
#define __atomic_load_n(address, order) orders::load_word(address, order)
#define __atomic_store_n(address, value, order) orders::store_word(address, value, order)
#define __atomic_thread_fence(order) orders::fence(std::memory_order(order))
#define __atomic_exchange_n orders::exchange_word
#define __atomic_compare_exchange_n orders::compare_exchange_word
// These do not exist in the explored code; a use would escape the explorer.
#define __atomic_fetch_add an_operation_that_the_explorer_does_not_know
#define __atomic_fetch_or an_operation_that_the_explorer_does_not_know
#define atomic_ref an_operation_that_the_explorer_does_not_know
#define atomic_flag an_operation_that_the_explorer_does_not_know
#define syscall(...) explored_call(orders::Here::current(), __VA_ARGS__)
#define mmap explored_mmap
#define clock_nanosleep explored_nap
#define clock_gettime explored_clock
