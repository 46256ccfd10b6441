// Random numbers that depend only on their place: stream, sample, channel. Leaving out an effect, another block size
// or another order of sensors does not change any other number.
#pragma once
#include <cmath>
#include <cstdint>
#include <string_view>

namespace tactiled::sim {

// Steele, Lea, Flood 2014, the finaliser of SplitMix64: a bijection of 64 bits without a visible pattern.
constexpr std::uint64_t mixed(std::uint64_t x) noexcept {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

class Stream {
public:
    constexpr Stream(std::uint64_t seed, std::string_view name) noexcept : key_(mixed(seed)) {
        for (const char c : name) key_ = mixed(key_ ^ std::uint64_t(static_cast<unsigned char>(c)));
    }
    [[nodiscard]] constexpr std::uint64_t bits(std::uint64_t sample, std::uint64_t lane = 0) const noexcept {
        return mixed(key_ ^ mixed(sample * 64 + lane));
    }
    // 0 <= u < 1. rt: wait-free
    [[nodiscard]] constexpr double uniform(std::uint64_t sample, std::uint64_t lane = 0) const noexcept {
        return double(bits(sample, lane) >> 11) * 0x1p-53;
    }
    // Mean 0, standard deviation 1: the sum of four uniform numbers of 16 bits (Irwin-Hall). Its distribution is
    // within 0.7 % of the normal one, and it is bounded, so that noise has a strict bound: |value| <= kMaxNoise.
    [[nodiscard]] constexpr double noise(std::uint64_t sample, std::uint64_t lane = 0) const noexcept {
        const std::uint64_t b = bits(sample, lane);
        const auto sum = std::int64_t((b & 0xffff) + (b >> 16 & 0xffff) + (b >> 32 & 0xffff) + (b >> 48));
        return double(sum - 131070) * (1.7320508075688772 / 65535.5);  // 12^(1/2) / 2 / (2^16 - 1/2)
    }

private:
    std::uint64_t key_;
};
inline constexpr double kMaxNoise = 3.4642;  // 12^(1/2)

}  // namespace tactiled::sim
