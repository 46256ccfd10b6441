// Waits for bytes in slices, so that a stop of the process is noticed: bytes arrived after the last time at which there were
// none.
#pragma once
#include <poll.h>

#include <algorithm>
#include <cstdint>

#include "drivers/clock.hpp"

namespace tactiled {

class SlicedWait {
public:
    // After a silence a slice is a fortieth of it: the first bytes after it are dated with that error, which is at most
    // stale_ms / 40 while their sensor is GOOD.
    static constexpr int kSliceMs = 10, kSilencePerSlice = 40;
    static constexpr std::uint64_t kLateMs = 20;  // a running process continues this soon after the end of a slice
    static constexpr std::uint64_t kOrdinaryNs = (kSliceMs + kLateMs) * 1'000'000;
    static constexpr std::uint64_t kAwayNs = 1'000'000'000;  // older bytes are dropped

    // The link was opened. rt: wait-free
    void open() noexcept {
        heard_ns_ = now_ns();
        slice_ns_ = 0;
    }

    // Waits for bytes, and calls `after_slice` after each slice without any. Returns the result of ppoll: 0 = none. Without
    // a time limit only a read shows whether bytes are there, and the result is 1.
    // rt: blocks on the link, for at most `timeout_ms`
    template <class AfterSlice>
    [[nodiscard]] int wait(int fd, int timeout_ms, AfterSlice after_slice) noexcept {
        int ready = timeout_ms == 0;
        slice_ns_ = 0;
        for (int left_ms = timeout_ms; ready == 0;) {
            const std::uint64_t silence_ms = (now_ns() - heard_ns_) / 1'000'000;
            const int slice_ms = std::min(left_ms, std::max(kSliceMs, int(silence_ms / kSilencePerSlice)));
            slice_ns_ = std::uint64_t(slice_ms) * 1'000'000;
            const std::uint64_t waits_ns = with_suspend_ns();
            pollfd waiting{fd, POLLIN, 0};
            const timespec timeout{slice_ms / 1000, long(slice_ms % 1000) * 1'000'000};
            ready = ::ppoll(&waiting, 1, &timeout, nullptr);
            if (ready != 0) break;
            empty_ns_ = waits_ns + slice_ns_;  // the kernel had no bytes at the end of the slice, either
            after_slice();
            if ((left_ms -= slice_ms) <= 0) break;
        }
        return ready;
    }

    // Bytes were read at `now`. rt: wait-free
    void heard(std::uint64_t now) noexcept { heard_ns_ = now; }
    // No bytes waited at this time, with_suspend_ns(). rt: wait-free
    void seen_empty(std::uint64_t at_ns) noexcept { empty_ns_ = at_ns; }
    // Returns the time for which bytes may have waited until now. rt: wait-free
    [[nodiscard]] std::uint64_t waited_ns() const noexcept { return with_suspend_ns() - empty_ns_; }
    // Returns the length of the last slice.
    [[nodiscard]] std::uint64_t slice_ns() const noexcept { return slice_ns_; }

private:
    std::uint64_t empty_ns_ = 0;  // time, with_suspend_ns(), at which no bytes waited: bytes read arrived later
    std::uint64_t heard_ns_ = 0;  // time of the opening, or of the last bytes
    std::uint64_t slice_ns_ = 0;
};

}  // namespace tactiled
