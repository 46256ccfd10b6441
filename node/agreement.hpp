// Compares the forces of two sensors of the same object. Each sensor uses its own newest sample and the other's.
#pragma once
#include <cstdint>

#include "config/config.hpp"
#include "tactiled/layout.h"

namespace tactiled {

class Agreement {
public:
    // `pair` must outlive it: how much the tared forces may differ as a magnitude, and for how long they may differ by more,
    // which is also the time of agreement until they are trusted again. Other limits keep the result until they agree.
    explicit Agreement(const PairSettings& pair) : pair_(&pair) {}

    // The sensor to compare with, -1: none.
    [[nodiscard]] int other() const noexcept { return pair_->other; }
    // Continues from the state of `before`. rt: wait-free
    void succeed(const Agreement& before) noexcept;
    // True if they have differed for longer than allowed and have not agreed for as long since. rt: wait-free
    [[nodiscard]] bool differs() const noexcept { return differs_; }
    // Does one comparison and returns differs(). A sample that is doubtful for a reason of its own, or whose time
    // differs by more than the patience, is no evidence: the result stays, until the other sensor's own channels have
    // shown for as long that it was the wrong one. rt: wait-free
    bool compare(const tactiled_sample& mine, const tactiled_sample& others) noexcept;

private:
    [[nodiscard]] bool has_lasted(std::uint64_t& since_ns, std::uint64_t now_ns) const noexcept;

    [[nodiscard]] std::uint64_t patience_ns() const noexcept { return std::uint64_t(pair_->agree_ms) * 1'000'000u; }

    const PairSettings* pair_;
    bool differs_ = false;
    std::uint64_t compared_ns_ = 0;         // time of the last possible comparison
    std::uint64_t otherwise_since_ns_ = 0;  // since then all comparisons contradict differs_; 0 = they do not
    std::uint64_t guilty_since_ns_ = 0;     // since then the other sensor is known to be wrong; 0 = it is not
};

}  // namespace tactiled
