// Limits how often a link is opened again in order to prove the age of its frames. The caller passes the time.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tactiled {

class ReopeningPace {
public:
    // Returns true if the link may be opened again now because of a fault that exists since `trouble_ns`, and counts the
    // opening. The limit is one opening per second, and less while openings do not help. rt: wait-free
    [[nodiscard]] bool allows(std::uint64_t host_ns, std::uint64_t trouble_ns) noexcept {
        if (host_ns < not_before_ns_) return false;
        const bool helped = trouble_ns > last_ns_ + kHelped_ns;
        pause_ns_ = helped ? kMinPause_ns : std::min(2 * pause_ns_, kMaxPause_ns);
        last_ns_ = host_ns;
        not_before_ns_ = host_ns + pause_ns_;
        return true;
    }

private:
    static constexpr std::uint64_t kMinPause_ns = 1'000'000'000, kMaxPause_ns = 60'000'000'000;
    // A fault that begins at least this long after the last opening counts as a new fault.
    static constexpr std::uint64_t kHelped_ns = 5'000'000'000;

    std::uint64_t last_ns_ = 0, not_before_ns_ = 0, pause_ns_ = kMinPause_ns;
};

}  // namespace tactiled
