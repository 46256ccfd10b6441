#include "node/watchdog.hpp"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include "node/log.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {
// short compared with WatchdogSec, because the last feeding may be this long after the begin of the hang
constexpr std::uint64_t kLookNs = 250'000'000;
}  // namespace

Watchdog::Watchdog(Progress& progress) : progress_(progress) {
    if (::sd_watchdog_enabled(0, &timeout_us_) <= 0) timeout_us_ = 0;
    thread_.start("watchdog", 0, -1, [this] { run(); });
}

Watchdog::~Watchdog() {
    stop_.store(true);
    end_.wake();
    thread_.join();
}

void Watchdog::run() noexcept {
    std::string_view said;
    std::uint64_t stuck_ns = 0;
    for (;;) {
        const std::uint32_t seen = end_.value();
        if (stop_.load()) return;
        const std::uint64_t now_ns = monotonic_ns();
        const std::string_view stuck = progress_.look(now_ns);
        if (stuck.empty() && timeout_us_ != 0) ::sd_notify(0, "WATCHDOG=1");
        if (stuck != said) {
            if (stuck.empty())
                log_line(LogLevel::warning, "{}: responds again", said);
            else if (timeout_us_ == 0)
                log_line(LogLevel::error, "{}: does not respond", stuck);
            else
                log_line(LogLevel::error, "{}: does not respond; systemd restarts the daemon if this lasts {} ms", stuck,
                         timeout_us_ / 1000);
            said = stuck;
            stuck_ns = now_ns;
        }
        // systemd's own timer is up to 250 ms late. It is needed only if this thread hangs, too.
        if (!stuck.empty() && timeout_us_ != 0 && now_ns - stuck_ns > timeout_us_ * 900) ::sd_notify(0, "WATCHDOG=trigger");
        (void)end_.sleep(seen, now_ns + kLookNs);
    }
}

}  // namespace tactiled
