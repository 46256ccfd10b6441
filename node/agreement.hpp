// Compares the forces of two sensors of the same object. Each sensor uses its own newest sample and the other's.
#pragma once
#include <cstdint>

#include "tactiled/layout.h"

namespace tactiled {

class Agreement {
public:
    struct Limits {
        int other = -1;    // index of the sensor to compare with, -1: none
        double max_N = 0;  // magnitude of the difference of the tared forces
        // time for which they may differ by more, and time of agreement until they are trusted again
        std::uint64_t patience_ns = 0;
    };
    explicit Agreement(const Limits& limits) : limits_(limits) {}

    [[nodiscard]] int other() const noexcept { return limits_.other; }
    // Changes the limits. The result for the same two sensors stays until they agree. rt: wait-free
    void judge_by(const Limits& limits) noexcept;
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

    Limits limits_;
    bool differs_ = false;
    std::uint64_t compared_ns_ = 0;         // time of the last possible comparison
    std::uint64_t otherwise_since_ns_ = 0;  // since then all comparisons contradict differs_; 0 = they do not
    std::uint64_t guilty_since_ns_ = 0;     // since then the other sensor is known to be wrong; 0 = it is not
};

}  // namespace tactiled
