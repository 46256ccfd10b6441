// A device with channels of random gains and zeros and with noise, its calibration, and changes of its numbers.
#pragma once
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "decoupling/fit/fit.hpp"
#include "tests/bench/running.hpp"

namespace tactiled {

inline constexpr double kFullScale_N = 10, kNoise = 8, kWidth = 16'000, kRate_Hz = 100;  // counts
inline constexpr auto kPeriod_ns = std::uint64_t(1e9 / kRate_Hz);
using Force = std::array<double, 3>;

// Words of float32 numbers, as a device has them in its registers: the high word first.
inline std::vector<std::uint16_t> words_of(const Numbers& numbers) {
    std::vector<std::uint16_t> words;
    for (const double x : numbers) {
        const auto bits = std::bit_cast<std::uint32_t>(float(x));
        words.push_back(std::uint16_t(bits >> 16));
        words.push_back(std::uint16_t(bits));
    }
    return words;
}
inline double float_of(std::uint16_t high, std::uint16_t low) {
    return double(std::bit_cast<float>(std::uint32_t(high) << 16 | low));
}

struct Change {
    const char* name;
    std::function<Numbers(const Numbers&)> read;
};
inline Change scaled(const char* name, double factor, bool rounds) {
    return {name, [=](Numbers numbers) {
                for (double& x : numbers) x = rounds ? std::round(x * factor) : x * factor;
                return numbers;
            }};
}
inline Change of_words(const char* name,
                       const std::function<double(const std::vector<std::uint16_t>&, std::size_t)>& number) {
    return {name, [=](Numbers numbers) {
                auto words = words_of(numbers);
                words.resize(words.size() + 4 * numbers.size());
                for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = number(words, k);
                return numbers;
            }};
}
// Channels with random gains and zeros, and noise.
class Made {
public:
    // `is_offset`: its numbers without a load are not near 0.
    Made(int number, bool is_offset) : random_(unsigned(number)) {
        static constexpr std::size_t kChannels[] = {3, 6, 8, 15};
        gain_.resize(kChannels[std::size_t(number) % 4]);
        for (auto& row : gain_)
            for (double& x : row) x = normal_(random_) * kWidth / kFullScale_N / 2;
        const double zero = is_offset ? kWidth / 4 : 0;
        for (std::size_t k = 0; k < gain_.size(); ++k) zero_.push_back(zero * normal_(random_));
    }
    Numbers read(const Force& force) {
        Numbers numbers;
        for (std::size_t k = 0; k < gain_.size(); ++k) {
            double x = zero_[k] + kNoise * normal_(random_);
            for (std::size_t c = 0; c < 3; ++c) x += gain_[k][c] * force[c];
            numbers.push_back(std::round(x));
        }
        return numbers;
    }
    // Another unit of the same kind, or the same one after it has found another zero.
    void move_zero() {
        for (double& x : zero_) x += kWidth / 10 * normal_(random_);
    }
    Force load() {
        std::uniform_real_distribution<double> uniform(-0.8, 0.8);
        return {kFullScale_N * uniform(random_), kFullScale_N * uniform(random_), kFullScale_N * uniform(random_)};
    }
    // 60 loads of half a second, and a rest after each.
    Calibration calibrate() {
        Labelled labelled{.name = "made.csv", .channels = {}, .sessions = {"1"}, .rows = {}};
        for (std::size_t k = 0; k < gain_.size(); ++k) labelled.channels.push_back(fmt::format("c{}", k + 1));
        for (int held = 0; held < 120; ++held) {
            const Force force = held % 2 == 0 ? Force{} : load();
            for (int i = 0; i < int(kRate_Hz / 2); ++i) {
                const std::size_t n = labelled.rows.size() + 1;
                labelled.rows.push_back({.line = std::int64_t(n) + 1,
                                         .channel = read(force),
                                         .wrench_S = {force[0], force[1], force[2], kNaN, kNaN, kNaN},
                                         .session = 0,
                                         .t_ns = std::uint64_t(double(n) * 1e9 / kRate_Hz)});
            }
        }
        FitRequest request;
        request.model = "generic";
        request.method = "matrix";
        request.date = "2026-01-01";
        return fit(labelled, request).calibration;
    }

private:
    std::mt19937_64 random_;
    std::normal_distribution<double> normal_;
    std::vector<Force> gain_;
    Numbers zero_;
};

}  // namespace tactiled
