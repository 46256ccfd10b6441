// Two doubles side by side, in one register of any x86-64 and any AArch64. Each rounds as a lone double does, so results are
// those of a for loop to the last bit. For the loops over channels that the compiler does not vectorise by itself: those
// with comparisons.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>

namespace tactiled {

using Pair = double __attribute__((vector_size(16)));
using PairMask = std::int64_t __attribute__((vector_size(16)));  // -1 where true, else 0

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
// 0 where the mask is not set.
inline Pair only(Pair pair, PairMask mask) noexcept { return Pair(PairMask(pair) & mask); }
// NaN where `nan` is one and not 0.
inline Pair with(Pair pair, Pair nan) noexcept { return Pair(PairMask(pair) | PairMask(nan)); }

}  // namespace tactiled
