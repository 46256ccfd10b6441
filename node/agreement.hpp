// Whether two sensors of the same thing tell the same force. Each judges by its own newest sample and the other's.
#pragma once
#include <cstdint>

#include "tactiled/layout.h"

namespace tactiled {

class Agreement {
public:
    struct Limits {
        int other = -1;                 // index of the sensor to compare with, -1: none
        double most_N = 0;              // magnitude of the difference of the tared forces
        std::uint64_t patience_ns = 0;  // so long they may differ by more; so long they agree before they are believed again
        bool operator==(const Limits&) const = default;
    };
    explicit Agreement(const Limits& limits) : limits_(limits) {}

    [[nodiscard]] int other() const noexcept { return limits_.other; }
    // rt: wait-free
    void judge_by(const Limits& limits) noexcept;
    // True: they have differed for longer than allowed, and not agreed for as long since. A sample that is doubtful for a
    // reason of its own proves nothing, neither way: what was said last stays, until the other one's own channels show that
    // it was the wrong one. rt: wait-free
    [[nodiscard]] bool differs(const tactiled_sample& mine, const tactiled_sample& others) noexcept;

private:
    Limits limits_;
    bool differs_ = false;
    std::uint64_t otherwise_since_ns_ = 0;  // the comparisons contradict differs_; 0 = they do not
};

}  // namespace tactiled
