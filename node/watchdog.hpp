// Feeds systemd's watchdog (WatchdogSec=) while the pipeline and each link make progress, so that systemd restarts a daemon
// that hangs. Without a watchdog the thread that does not respond is only logged.
#pragma once
#include <atomic>
#include <cstdint>

#include "node/progress.hpp"
#include "node/realtime.hpp"
#include "node/wake_word.hpp"

namespace tactiled {

class Watchdog {
public:
    explicit Watchdog(Progress& progress);
    ~Watchdog();
    Watchdog(const Watchdog&) = delete;
    Watchdog& operator=(const Watchdog&) = delete;

private:
    void run() noexcept;

    Progress& progress_;
    std::uint64_t timeout_us_ = 0;  // 0: there is no watchdog
    std::atomic<bool> stop_{false};
    WakeWord end_;
    RtThread thread_;
};

}  // namespace tactiled
