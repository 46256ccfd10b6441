// Two doubles side by side, in one register of any x86-64 and any AArch64. Each rounds as a lone double does, so results are
// those of a for loop to the last bit. For the loops over channels that the compiler does not vectorise by itself: those
// with comparisons, and those whose sums it would keep in memory.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace tactiled {

using Pair = double __attribute__((vector_size(16)));
using PairMask = std::int64_t __attribute__((vector_size(16)));  // -1 where true, else 0

inline constexpr std::int64_t kAllButSign = 0x7fff'ffff'ffff'ffff;

inline Pair load(const double* from) noexcept {
    Pair pair;
    std::memcpy(&pair, from, sizeof pair);
    return pair;
}
inline PairMask load(const std::int64_t* from) noexcept {
    PairMask pair;
    std::memcpy(&pair, from, sizeof pair);
    return pair;
}
inline void store(double* to, Pair pair) noexcept { std::memcpy(to, &pair, sizeof pair); }
inline Pair both(double value) noexcept { return Pair{value, value}; }
inline Pair root(Pair pair) noexcept { return Pair{std::sqrt(pair[0]), std::sqrt(pair[1])}; }
inline constexpr PairMask kTrue{-1, -1};
// Comparisons; false for a NaN. By their own names on x86: g++ 12 takes masks that it joins apart into lone numbers.
#ifdef __SSE2__
inline PairMask up_to(Pair value, Pair max) noexcept { return PairMask(_mm_cmple_pd(value, max)); }
inline PairMask both_true(PairMask a, PairMask b) noexcept { return PairMask(_mm_and_pd(Pair(a), Pair(b))); }
inline bool hold(PairMask mask) noexcept { return _mm_movemask_pd(Pair(mask)) == 3; }
#else
inline PairMask up_to(Pair value, Pair max) noexcept { return value <= max; }
inline PairMask both_true(PairMask a, PairMask b) noexcept { return a & b; }
inline bool hold(PairMask mask) noexcept { return (mask[0] & mask[1]) != 0; }
#endif
inline PairMask between(Pair min, Pair value, Pair max) noexcept { return both_true(up_to(min, value), up_to(value, max)); }
inline Pair magnitude(Pair pair) noexcept { return Pair(PairMask(pair) & PairMask{kAllButSign, kAllButSign}); }
// 0 where the mask is not set.
inline Pair only(Pair pair, PairMask mask) noexcept { return Pair(PairMask(pair) & mask); }
// NaN where `nan` is one and not 0.
inline Pair with(Pair pair, Pair nan) noexcept { return Pair(PairMask(pair) | PairMask(nan)); }

}  // namespace tactiled
