// Compares the forces of two sensors of the same object. Each judges by its own newest sample and the other's.
#pragma once
#include <cstdint>

#include "tactiled/layout.h"

namespace tactiled {

class Agreement {
public:
    struct Limits {
        int other = -1;                 // index of the sensor to compare with, -1: none
        double max_N = 0;               // magnitude of the difference of the tared forces
        std::uint64_t patience_ns = 0;  // so long they may differ by more; so long they agree before they are believed again
    };
    explicit Agreement(const Limits& limits) : limits_(limits) {}

    [[nodiscard]] int other() const noexcept { return limits_.other; }
    // By these from now on; what was said of the same two stays until they agree. rt: wait-free
    void judge_by(const Limits& limits) noexcept;
    // Goes on where `before` ends. rt: wait-free
    void succeed(const Agreement& before) noexcept;
    // They have differed for longer than allowed, and not agreed for as long since. rt: wait-free
    [[nodiscard]] bool differs() const noexcept { return differs_; }
    // The same, after one more look at both. A sample that is doubtful for a reason of its own, or further away in time than
    // the patience, proves nothing, neither way: what was said last stays, until the other one's own channels have shown for
    // as long that it was the wrong one. rt: wait-free
    bool compare(const tactiled_sample& mine, const tactiled_sample& others) noexcept;

private:
    [[nodiscard]] bool has_lasted(std::uint64_t& since_ns, std::uint64_t now_ns) const noexcept;

    Limits limits_;
    bool differs_ = false;
    std::uint64_t compared_ns_ = 0;         // when two samples last could be
    std::uint64_t otherwise_since_ns_ = 0;  // the comparisons contradict differs_, without a gap; 0 = they do not
    std::uint64_t guilty_since_ns_ = 0;     // the other one is known to be wrong; 0 = it is not
};

}  // namespace tactiled
