// Limits how often a link is opened again in order to prove the age of its frames. Time comes only from the caller.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tactiled {

class ReopeningPace {
public:
    // Returns true if the link may be opened again now, because of a trouble that exists since `trouble_ns`, and
    // counts it: at most once a second, and less often while it does not help. rt: wait-free
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
    // A trouble that begins so long after the last opening is another one.
    static constexpr std::uint64_t kHelped_ns = 5'000'000'000;

    std::uint64_t last_ns_ = 0, not_before_ns_ = 0, pause_ns_ = kMinPause_ns;
};

}  // namespace tactiled
