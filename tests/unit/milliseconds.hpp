// Times of tests, in ns.
#pragma once
#include <cstdint>

namespace tactiled {

inline constexpr std::uint64_t kMs = 1'000'000;

}  // namespace tactiled
