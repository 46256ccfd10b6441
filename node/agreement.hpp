// Compares the forces of two sensors of the same object: the newest sample of each.
#pragma once
#include <cstdint>

#include "config/config.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class Agreement {
public:
    // `pair` must outlive this object. Its limits are the largest accepted magnitude of the difference of the tared forces,
    // agree_N, and the patience, agree_ms: the result changes after the forces have been apart, or together again, for this
    // time. A change of the limits keeps the result.
    explicit Agreement(const PairSettings& pair) : pair_(&pair) {}

    // The sensor to compare with, -1: none.
    [[nodiscard]] int other() const noexcept { return pair_->other; }
    // Continues from the state of `before`. rt: wait-free
    void succeed(const Agreement& before) noexcept;
    // True if the forces have differed for longer than the patience and have not agreed for as long since. rt: wait-free
    [[nodiscard]] bool differs() const noexcept { return differs_; }
    // Does one comparison and returns differs(). A sample that is doubtful for another reason, or samples whose times differ
    // by more than the patience, leave the result unchanged. differs() becomes false if the channels of the other sensor
    // have shown for the patience that the other sensor is the faulty one. rt: wait-free
    bool compare(const tactiled_sample& mine, const tactiled_sample& others) noexcept;

private:
    [[nodiscard]] bool has_lasted(std::uint64_t& since_ns, std::uint64_t now_ns) const noexcept;

    [[nodiscard]] std::uint64_t patience_ns() const noexcept { return std::uint64_t(pair_->agree_ms) * 1'000'000u; }

    const PairSettings* pair_;
    bool differs_ = false;
    std::uint64_t compared_ns_ = 0;         // time of the last possible comparison
    std::uint64_t otherwise_since_ns_ = 0;  // since then all comparisons contradict differs_; 0 = none
    std::uint64_t guilty_since_ns_ = 0;     // since then the other sensor is known to be faulty; 0 = it is not
};

}  // namespace tactiled
